/* Looks at the lanes beside: loops for lane_change_decision.py and lane_changes.py. */

enum { LEFT, RIGHT, NUM_SIDES };
enum { NONE, FASTER, KEEP_RIGHT, ROUTE, LANE_END, AROUND };

/* LaneLook's options, and one driver's look. */
typedef struct {
  int is_there, is_safe;
  D run, gap, lead_speed, gap_behind, advantage;
  I follower;
} Option;

struct Look {
  Option options[NUM_SIDES];
  I lanes[NUM_LANES], reason, side;
  D arc, speed, run, to_entry, time;
  int must, is_slow, is_inside, is_tight, is_clear;
};

_Static_assert(sizeof(Look) <= 8 * LOOK_WORDS, "a look needs more room");

/* Has a driver brake at least as the mean driver would behind another one, but not harder than `hardest`. */
static void brake_behind(K *k, I i, D speed, D gap, D lead_speed, D hardest) {
  D brakes = mean_follow(speed, k->desired_now[i], gap, lead_speed);
  k->wanted[i] = least(k->wanted[i], most(brakes, -hardest));
}

/* LaneLook._find_run */
static D find_run(const K *k, const I *lanes, D s) {
  D run = -s;
  for (I j = 0; j < NUM_LANES; j++) run = run + (lanes[j] >= 0 ? k->length[lanes[j]] : 0.0);
  return lanes[NUM_LANES - 1] >= 0 ? INFINITY : run;
}

static inline D find_begin(const K *k, I lane, int minds_joins) {
  return minds_joins ? least(k->wait_point[lane], k->narrow_from[lane]) : k->wait_point[lane];
}

/* LaneLook._find_entry */
static D find_entry(const K *k, I i, const Look *look, int minds_joins) {
  I lane = look->lanes[0];
  D bumper = look->arc + k->nose[i], distance = k->length[lane] - bumper;
  D to_entry = look->arc - k->rear[i] < k->shared[lane] ? 0.0 : find_begin(k, lane, minds_joins) - bumper;
  for (I j = 1; j < NUM_LANES && (lane = look->lanes[j]) >= 0; j++) {
    D begin = k->light[lane] >= 0 ? 0.0 : find_begin(k, lane, minds_joins);
    to_entry = least(to_entry, distance + begin);
    distance = distance + k->length[lane];
  }
  return to_entry;
}

/* LaneLook._cost */
static D cost(const K *k, I i, I follower, D speed, D gap, D own_speed, D beyond, D lead_speed) {
  D desired = follower >= 0 ? k->desired_now[follower] : most(speed, 1.0);
  D without = mean_follow(speed, desired, gap + k->body_length[i] + beyond, lead_speed);
  return most(mean_follow(speed, desired, gap, own_speed), -HARDEST) - most(without, -HARDEST);
}

/* The last entry on lanes that lead here, so many lanes behind. */
static void find_behind(const K *k, I lane, D s, I behind, I *entry, D *distance) {
  for (I j = k->before_first[lane]; j < k->before_first[lane + 1]; j++) {
    I other = k->before_other[j], last = find_in_queue(k, other, k->length[other]) - 1;
    D way = s + k->length[other];
    int is_found = last >= 0 && k->q_lane[last] == other;
    if (is_found && way - k->q_s[last] < *distance) *entry = last, *distance = way - k->q_s[last];
    if (!is_found && behind > 1) find_behind(k, other, way, behind - 1, entry, distance);
  }
}

/* LaneLook._find_follower: the nearest on the lanes one behind, else two, else three. */
static I find_follower(const K *k, I lane, D s, I position, D *distance) {
  I entry = most_of(position - 1, 0);
  *distance = INFINITY;
  if (position > 0 && k->q_lane[entry] == lane) *distance = s - k->q_s[entry];
  for (I behind = 1; behind <= LOOK_BACK && isinf(*distance); behind++)
    find_behind(k, lane, s, behind, &entry, distance);
  return entry;
}

