/* Right of way: loops for right_of_way.py. */

/* Where the tail of driver i is on the lane that it holds; -inf if only the nose is there. */
static D tail_on_held(const K *k, I i, I r) {
  I held = k->held[r];
  int is_behind = k->lane[r] != held;
  if (is_behind && find_entered(k, i, r, held) > 0) return -INFINITY;
  return k->arc[r] - k->rear[i] + (is_behind ? k->length[held] : 0.0);
}

static void update_holds(K *k) {
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i], claim = k->claim[r];
    if (claim >= 0 && claim == k->lane[r] && k->arc[r] + k->nose[i] >= k->wait_point[claim])
      k->held[r] = claim, k->claim[r] = -1;
    if (k->held[r] >= 0 && tail_on_held(k, i, r) > k->clear_point[k->held[r]]) k->held[r] = -1;
  }
}

/* Whether driver i is near enough to ask, and does not follow one that waits itself. */
static int is_near(const K *k, I i) {
  I lead = k->lead[i];
  D speed = k->speed[k->rows[i]], distance = k->asked_distance[i];
  D braking = speed * (speed / (2.0 * BRAKE_FROM) + k->headway[i]) + STOP_GAP + GAP;
  if (!(distance < braking)) return 0;
  return !(k->gap[i] <= distance) || (lead >= 0 && (k->claim[k->rows[lead]] >= 0 || k->asked_again[lead]));
}

/* Whether driver i has no claim for a lane before; one for a short lane that its nose is on becomes a hold. */
static int may_claim(K *k, I i) {
  I r = k->rows[i], claim = k->claim[r], is_ahead = 0;
  for (I j = 0; claim >= 0 && j < NUM_LANES; j++) is_ahead |= LANE(r, j) == claim;
  if (!is_ahead) return 1;
  if (!(k->length[claim] < k->nose[i] + STOP_GAP + CREEP && find_entered(k, i, r, claim) > 0)) return 0;
  k->held[r] = claim, k->claim[r] = -1;
  return 1;
}

/* right_of_way.find_rivals: the lanes on which long vehicles are or want to be, and whether a pair of lanes counts. */
static void find_long(K *k, I num) {
  for (I lane = 0; lane < k->num_lanes; lane++) k->has_long[lane] = 0;
  if (!k->has_passes) return;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    if (!(k->body_length[i] > HEAVY_LENGTH)) continue;
    if (k->claim[r] >= 0) k->has_long[k->claim[r]] = 1;
    if (k->held[r] >= 0) k->has_long[k->held[r]] = 1;
    k->has_long[k->lane[r]] = 1;
  }
  for (I j = 0; j < num; j++)
    if (k->body_length[k->asking[j]] > HEAVY_LENGTH) k->has_long[k->asked[k->asking[j]]] = 1;
  for (I j = 0; j < k->num_moving; j++)
    if (2.0 * (k->other_s[j] - k->other_tail[j]) > HEAVY_LENGTH) k->has_long[k->other_lane[j]] = 1;
}

static inline int counts(const K *k, I i, I x) {
  return !k->rival_passes[x] || k->body_length[i] > HEAVY_LENGTH || k->has_long[k->rival_other[x]];
}

static int has_rival(const K *k, I i) {
  for (I x = k->rival_first[k->asked[i]]; x < k->rival_first[k->asked[i] + 1]; x++)
    if (counts(k, i, x)) return 1;
  return 0;
}

/* What stands on lanes, and the room behind them; keeps those who find room and nothing in their way. */
static I keep_those_with_room(K *k, I num) {
  I kept = 0;
  for (I lane = 0; lane < k->num_lanes; lane++) k->reserved[lane] = 0.0, k->stands[lane] = 0;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    if ((k->claim[r] >= 0 || k->held[r] >= 0) && k->exit_lane[r] >= 0)
      k->reserved[k->exit_lane[r]] += k->body_length[i] + GAP;
  }
  for (I j = 0; j < k->num_others; j++)
    if (k->other_stands[j]) k->stands[k->other_lane[j]] = 1;
  for (I j = 0; j < num; j++) {
    I i = k->asking[j], exit_lane = k->asked_exit[i];
    int has_room = 1, is_free = !k->stands[k->asked[i]];
    if (exit_lane >= 0 && isinf(k->wait_point[exit_lane])) {
      I first = k->q_first[exit_lane];
      D room = k->q_tail[first] + ROOM_TIME * k->q_speed[first];
      has_room = room - k->reserved[exit_lane] >= k->body_length[i] + GAP;
    }
    if (k->has_passes && !has_rival(k, i)) has_room = 1;
    k->is_shut_out[i] |= !has_room, k->is_blocked[i] |= !is_free;
    if (has_room && is_free) k->asking[kept++] = i;
  }
  return kept;
}

