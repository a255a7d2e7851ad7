/* Steering and motion: loops for lane_following.py, lane_position.py, lane_wander.py and lane_change_motion.py.
   Sines, cosines and arc tangents are arrays that numpy has made. */

/* bends.stretch, in the middle of the distance ahead. */
static D find_stretch(const K *k, I r, D distance) {
  D length = k->leg_end[r] - k->leg_start[r], along = least(k->arc[r] - k->leg_start[r] + 0.5 * distance, length);
  D slant = bend_slope(k, k->point[r], along, length);
  return sqrt(1.0 + slant * slant);
}

static inline D on_chords(const K *k, I r, D distance) {
  return k->has_long_legs ? distance / find_stretch(k, r, distance) : distance;
}

/* A place on the lanes of a driver, which may be beyond the end of the first one. */
static V find_ahead(const K *k, I r, D s) {
  I lane = k->lane[r];
  for (I j = 1; j < NUM_LANES && s > k->length[lane] && LANE(r, j) >= 0; j++) s -= k->length[lane], lane = LANE(r, j);
  return find_place(k, lane, s);
}

/* New accelerations, with their lag but for egos. */
EXPORT void follow_wishes(K *k) {
  for (I i = 0; i < k->n; i++) {
    D *accel = &k->accel[k->rows[i]];
    *accel = k->is_ego[i] ? k->wanted[i] : *accel + k->response[i] * (k->wanted[i] - *accel);
  }
}

/* lane_change_motion.find_shifted */
static void find_shifted(K *k) {
  k->num_shifted = 0;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    int moves = k->lateral[r] != 0.0 || k->lateral_rate[r] != 0.0 || k->drift[r] != 0.0 || k->drift_rate[r] != 0.0;
    if (moves || k->lateral_left[r] > 0.0 || k->lateral_to[r] != 0.0) k->shifted[k->num_shifted++] = i;
  }
}

/* Distances until the next decision, and headings then. Returns how many are angles of north and east, for numpy. */
EXPORT I look_at_headings(K *k) {
  I num = 0;
  find_shifted(k);
  for (I j = 0; j < k->num_shifted; j++) k->shifting[j] = k->shifted[j];
  k->num_shifting = k->num_shifted;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    D speed = k->speed[r], accel = k->accel[r];
    D time = speed + accel * INTERVAL < 0.0 ? speed / most(-accel, CREEP) : INTERVAL;
    k->distance[i] = time * (speed + 0.5 * accel * time), k->heading[i] = k->straight_yaw[k->point[r]];
    D rear = k->arc[r] + on_chords(k, r, k->distance[i]), front = rear + k->wheelbase[i];
    if (k->distance[i] <= 0.0 || front <= k->straight_end[k->point[r]]) continue;
    V axles = minus(find_ahead(k, r, front), find_ahead(k, r, rear));
    k->east[num] = axles.x, k->north[num] = axles.y, k->at[num++] = i;
  }
  return num;
}

/* Takes the angles. Returns how many are at the end of the road, where the headings are those of the lanes: at. */
EXPORT I take_headings(K *k, I num) {
  I at_end = 0;
  for (I j = 0; j < num; j++) {
    I i = k->at[j];
    k->heading[i] = k->angle[j];
    if (hypot(k->east[j], k->north[j]) < 0.5 * k->wheelbase[i]) k->at[at_end++] = i;
  }
  return at_end;
}

/* LaneWander.aims */
static D find_aim(const K *k, I i, I j) {
  D waves[3];
  for (I w = 0; w < 3; w++) {
    I at = w * k->num_wandering + j;
    D turn = k->rates[at] * (D)k->frame[i] + k->phases[at];
    turn = turn - (floor(turn) + 0.5);
    waves[w] = turn * (0.5 - fabs(turn));
  }
  return k->width[j] * ((waves[0] + waves[1] + waves[2]) * WAVES);
}

/* LaneWander.plan, with sine and cosine of the headings. */
static void plan_wander(K *k) {
  for (I j = 0; j < k->num_wandering; j++) {
    I i = k->wandering[j], r = k->rows[i];
    D way = k->distance[i], room = most(k->room[k->lane[r]] - k->half_room[j], 0.0), ahead[3];
    D aim = least(most(find_aim(k, i, j), -room), room) + 0.0;
    wander_ahead(ahead, way, k->shift_of[i] ? 0.0 : aim, k->wander[r], k->wander_slope[r], INTERVAL);
    D east = -ahead[0] * k->sine[i], north = ahead[0] * k->cosine[i];
    if (way <= 0.0) east = k->wander_x[r], north = k->wander_y[r];
    k->wander_x_rate[r] = (east - k->wander_x[r]) / INTERVAL, k->wander_y_rate[r] = (north - k->wander_y[r]) / INTERVAL;
    k->wander[r] = ahead[0], k->wander_slope_rate[r] = ahead[1] / INTERVAL;
    k->heading[i] += ahead[2];
  }
}