/* LaneLook._find_lead */
static void find_lead(const K *k, const I *lanes, D s, I position, D *gap, D *speed) {
  D distance = k->length[lanes[0]] - s;
  int is_on = k->q_lane[position] == lanes[0];
  *gap = is_on ? k->q_tail[position] - s : INFINITY, *speed = is_on ? k->q_speed[position] : 0.0;
  for (I j = 1; j < NUM_LANES && isinf(*gap) && lanes[j] >= 0; j++) {
    I first = k->q_first[lanes[j]];
    *gap = distance + k->q_tail[first], *speed = k->q_speed[first];
    distance += k->length[lanes[j]];
  }
}

/* lane_change_model.find_safe */
static int is_safe(D speed, D gap, D lead_speed, D gap_behind, D speed_behind) {
  return gap > MIN_GAP + MIN_HEADWAY * speed && gap_behind > MIN_GAP + MIN_HEADWAY * speed_behind &&
         mean_follow(speed, most(speed, 1.0), gap, lead_speed) > -SAFE_BRAKING &&
         mean_follow(speed_behind, most(speed_behind, 1.0), gap_behind, speed) > -SAFE_BRAKING;
}

/* What a change is worth: the model MOBIL. */
static D find_worth(const K *k, I i, const Look *look, I side, I lane, const Option *option, D speed_behind) {
  D speed = look->speed, desired = k->desired_now[i], others = 0.0, gain = 0.0;
  D worth = mean_follow(speed, desired, option->gap, option->lead_speed) -
            mean_follow(speed, desired, k->gap[i], k->lead_speed[i]);
  if (isfinite(option->gap_behind))
    others = cost(k, i, option->follower, speed_behind, option->gap_behind, speed, option->gap, option->lead_speed);
  I own = look->lanes[0], position = k->q_position[i], before = most_of(position - 1, 0), old = k->q_source[before];
  if (side == RIGHT && position > 0 && k->q_lane[before] == own && old >= 0) {
    D gap = look->arc - k->rear[i] - k->q_s[before] - k->nose[old];
    gain = -cost(k, i, old, k->q_speed[before], gap, speed, k->gap[i], k->lead_speed[i]);
  }
  worth = worth + k->politeness[i] * (others + gain);
  int enters_join = k->join[lane] >= 0 && (k->join[own] < 0 || side == RIGHT);
  return worth - (enters_join ? BEFORE_JOIN : 0.0);
}

/* LaneLook._look_aside, for one side. */
static Option look_aside(const K *k, I i, const Look *look, I side) {
  Option option = {0, 0, 0.0, INFINITY, 0.0, INFINITY, -INFINITY, -1};
  I own = look->lanes[0], lanes[NUM_LANES];
  D s, speed_behind = 0.0, distance;
  I lane = cross(k, side, own, look->arc, &s);
  if (lane < 0 || !k->may[side * k->num_lanes + own]) return option;
  if (!(s + (k->nose[i] + look->time * look->speed) < k->narrow_from[lane])) return option;
  option.is_there = 1;
  preview(k, i, lane, lanes);
  option.run = find_run(k, lanes, s);
  I position = find_in_queue(k, lane, s);
  find_lead(k, lanes, s, position, &option.gap, &option.lead_speed);
  option.gap -= k->nose[i];
  I entry = find_follower(k, lane, s, position, &distance), follower = k->q_source[entry];
  if (isfinite(distance)) {
    D nose = follower >= 0 ? k->nose[follower] : k->q_s[entry] - k->q_tail[entry];
    option.follower = follower, option.gap_behind = distance - k->rear[i] - nose;
    speed_behind = k->q_speed[entry];
  }
  option.is_safe = is_safe(look->speed, option.gap, option.lead_speed, option.gap_behind, speed_behind);
  option.advantage = find_worth(k, i, look, side, lane, &option, speed_behind);
  return option;
}