/* _find_holds: the tail of driver i on a lane that it holds; -inf on those under its body before it; inf for none. */
static D tail_on(const K *k, I i, I lane) {
  I r = k->rows[i], held = k->held[r];
  if (held < 0) return INFINITY;
  D tail = tail_on_held(k, i, r);
  D found = lane == held ? tail : INFINITY;
  for (I j = 0; isinf(tail) && j < NUM_LANES - 1 && LANE(r, j) != held; j++)
    if (LANE(r, j) == lane) found = -INFINITY;
  return found;
}

/* The last tail on a lane, of which driver it is (-1 for none), and the last one of all others. */
static void take(K *k, I lane, D tail, I i) {
  if (tail < k->taken[lane]) {
    if (i != k->taken_by[lane]) k->taken_else[lane] = k->taken[lane];
    k->taken[lane] = tail, k->taken_by[lane] = i;
  } else if (i != k->taken_by[lane]) k->taken_else[lane] = least(k->taken_else[lane], tail);
}

/* _taken, and on which lanes drivers stand. */
static void take_lanes(K *k) {
  for (I lane = 0; lane < k->num_lanes; lane++) {
    k->taken[lane] = k->taken_else[lane] = k->nearest[lane] = INFINITY;
    k->best[lane] = k->taken_by[lane] = -1;
  }
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i], held = k->held[r];
    if (held < 0) continue;
    if (k->speed[r] < CREEP) k->stands[held] = 1;
    take(k, held, tail_on_held(k, i, r), i);
    if (!isinf(tail_on_held(k, i, r))) continue;
    for (I j = 0; j < NUM_LANES - 1 && LANE(r, j) != held; j++)
      take(k, LANE(r, j), -INFINITY, i);
  }
  for (I j = 0; j < k->num_moving; j++) take(k, k->other_lane[j], k->other_tail[j], -1);
  for (I i = 0; i < k->n; i++)
    if (k->claim[k->rows[i]] >= 0) take(k, k->claim[k->rows[i]], -INFINITY, -1);
}

/* _are_taken: whether others than driver i have the rival of pair x. */
static int is_taken(const K *k, I i, I x) {
  I rival = k->rival_other[x];
  return (k->taken_by[rival] == i ? k->taken_else[rival] : k->taken[rival]) < k->rival_figure[x];
}

/* The order of those who ask: place, right before left, not to the left, distance, lane, index. */
static int comes_before(const K *k, I a, I b) {
  I i = k->asking[a], j = k->asking[b];
  if (k->asking_place[a] != k->asking_place[b]) return k->asking_place[a] < k->asking_place[b];
  if (k->is_second[a] != k->is_second[b]) return k->is_second[a] < k->is_second[b];
  int left = k->turn[k->asked[i]] > LEFT_TURN, other_left = k->turn[k->asked[j]] > LEFT_TURN;
  if (left != other_left) return left < other_left;
  if (k->asked_distance[i] != k->asked_distance[j]) return k->asked_distance[i] < k->asked_distance[j];
  if (k->asked[i] != k->asked[j]) return k->asked[i] < k->asked[j];
  return a < b;
}

/* Where in the list of its lane the first one is that waits for the same rivals as j; the end if there is none. All
   short ones wait for the same, and all long ones. One that has the last tail on a rival itself is apart. */
static I *find_alike(K *k, I j) {
  I i = k->asking[j], lane = k->asked[i], *at = &k->best[lane];
  k->alike[j] = k->body_length[i] > HEAVY_LENGTH ? -1 : -2;
  for (I x = k->rival_first[lane]; x < k->rival_first[lane + 1]; x++)
    if (k->taken_by[k->rival_other[x]] == i) k->alike[j] = j;
  while (*at >= 0 && k->alike[*at] != k->alike[j]) at = &k->next_best[*at];
  return at;
}

