/* What drivers perceive: loops for lane_entries.py and driver_perception.py, with the rules of look_rules.py and
   driver_model.py. */

/* lane_entries._keys */
static inline I key_of(const K *k, I lane, D s) {
  I ticks = (I)((k->base[lane] + hold_on(k, lane, s)) * TICKS);
  if (k->scale_ticks) ticks += k->scale_of_lane[lane] * k->scale_ticks;
  return ticks << INDEX_BITS;
}

/* EntryQueue.find */
static inline I find_in_queue(const K *k, I lane, D s) {
  return find_not_below(k->q_key, k->num_entries + 1, key_of(k, lane, s));
}

static void enter(K *k, I lane, D s, D tail, D speed, D accel, I source) {
  I j = k->num_entries++;
  k->e_lane[j] = lane, k->e_s[j] = s, k->e_tail[j] = tail;
  k->e_speed[j] = speed, k->e_accel[j] = accel, k->e_source[j] = source;
  k->q_key[j] = key_of(k, lane, s) | j;
}

/* All entries, in the order of EntryQueue: own, of those that change lanes, of siblings, of others; and their keys. */
static void enter_all(K *k) {
  k->num_entries = 0;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    enter(k, k->lane[r], k->arc[r], k->arc[r] - k->rear[i], k->speed[r], k->accel[r], i);
  }
  for (I j = 0; j < k->num_leaving; j++)
    enter(k, k->left_lane[j], k->left_s[j], k->left_tail[j], k->left_speed[j], k->left_accel[j], k->left_source[j]);
  for (I i = 0; i < k->n; i++) {
    I lane = k->e_lane[i];
    if (k->e_tail[i] >= k->shared[lane]) continue;
    for (I j = k->sibling_first[lane]; j < k->sibling_first[lane + 1]; j++)
      if (k->e_tail[i] < k->sibling_figure[j])
        enter(k, k->sibling_other[j], k->e_s[i], k->e_tail[i], k->e_speed[i], k->e_accel[i], i);
  }
  for (I j = 0; j < k->num_others; j++)
    enter(k, k->other_lane[j], k->other_s[j], k->other_tail[j], k->other_speed[j], k->other_accel[j], -1);
}

/* The queue, after its keys were sorted. */
static void line_up(K *k) {
  I num = k->num_entries, last = -1;
  for (I lane = 0; lane <= k->num_lanes; lane++) k->q_first[lane] = num;
  for (I p = 0; p < num; p++) {
    I j = k->q_key[p] & INDEX_MASK, lane = k->e_lane[j];
    k->q_position[j] = p, k->q_lane[p] = lane, k->q_s[p] = k->e_s[j], k->q_tail[p] = k->e_tail[j];
    k->q_speed[p] = k->e_speed[j], k->q_accel[p] = k->e_accel[j], k->q_source[p] = k->e_source[j];
    if (lane != last) k->q_first[lane] = p;
    last = lane;
  }
  k->q_key[num] = LAST_KEY | num, k->q_lane[num] = k->q_source[num] = -1;
  k->q_s[num] = k->q_tail[num] = INFINITY, k->q_speed[num] = k->q_accel[num] = 0.0;
}

/* A request for a lane; a claim for it is given back. */
static void request(K *k, I i, I r, I lane, I exit_lane, D distance) {
  k->asked[i] = lane, k->asked_exit[i] = exit_lane, k->asked_distance[i] = distance;
  k->asked_again[i] = k->claim[r] == lane;
  if (k->asked_again[i]) k->claim[r] = -1;
}