/* LaneLook._is_blocked */
static int is_blocked(const K *k, I i, const Look *look) {
  D reach = most(BLOCKED_WAY, BLOCKED_TIME * look->speed);
  int is_near = k->gap[i] < reach && k->lead_speed[i] < STANDS && look->to_entry > k->gap[i] + LIGHT_QUEUE;
  if (!is_near) return 0;
  I lead = k->lead[i], at = least_of(k->q_position[i] + 1, k->num_entries), next = least_of(at + 1, k->num_entries);
  int is_parked = lead < 0;
  if (lead >= 0) {
    I r = k->rows[lead];
    int is_stuck = (k->change[r] == AROUND || k->leaving[r] > 0) && k->frame[lead] - k->change_since[r] > STUCK;
    is_parked = k->desired_speed[r] < STANDS || is_stuck;
  }
  int is_queue = k->q_lane[next] == k->q_lane[at] && k->q_speed[next] < STANDS && k->q_source[next] >= 0 &&
                 k->q_tail[next] < k->q_s[at] + QUEUE_GAP + k->nose[i] && k->q_lane[at] == look->lanes[0];
  return is_parked && !is_queue;
}

/* LaneLook._find_must */
static void find_must(const K *k, I i, Look *look) {
  I r = k->rows[i], count = 0, index;
  look->reason = NONE, look->side = LEFT;
  if (isfinite(look->run)) {
    while (count + 1 < NUM_LANES && look->lanes[count + 1] >= 0) count++;
    I last = look->lanes[count], wanted = find_on_route(k, i, k->turns[r] + count, &index);
    int is_route = wanted >= 0 && wanted != last;
    I steps = is_route ? k->place[wanted] - k->place[last] : 1;
    I to_side = is_route ? (steps > 0 ? 1 : 2) : k->merge_side[last];
    D begins_at = fabs((D)steps) * most(MUST_WAY, MUST_TIME * look->speed);
    if (to_side > 0 && look->run < begins_at) look->reason = is_route ? ROUTE : LANE_END, look->side = to_side - 1;
  }
  if (look->reason || !is_blocked(k, i, look)) return;
  D values[NUM_SIDES];
  for (I side = 0; side < NUM_SIDES; side++) {
    const Option *option = &look->options[side];
    int goes_on = option->run > k->gap[i] + WAY_ON || option->run >= look->run;
    int is_good = option->is_there && goes_on && option->gap > k->gap[i] + k->body_length[i];
    values[side] = is_good ? option->advantage + (D)option->is_safe : -INFINITY;
    if (k->signal[r] == side + 1 && values[side] > -INFINITY) values[side] = INFINITY;
  }
  if (most(values[LEFT], values[RIGHT]) > -INFINITY) look->reason = AROUND;
  look->side = values[RIGHT] > values[LEFT] ? RIGHT : LEFT;
}

/* LaneLook._excess */
static D find_excess(const K *k, I i, const Look *look) {
  D s, share, speed = look->speed;
  I lane = cross(k, look->side, look->lanes[0], look->arc, &s), lanes[NUM_LANES];
  if (lane < 0) return 0.0;
  preview(k, i, lane, lanes);
  D factor = lateral_left(k->most_lateral[i], k->own_lateral[i], look->time, LANE_WIDTH) / MAX_LATERAL;
  const D *at = k->speeds_ahead + 7 * locate(k, lane, s, &share);
  D reach = speed * (FORESIGHT + k->reaction[i]) + TURNS_AHEAD, distance = k->length[lane] - s;
  D square = factor * (at[5] + at[6] * (s - at[0]));
  for (I j = 1; j < NUM_LANES && lanes[j] >= 0; j++) {
    at = k->speeds_ahead + 7 * k->first[lanes[j]];
    D enter = at[4] + most(1.0 - distance / reach, 0.0) * (at[5] - at[4]);
    square = least(square, factor * enter + 2.0 * k->comfort[i] * most(distance - reach, 0.0));
    distance += k->length[lanes[j]];
  }
  return speed - SPEED_TOLERANCE * sqrt(square);
}