/* lane_change_motion.plan_shifts for one driver, whose angle numpy will make of north and east. */
static void plan_shift(K *k, I j) {
  I i = k->shifting[j], r = k->rows[i];
  D left = k->lateral_left[r], distance = k->distance[i], place[2];
  k->north[j] = 0.0, k->east[j] = 1.0;
  if (left <= 0.0) {
    k->lateral[r] = k->lateral_from[r] = k->lateral_to[r];
    k->drift[r] = k->lateral_push[r] = k->lateral_bend[r] = k->lateral_rate[r] = k->lateral_left[r] = 0.0;
    return;
  }
  D across = fabs(k->lateral_to[r] - k->lateral_from[r]) + fabs(k->lateral_push[r]), half = 0.5 * k->body_length[i];
  int is_tight = k->lateral_bend[r] != 0.0;
  D way = is_tight ? tight_length(k->wheelbase[i], half, across) : shift_length(k->body_length[i], across);
  D time = shift_time(k->change_time[i], k->speed[r]);
  D part = least(least(INTERVAL / time, distance / most(way, 1.0)), left), p = 1.0 - (left - part);
  place_in_shift(place, k->lateral_from[r], k->lateral_to[r], k->lateral_push[r], k->lateral_bend[r], p);
  k->north[j] = place[1] * part, k->east[j] = most(distance, SHORTEST);
  k->lateral_rate[r] = (place[0] - k->lateral[r]) / INTERVAL, k->lateral_left[r] = left - part;
}

/* Motion beside the lines, with sine and cosine of the headings. Returns for how many numpy makes angles. */
EXPORT I plan_aside(K *k) {
  for (I j = 0; j < k->num_shifted; j++) k->shift_of[k->shifted[j]] = 1;
  plan_wander(k);
  for (I j = 0; j < k->num_shifted; j++) k->shift_of[k->shifted[j]] = 0;
  for (I j = 0; j < k->num_shifting; j++) plan_shift(k, j);
  return k->num_shifting;
}

/* LaneFollowers.plan_shifts, with the angles. */
static void drift_on(K *k) {
  for (I j = 0; j < k->num_shifting; j++) {
    I i = k->shifting[j], r = k->rows[i];
    k->drift_rate[r] = k->distance[i] > 0.0 ? (k->angle[j] - k->drift[r]) / INTERVAL : 0.0;
  }
  if (!k->num_shifted) return;
  for (I i = 0; i < k->n; i++) k->heading[i] += k->drift[k->rows[i]] + k->drift_rate[k->rows[i]] * INTERVAL;
  find_shifted(k);
}

/* The yaw rates. Returns how many have waited before a full street and choose again: at. */
EXPORT I steer(K *k) {
  I num = 0;
  drift_on(k);
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    D turn = k->distance[i] > 0.0 ? wrap(k->heading[i] - k->yaw[r]) : 0.0;
    k->yaw_rate[r] = turn / INTERVAL, k->lateral_accel[r] = k->yaw_rate[r] * k->speed[r];
    int waits = (k->is_shut_out[i] || k->is_blocked[i]) && k->speed[r] < CREEP;
    if (waits && (k->decision[i] + k->uid[i]) % MAX_WAIT_DECISIONS == 0) k->at[num++] = i;
  }
  return num;
}

static void set_leg(K *k, I r, I point) {
  const D *leg = k->legs + 8 * point;
  k->point[r] = point, k->leg_start[r] = leg[0], k->leg_end[r] = leg[1];
  k->leg_x[r] = leg[2], k->leg_y[r] = leg[3], k->leg_z[r] = leg[4];
  k->leg_dx[r] = leg[5], k->leg_dy[r] = leg[6], k->leg_dz[r] = leg[7];
}

/* _LaneFollowers._enter_next */
static void enter_next(K *k, I i, I r) {
  D length = k->length[k->lane[r]];
  if (LANE(r, 1) < 0) {
    k->arc[r] = nextafter(length, 0.0), k->speed[r] = k->accel[r] = 0.0;
    return;
  }
  k->arc[r] -= length;
  for (I j = -1; j < NUM_LANES - 1; j++) LANE(r, j) = LANE(r, j + 1);
  k->turns[r] += 1;
  LANE(r, NUM_LANES - 1) = choose(k, i, LANE(r, NUM_LANES - 2), k->turns[r] + NUM_LANES - 1);
  I lane = k->lane[r];
  if (k->wait_point[lane] != 0.0) return;
  if (!find_entered(k, i, r, k->held[r])) k->held[r] = lane; /* else the nose is on a later one */
  if (k->claim[r] == lane) k->claim[r] = -1;
}