/* The look of driver i along its lanes. Its lead vehicle is at a position in the queue, num_entries for none. */
static void look_along(K *k, I i) {
  I r = k->rows[i], lane = k->lane[r], lead = k->q_position[i] + 1;
  D speed = k->speed[r], nose = k->nose[i], f[6];
  const D *at = k->speeds_ahead + 7 * k->point[r];
  if (k->q_lane[lead] != lane) lead = k->num_entries;
  D gap = k->q_tail[lead] - k->arc[r] - nose, stops = INFINITY, distance = k->length[lane] - k->arc[r];
  foresee(f, speed, k->accel[r], nose, k->lateral_now[i], k->speed_factor[i], k->own_accel[i], k->comfort[i],
          k->headway[i], k->reaction[i], k->arc[r], at[0], at[2], at[3], at[5], at[6]);
  D horizon = f[0], stop_way = f[1], square = f[5], reach = speed * (FORESIGHT + k->reaction[i]) + TURNS_AHEAD;
  D to_wait = k->wait_point[lane] - k->arc[r] - nose;
  k->asked[i] = k->asked_exit[i] = -1, k->asked_distance[i] = INFINITY, k->asked_again[i] = 0;
  int asks = 0.0 < to_wait && to_wait < INFINITY && k->held[r] != lane && (k->claim[r] != lane || to_wait > stop_way);
  if (asks) request(k, i, r, lane, LANE(r, 1), to_wait);
  I held_at = find_entered(k, i, r, k->held[r]);
  for (I part = 1; part < NUM_LANES && distance < horizon; part++) {
    D to_line = distance - nose;
    lane = LANE(r, part);
    if (lane < 0) { stops = least(stops, to_line); break; }
    if (!k->may_enter[lane] && to_line > 0.0 && to_line > firm_stop(speed, k->accel[r], k->reaction[i])) {
      stops = least(stops, to_line);
      if (k->claim[r] == lane) k->claim[r] = -1;
    }
    to_wait = to_line + k->wait_point[lane];
    int may_ask = part > held_at && to_wait < INFINITY && stops == INFINITY && !asks;
    if (may_ask && (k->claim[r] != lane || to_wait > stop_way)) {
      asks = 1;
      request(k, i, r, lane, part + 1 < NUM_LANES ? LANE(r, part + 1) : -1, to_wait);
    }
    at = k->speeds_ahead + 7 * k->first[lane];
    D allowed = slow_down(distance, reach, k->comfort[i], f[2], f[3], f[4], at[1], at[2], at[4], at[5]);
    square = least(square, allowed);
    if (gap == INFINITY) {
      lead = k->q_first[lane];
      gap = distance + k->q_tail[lead] - nose;
    }
    distance += k->length[lane];
  }
  k->gap[i] = gap, k->lead_at[i] = lead, k->lead[i] = k->q_source[lead];
  k->lead_speed[i] = k->q_speed[lead], k->lead_accel[i] = k->q_accel[lead];
  k->stop_distance[i] = stops, k->safe_speed[i] = sqrt(most(square, MIN_SAFE_SPEED * MIN_SAFE_SPEED));
  k->is_shut_out[i] = k->is_blocked[i] = 0;
}

/* The acceleration that driver i chooses: driver_model.accelerate, with the vehicle ahead of its lead vehicle. */
static D choose_accel(const K *k, I i) {
  I lead = k->lead_at[i], next = lead + 1;
  D speed = k->speed[k->rows[i]], a = k->own_accel[i], b = k->comfort[i], t = k->headway[i];
  D chosen = drive_free(speed, k->desired[i], k->safe_speed[i], a);
  if (k->stop_distance[i] < INFINITY) chosen = stop(chosen, speed, k->stop_distance[i]);
  if (k->gap[i] < INFINITY)
    chosen = least(chosen, follow(speed, k->gap[i], k->lead_speed[i], k->lead_accel[i], a, b, t));
  if (lead < k->num_entries && k->q_lane[next] == k->q_lane[lead] &&
      (speed - k->q_speed[next] > MUCH_SLOWER || (k->lead[i] >= 0 && k->is_leaving[k->lead[i]]))) {
    D gap = k->gap[i] + k->q_tail[next] - k->q_tail[lead];
    chosen = least(chosen, follow(speed, gap, k->q_speed[next], k->q_accel[next], a, b, t));
  }
  return most(chosen, -HARDEST);
}
