/* Places of people on their paths, and kerbs: loops for people.py. */

/* _People._ahead */
static D path_ahead(const K *k, I i, D arc, D distance) {
  D there = arc + distance;
  return k->is_loop[i] ? fmod(there, k->path_length[i]) : least(k->path_length[i], there); /* as by fmin */
}

/* Paths.find; of a place that is no number, or beyond all keys, the last leg, as numpy finds it. */
static const D *find_leg(const K *k, I i, D arc) {
  D place = arc * KEYS_PER_METRE;
  I key = fabs(place) < MAX_KEY ? k->path_base[i] + (I)place : -1, from = find_not_below(k->keys, k->num_keys, key + 1);
  return k->segments + LEG_COLUMNS * ((from ? from : k->num_keys) - 1);
}

/* _People._feet: the foot of person i on a leg; returns whether it is at the end. No number is the begin, as by fmax. */
static int find_foot(const K *k, I i, const D *leg, D *foot, D *away) {
  I r = k->rows[i];
  D length = leg[LEG_END] - leg[LEG_START], east = k->x[r] - leg[LEG_X], north = k->y[r] - leg[LEG_Y];
  D along = east * leg[LEG_DX] + north * leg[LEG_DY], on = least(length, most(0.0, along));
  *foot = leg[LEG_START] + on, *away = hypot(east - on * leg[LEG_DX], north - on * leg[LEG_DY]);
  return along >= length;
}

/* _People._look_along */
static void look_on(K *k, I i, D arc) {
  D ahead = path_ahead(k, i, arc, LOOK_AHEAD), side = k->side_of[i];
  const D *leg = find_leg(k, i, ahead), *here = find_leg(k, i, arc);
  D along = ahead - leg[LEG_START];
  k->arc[i] = arc;
  k->goal[i].x = leg[LEG_X] + along * leg[LEG_DX] + side * leg[LEG_DY];
  k->goal[i].y = leg[LEG_Y] + along * leg[LEG_DY] - side * leg[LEG_DX];
  k->course[i] = (V){here[LEG_DX] + 0.0, here[LEG_DY] + 0.0};
}

/* _People._project and _hold_at_kerb */
EXPORT void find_places(K *k) {
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    D before = k->leg_start[r], here, there, away, other;
    int is_over = find_foot(k, i, find_leg(k, i, before), &here, &away);
    find_foot(k, i, find_leg(k, i, path_ahead(k, i, before, LOOK_AHEAD)), &there, &other);
    look_on(k, i, other < away || is_over ? there : here);
    if (hypot(k->goal[i].x - k->x[r], k->goal[i].y - k->y[r]) < 0.5 * LOOK_AHEAD)
      look_on(k, i, path_ahead(k, i, k->arc[i], 0.25 * LOOK_AHEAD));
    D arc = k->arc[i], held = arc;
    for (I c = k->first[i]; c < k->first[i + 1]; c++)
      if (before < k->start[c] && arc >= k->start[c] && k->yields[r] != COMMITTED + c - k->first[i])
        held = least(held, nextafter(k->start[c], 0.0));
    if (held < arc) look_on(k, i, held);
  }
}

/* The speed that person i wants, and the crossing that is next on its way: _People._wishes and _mind_kerb. */
static void look_at_kerb(K *k, I i) {
  I r = k->rows[i], first = k->first[i], state = k->yields[r], next = -1;
  D arc = k->arc[i], nearest = INFINITY;
  int is_inside = 0;
  for (I c = first; c < k->first[i + 1]; c++) {
    D to = k->start[c] - arc;
    if (to <= 0.0 && arc <= k->end[c]) to = 0.0, is_inside = 1;
    else if (to <= 0.0 && k->is_loop[i]) to += k->path_length[i];
    if (to >= 0.0 && to < INFINITY && to <= nearest) nearest = to, next = c - first;
  }
  if (state >= COMMITTED && next != state - COMMITTED) state = 1;
  if (is_inside && state < COMMITTED) state = COMMITTED + next;
  k->wish[i] = k->start_within[r] > 0.0 || arc >= k->stop_from[i] ? 0.0 : k->desired_speed[r];
  k->nearest[i] = nearest, k->next[i] = next, k->yields[r] = state;
}

/* Returns how many ask whether they may cross: asks, and the crossings. */
EXPORT I look_at_kerbs(K *k) {
  I num = 0;
  for (I i = 0; i < k->n; i++) {
    look_at_kerb(k, i);
    if (k->yields[k->rows[i]] < COMMITTED && k->nearest[i] < AT_KERB && k->wish[i] > 0.0)
      k->crossing[num] = k->first[i] + k->next[i], k->asks[num++] = i;
  }
  return num;
}

/* Some begin to cross; the others stop at the kerb. */
EXPORT void mind_kerbs(K *k, I num) {
  for (I j = 0; j < num; j++)
    if (k->goes[j]) k->yields[k->rows[k->asks[j]]] = COMMITTED + k->next[k->asks[j]];
  for (I i = 0; i < k->n; i++) {
    D stop = sqrt(2.0 * BRAKE * most(k->nearest[i] - KERB_GAP, 0.0));
    k->slower[i] = k->yields[k->rows[i]] < COMMITTED ? least(k->wish[i], stop) : k->wish[i];
  }
}