/* _LaneFollowers._pass_ends */
static void pass_end(K *k, I i, I r) {
  D share, before = k->has_long_legs ? find_stretch(k, r, 0.0) : 0.0;
  if (!k->has_long_legs && k->arc[r] < k->legs[8 * (k->point[r] + 1) + 1]) {
    set_leg(k, r, k->point[r] + 1);
    return;
  }
  for (I j = 0; j < MAX_LANES_ENTERED && k->arc[r] >= k->length[k->lane[r]]; j++) enter_next(k, i, r);
  set_leg(k, r, locate(k, k->lane[r], k->arc[r], &share));
  if (k->has_long_legs) k->arc[r] += (k->arc[r] - k->leg_start[r]) * (before / find_stretch(k, r, 0.0) - 1.0);
}

/* The angles of those who move across, of which numpy makes cosines. */
EXPORT void find_slants(K *k, D dt) {
  for (I j = 0; j < k->num_shifted; j++) {
    I i = k->shifted[j], r = k->rows[i];
    k->angle[j] = k->drift[r] + k->drift_rate[r] * dt + k->wander_slope[r];
    k->shift_of[i] = j + 1;
  }
}

/* The way of one step along the lane: _LaneFollowers._way_beside and _along. */
static D find_way(K *k, I i, I r, D step, D dt) {
  D bend = k->yaw_rate[r] - k->drift_rate[r] - k->wander_slope_rate[r], limit = MAX_STRETCH * step;
  if (k->num_wandering) step += least(most(bend * (dt * k->wander[r]), -limit), limit);
  if (!k->shift_of[i]) return step;
  limit = MAX_STRETCH * step;
  step = step * k->cosine[k->shift_of[i] - 1] + least(most(bend * dt * k->lateral[r], -limit), limit);
  k->shift_of[i] = 0;
  return step;
}

static void move_row(K *k, I i, D dt) {
  I r = k->rows[i];
  D before = k->speed[r], after = before + k->accel[r] * dt;
  if (after < 0.0) after = 0.0, k->accel[r] = before / -dt;
  k->arc[r] += on_chords(k, r, find_way(k, i, r, (before + after) * (0.5 * dt), dt));
  k->speed[r] = after;
  if (k->arc[r] >= k->leg_end[r]) pass_end(k, i, r);
  D distance = k->arc[r] - k->leg_start[r], length = least(k->leg_end[r] - k->leg_start[r], LONGEST_LEG);
  D aside = bend_aside(k, k->point[r], distance, length);
  k->x[r] = distance * k->leg_dx[r] + k->leg_x[r] - aside * k->leg_dy[r];
  k->y[r] = distance * k->leg_dy[r] + k->leg_y[r] + aside * k->leg_dx[r];
  k->z[r] = distance * k->leg_dz[r] + k->leg_z[r];
  D yaw = k->yaw[r] + k->yaw_rate[r] * dt;
  k->yaw[r] = yaw > PI || yaw <= -PI ? wrap(yaw) : yaw;
}

/* One step, with the cosines of the slants. The angles of those who move across are for numpy, and then `nudge`. */
EXPORT void move(K *k, D dt) {
  for (I i = 0; i < k->n; i++) move_row(k, i, dt);
  for (I j = 0; j < k->num_wandering; j++) {
    I r = k->rows[k->wandering[j]];
    k->wander_slope[r] += k->wander_slope_rate[r] * dt;
    k->wander_x[r] += k->wander_x_rate[r] * dt, k->wander_y[r] += k->wander_y_rate[r] * dt;
    k->x[r] += k->wander_x[r], k->y[r] += k->wander_y[r];
  }
  for (I j = 0; j < k->num_shifted; j++) {
    I r = k->rows[k->shifted[j]];
    k->lateral[r] = k->lateral[r] + k->lateral_rate[r] * dt, k->drift[r] = k->drift[r] + k->drift_rate[r] * dt;
    k->angle[j] = k->yaw[r] - k->drift[r] - k->wander_slope[r];
  }
}

EXPORT void nudge(K *k) {
  for (I j = 0; j < k->num_shifted; j++) {
    I r = k->rows[k->shifted[j]];
    k->x[r] -= k->lateral[r] * k->sine[j], k->y[r] += k->lateral[r] * k->cosine[j];
  }
}