/* The lists of those who ask for a lane, the first one alone of those alike; and who could go if nobody else asked. */
static void rank(K *k, I num) {
  for (I j = 0; j < num; j++) {
    I i = k->asking[j], lane = k->asked[i];
    int is_let_in = (k->decision[i] + k->let_in_later[i]) % LET_IN_EVERY < LET_IN_FOR &&
                    k->speed[k->rows[i]] < CREEP && k->asked_distance[i] < 2.0 * STOP_GAP;
    k->asking_place[j] = rint(k->asked_distance[i] / SAME_DISTANCE) + (k->gives_way[lane] && !is_let_in ? FAR : 0.0);
    k->nearest[lane] = least(k->nearest[lane], k->asking_place[j]);
  }
  for (I j = 0; j < num; j++) {
    I i = k->asking[j], lane = k->asked[i];
    k->is_second[j] = 0, k->can_go[j] = 1;
    for (I x = k->rival_first[lane]; x < k->rival_first[lane + 1]; x++) {
      I rival = k->rival_other[x];
      if (!counts(k, i, x)) continue;
      if (k->nearest[rival] == k->asking_place[j] && k->rival_right[x]) k->is_second[j] = 1;
      if (is_taken(k, i, x)) k->can_go[j] = 0;
    }
  }
  for (I j = 0; j < num; j++) {
    I *at = find_alike(k, j), other = *at;
    if (other >= 0 && comes_before(k, other, j)) continue;
    k->next_best[j] = other < 0 ? -1 : k->next_best[other], *at = j;
  }
}

/* Whether one who asks waits for driver i to leave the crossing. */
static int waits_for(const K *k, I asker, I i) {
  I other = k->asking[asker], lane = k->asked[other];
  for (I x = k->rival_first[lane]; x < k->rival_first[lane + 1]; x++)
    if (counts(k, other, x) && is_taken(k, other, x) && tail_on(k, i, k->rival_other[x]) < INFINITY) return 1;
  return 0;
}

/* Whether one who asks for a rival goes before j; those who wait for j do not count if it could go. */
static int goes_first(const K *k, I rival, I j, int takes) {
  I i = k->asking[j];
  int all_count = takes || k->held[k->rows[i]] < 0;
  for (I other = k->best[rival]; other >= 0; other = k->next_best[other])
    if (comes_before(k, other, j) && (all_count || !waits_for(k, other, i))) return 1;
  return 0;
}

static void give(K *k, I num) {
  for (I j = 0; j < num; j++) {
    I i = k->asking[j], lane = k->asked[i], is_refused = !k->can_go[j];
    for (I x = k->rival_first[lane]; x < k->rival_first[lane + 1]; x++) {
      I rival = k->rival_other[x];
      if (!counts(k, i, x)) continue;
      int is_own = tail_on(k, i, rival) < INFINITY, takes = is_taken(k, i, x);
      is_refused |= goes_first(k, rival, j, takes);
      k->is_blocked[i] |= k->stands[rival] && (!is_own || takes);
    }
    k->can_go[j] = !is_refused;
  }
  for (I j = 0; j < num; j++) {
    I i = k->asking[j], r = k->rows[i];
    if (k->can_go[j]) k->claim[r] = k->asked[i], k->exit_lane[r] = k->asked_exit[i];
  }
}

/* Comes after the keys were sorted. */
EXPORT void perceive(K *k) {
  I near = 0, num = 0;
  line_up(k);
  for (I i = 0; i < k->n; i++) look_along(k, i);
  for (I i = 0; i < k->n; i++)
    if (k->asked[i] >= 0 && is_near(k, i)) k->asking[near++] = i;
  for (I j = 0; j < near; j++)
    if (may_claim(k, k->asking[j])) k->asking[num++] = k->asking[j];
  if (num) {
    find_long(k, num);
    num = keep_those_with_room(k, num);
  }
  if (num) {
    take_lanes(k);
    rank(k, num);
    give(k, num);
  }
  for (I i = 0; i < k->n; i++)
    if (k->asked[i] >= 0 && k->claim[k->rows[i]] != k->asked[i])
      k->stop_distance[i] = least(k->stop_distance[i], k->asked_distance[i]);
}