/* Wishes for changes of choice. */
static void find_wish(const K *k, I i, Look *look) {
  I r = k->rows[i], now = k->change[r], since = k->change_since[r], signalled = most_of(k->signal[r] - 1, 0);
  D bias = KEEP_RIGHT_BIAS * (D)k->keeps_right[look->lanes[0]], advantages[NUM_SIDES];
  int is_far = look->to_entry > ENTRY_WAY + (SIGNAL_TIME + look->time) * look->speed;
  for (I side = 0; side < NUM_SIDES; side++) {
    const Option *option = &look->options[side];
    int goes_on = option->run > WAY_ON + MUST_TIME * look->speed || option->run >= look->run;
    int is_open = option->is_there && goes_on && is_far && !look->is_inside;
    advantages[side] = is_open ? option->advantage + (side == RIGHT ? bias : -bias) : -INFINITY;
  }
  I best = advantages[RIGHT] > advantages[LEFT] ? RIGHT : LEFT;
  D greatest = most(advantages[LEFT], advantages[RIGHT]);
  int is_right = best == RIGHT && look->options[RIGHT].advantage < THRESHOLD;
  int is_back = k->came_from[r] == best + 1 && greatest < GOOD_REASON;
  int has_rested = since == 0 || k->frame[i] - since >= (is_right || is_back ? RETURN : REST);
  if (now == NONE && greatest > THRESHOLD && look->options[best].is_safe && has_rested)
    look->side = best, look->reason = is_right ? KEEP_RIGHT : FASTER;
  if ((now == FASTER || now == KEEP_RIGHT) && advantages[signalled] > 0.0 && k->frame[i] - since < PATIENCE)
    look->side = signalled, look->reason = now;
}

/* LaneLook._mind_bends */
static void mind_bends(K *k, I i, Look *look) {
  look->is_slow = 1;
  if (look->reason == NONE) return;
  D excess = find_excess(k, i, look);
  if (excess <= 0.0) return;
  look->is_slow = 0;
  if (look->must) k->wanted[i] = least(k->wanted[i], -least(excess / SETTLING_TIME, k->comfort[i]));
  else if (k->change[k->rows[i]] == NONE) look->reason = NONE;
}

static void look_beside(K *k, I i, Look *look) {
  I r = k->rows[i];
  for (I j = 0; j < NUM_LANES; j++) look->lanes[j] = LANE(r, j);
  look->arc = k->arc[r], look->speed = k->speed[r], look->is_clear = 0;
  look->time = shift_time(k->change_time[i], look->speed);
  look->run = find_run(k, look->lanes, look->arc);
  D reach = most(BLOCKED_WAY, BLOCKED_TIME * look->speed);
  int leaves_join = k->gap[i] < reach && k->lead_speed[i] < STANDS && k->join[look->lanes[0]] >= 0;
  look->to_entry = find_entry(k, i, look, !leaves_join);
  for (I side = 0; side < NUM_SIDES; side++) look->options[side] = look_aside(k, i, look, side);
  find_must(k, i, look);
  look->must = look->reason != NONE;
  look->is_inside = look->to_entry <= 0.0 || k->held[r] >= 0;
  look->is_inside |= k->claim[r] >= 0 && look->speed * look->speed > 2.0 * FIRM * most(look->to_entry - STOP_GAP, 0.0);
  if (!look->must) find_wish(k, i, look);
  mind_bends(k, i, look);
  look->is_tight = look->reason == AROUND && look->speed < STANDS;
}

/* LaneChanges._leave_room */
static void leave_room(K *k, I i) {
  D speed = k->speed[k->rows[i]];
  if (k->lead[i] >= 0 || !(k->gap[i] < BLOCKED_WAY && k->lead_speed[i] < SLOW && speed < SLOW)) return;
  brake_behind(k, i, speed, k->gap[i] - SPARE_ROOM, k->lead_speed[i], FIRM);
}

/* LaneChanges.find_lateral, and find_leaving for one driver. */
static void change_lane(K *k, I i, I r) {
  int leaves = k->leaving[r] > 0;
  if (!leaves && k->change[r] < ROUTE) return;
  D s, across = leaves ? fabs(k->lateral_to[r] - k->lateral_from[r]) : LANE_WIDTH;
  D time = shift_time(k->change_time[i], k->speed[r]);
  k->lateral_now[i] = lateral_left(k->most_lateral[i], k->own_lateral[i], time, across);
  D off = k->body_length[i] > HEAVY_LENGTH ? OFF_OLD_LANE_LONG : OFF_OLD_LANE;
  if (!leaves || !(fabs(k->lateral[r] - k->lateral_to[r]) > off)) return;
  I lane = cross(k, k->leaving[r] - 1, k->lane[r], k->arc[r], &s), j = k->num_leaving;
  if (lane < 0) return;
  k->left_lane[j] = lane, k->left_source[j] = i, k->left_s[j] = s, k->left_tail[j] = s - k->rear[i];
  k->left_speed[j] = k->speed[r], k->left_accel[j] = k->accel[r];
  k->num_leaving++;
}

EXPORT void begin_decision(K *k) {
  k->num_leaving = 0;
  for (I i = 0; i < k->n; i++) {
    k->lateral_now[i] = k->own_lateral[i];
    if (k->is_possible) change_lane(k, i, k->rows[i]);
  }
  update_holds(k);
  enter_all(k);
}

/* LaneChanges.end_changes */
static void end_changes(K *k) {
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    if (k->leaving[r] > 0 && k->lateral_left[r] == 0.0)
      k->leaving[r] = k->signal[r] = k->change[r] = 0, k->change_since[r] = k->frame[i];
  }
}

/* Whether a driver looks closely at what is ahead, which is for numpy: its vehicle pulls out, or that stands. */
static int looks_closely(D gap, D lead_speed, int is_tight) { return is_tight || (gap < SEEN && lead_speed < STANDS); }

/* lane_change_passing.find_blocked, for one that does not look closely: whether it is. */
static int is_in_the_way(const K *k, I i, D across, D done, D gap, D lead_speed, D speed) {
  speed = most(speed, CREEP);
  D closing = speed - lead_speed, driven = closing > 0.0 ? most(gap, 0.0) * speed / closing : INFINITY;
  D way = most(shift_length(k->body_length[i], across), shift_time(k->change_time[i], speed) * speed);
  D part = least(done + driven / way, 1.0);
  D side = side_in_shift(across, 0.0, way, part, k->nose[i], k->half_width[k->rows[i]]);
  return !(side > CORRIDOR) && !isinf(gap);
}

/* LaneChanges.mind_old_lane. Returns how many look closely at what is ahead, and are for numpy: looking. */
static I mind_old_lanes(K *k) {
  I num = 0;
  for (I j = 0; j < k->num_leaving; j++) {
    I i = k->left_source[j], r = k->rows[i], lane = k->left_lane[j], after = k->q_position[k->n + j] + 1;
    I next = LANE(r, 1), beyond = next >= 0 ? k->beside[(k->leaving[r] - 1) * k->num_lanes + next] : -1;
    D way = -k->left_s[j];
    if (k->q_lane[after] != lane) {
      after = beyond >= 0 ? k->q_first[beyond] : k->num_entries;
      way = k->length[lane] - k->left_s[j];
    }
    D gap = way + k->q_tail[after] - k->nose[i], lead_speed = k->q_speed[after], speed = k->speed[r];
    if (looks_closely(gap, lead_speed, k->lateral_bend[r] != 0.0)) {
      k->looking[num++] = j;
      continue;
    }
    D across = fabs(k->lateral_from[r] - k->lateral_to[r]), done = 1.0 - k->lateral_left[r];
    if (is_in_the_way(k, i, across, done, gap, lead_speed, speed + FASTER_SOON * most(k->left_accel[j], 0.0)))
      k->wanted[i] = least(k->wanted[i], 0.0);
    if (!is_in_the_way(k, i, across, done, gap, lead_speed, speed)) continue;
    D needed = most(speed * speed - lead_speed * lead_speed, 0.0) / (2.0 * most(gap, CREEP));
    brake_behind(k, i, speed, gap, lead_speed, least(most(needed, FIRM), HARDEST));
  }
  return num;
}

/* What drivers choose. Returns how many entries of those that leave lanes are for numpy: looking. */
EXPORT I accelerate(K *k) {
  for (I j = 0; j < k->num_leaving; j++) k->is_leaving[k->left_source[j]] = 1;
  for (I i = 0; i < k->n; i++) {
    k->wanted[i] = choose_accel(k, i);
    k->desired_now[i] = least(k->desired[i], k->safe_speed[i]);
  }
  for (I j = 0; j < k->num_leaving; j++) k->is_leaving[k->left_source[j]] = 0;
  return mind_old_lanes(k);
}

/* Whether a driver begins its change, if it is clear of what is ahead. */
static int may_begin(const K *k, I i, const Look *look) {
  I r = k->rows[i];
  const Option *option = &look->options[look->side];
  int has_signalled = k->signal[r] == look->side + 1 && k->frame[i] - k->change_since[r] >= SIGNAL_FRAMES;
  int may = option->is_there && option->is_safe && look->is_slow && look->side == k->decision[i] % NUM_SIDES;
  return look->reason != NONE && has_signalled && may;
}

/* What drivers want. Returns how many looks need numpy's answer whether they are clear: at, side, is_tight. */
EXPORT I look_at_lanes_beside(K *k) {
  I num = 0;
  k->num_looks = 0;
  end_changes(k);
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i], part = k->decision[i] / LOOK_EVERY % LOOK_PARTS, has_side = k->has_side[k->lane[r]];
    if (!k->may_change[i]) continue;
    if (has_side) leave_room(k, i);
    int is_part = k->decision[i] % LOOK_EVERY == 0;
    int looks = k->change[r] >= (is_part ? FASTER : ROUTE);
    looks |= is_part && k->uid[i] % LOOK_PARTS == part && has_side;
    if (looks && k->leaving[r] == 0) k->looking[k->num_looks++] = i;
  }
  Look *looks = k->looks;
  for (I j = 0; j < k->num_looks; j++) {
    I i = k->looking[j];
    Look *look = &looks[j];
    look_beside(k, i, look);
    int opens_gap = look->reason >= ROUTE && look->options[look->side].follower >= 0;
    if (look->reason == NONE || look->is_inside || !(opens_gap || may_begin(k, i, look))) continue;
    if (looks_closely(k->gap[i], k->lead_speed[i], look->is_tight))
      k->at[num] = j, k->side[num] = look->side, k->is_tight[num++] = look->is_tight;
    else look->is_clear = !is_in_the_way(k, i, LANE_WIDTH, 0.0, k->gap[i], k->lead_speed[i], look->speed);
  }
  return num;
}

/* LaneLook._open_gaps */
static void open_gaps(K *k, I i, const Look *look, I waited) {
  const Option *option = &look->options[look->side];
  I follower = option->follower;
  if (waited % (2 * COURTESY) < COURTESY && look->is_clear && follower >= 0)
    brake_behind(k, follower, k->speed[k->rows[follower]], option->gap_behind, look->speed, KIND_BRAKING);
  brake_behind(k, i, look->speed, option->gap, option->lead_speed, KIND_BRAKING);
}

/* LaneLook._keep_room */
static void keep_room(K *k, I i, const Look *look) {
  D room = PULL_OUT + PULL_OUT_PER_LENGTH * most(k->body_length[i] - CAR_LENGTH, 0.0);
  brake_behind(k, i, look->speed, k->gap[i] - room, k->lead_speed[i], HARDEST);
}

/* The signals, and who begins, with is_clear of the looks `at`. Returns how many begin: at, side, is_tight. */
EXPORT I signal_changes(K *k, I num) {
  Look *looks = k->looks;
  I begun = 0;
  for (I j = 0; j < num; j++) looks[k->at[j]].is_clear = k->is_clear[j];
  for (I j = 0; j < k->num_looks; j++) {
    I i = k->looking[j], r = k->rows[i];
    Look *look = &looks[j];
    Option *option = &look->options[look->side];
    I shows = look->reason != NONE ? look->side + 1 : 0;
    int begins = may_begin(k, i, look) && look->is_clear;
    I since = shows != k->signal[r] ? k->frame[i] : k->change_since[r], waited = k->frame[i] - since;
    k->change[r] = look->reason, k->signal[r] = shows, k->change_since[r] = since;
    if (look->reason >= ROUTE && !begins && option->is_there && !look->is_inside) open_gaps(k, i, look, waited);
    if (look->reason == AROUND && !begins) keep_room(k, i, look);
    if (begins) k->at[begun] = i, k->side[begun] = look->side, k->is_tight[begun++] = look->is_tight;
  }
  return begun;
}
