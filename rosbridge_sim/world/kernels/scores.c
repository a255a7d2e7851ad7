/* Scores of egos: loops for scoring.py, segment_cells.py, ground.py and time_to_collision.py. */

typedef struct { I segment; D along, lateral, distance; } Foot;

/* LaneSegments.project */
static inline Foot project(const K *k, I segment, V place) {
  V seen = seen_from(k->segment_direction[segment], minus(place, k->segment_start[segment]));
  D along = least(most(seen.x, 0.0), k->segment_length[segment]);
  return (Foot){segment, along, seen.y, hypot(seen.x - along, seen.y)};
}

/* The place of the cell with a key: of the key, the first of its segments, and their number; all 0 for a new one. */
static I *find_cell(const K *k, I key) {
  I at = (I)(mix((uint64_t)key) % CELL_PLACES);
  while (k->cells[CELL_WORDS * at] && k->cells[CELL_WORDS * at] != key) at = (at + 1) % CELL_PLACES;
  return k->cells + CELL_WORDS * at;
}

/* Squared distance from a place to the box of a block of segments. */
static inline D from_block(const K *k, I block, V place) {
  V below = minus(k->block_low[block], place), above = minus(place, k->block_high[block]);
  D east = most(most(below.x, above.x), 0.0), north = most(most(below.y, above.y), 0.0);
  return east * east + north * north;
}

/* The middle of a cell and of its sector of headings. */
typedef struct { V place, heading; D z; } Middle;

/* Least and greatest score of a segment anywhere in a cell and its sector; see SegmentCells. Rounding is within MORE. */
static inline D find_costs(const K *k, const Middle *cell, I segment, D *most_cost) {
  const D reach = CORNER * MORE, cos_half = cos(PI / SECTORS * MORE), sin_half = sin(PI / SECTORS * MORE);
  V seen = seen_from(k->segment_direction[segment], minus(cell->place, k->segment_start[segment]));
  D on = least(most(seen.x, 0.0), k->segment_length[segment]), beyond = seen.x - on;
  D distance = sqrt(beyond * beyond + seen.y * seen.y); /* in less time than hypot: no bit counts here */
  V direction = seen_from(cell->heading, k->segment_direction[segment]);
  D along = direction.x, across = fabs(direction.y);
  D with = along > cos_half ? 1.0 : along * cos_half + across * sin_half;
  D against = along < -cos_half ? -1.0 : along * cos_half - across * sin_half;
  D least_cost = most(distance - reach, 0.0) + TURN_COST * (1.0 - with);
  *most_cost = distance + reach + TURN_COST * (1.0 - against);
  if (!k->is_flat) {
    D slope = k->segment_slope[segment], more = (0.5 * CELL_LEVEL + fabs(slope) * reach) * MORE;
    D rise = fabs(k->segment_height[segment] + on * slope - cell->z);
    least_cost += HEIGHT_COST * most(rise - more - SAME_HEIGHT, 0.0);
    *most_cost += HEIGHT_COST * most(rise + more - SAME_HEIGHT, 0.0);
  }
  return least_cost;
}

/* SegmentCells.look_at and look_around: keep the segments that count in a new cell. `sector` is -1 for the lanes around.
   A bound that is a little greater only keeps more. Returns whether there was room for them. */
static int fill_cell(K *k, I *filled, I east, I north, I level, I sector) {
  D angle = ((D)sector + 0.5) * (FULL_TURN / SECTORS) - PI, reach = CORNER * MORE, bound = INFINITY, most_cost;
  Middle cell = {.heading = {cos(angle), sin(angle)}, .z = CELL_LEVEL * ((D)(level - MAX_LEVEL) + 0.5)};
  cell.place = (V){CELL * ((D)(east - MAX_NUMBER) + 0.5), CELL * ((D)(north - MAX_NUMBER) + 0.5)};
  I first = k->used[1], num = 0, nearest = 0;
  for (I block = 0; block < k->num_blocks; block++) {
    k->block_away[block] = from_block(k, block, cell.place);
    if (k->block_away[block] < k->block_away[nearest]) nearest = block;
  }
  for (I j = 0; j < k->block_size[nearest]; j++) {
    find_costs(k, &cell, k->block_first[nearest] + j, &most_cost);
    bound = least(bound, most_cost);
  }
  for (I block = 0; block < k->num_blocks; block++) {
    D far = (sector < 0 ? NEAR_LANES + CORNER : bound + reach) * MORE;
    if (k->block_away[block] > far * far * MORE) continue;
    for (I j = 0; j < k->block_size[block]; j++) {
      I segment = k->block_first[block] + j;
      D least_cost = 0.0;
      if (sector < 0) {
        if (project(k, segment, cell.place).distance > far) continue;
      } else {
        least_cost = find_costs(k, &cell, segment, &most_cost);
        bound = least(bound, most_cost);
        if (least_cost > bound * MORE + 1e-9) continue;
      }
      if (first + num >= k->cell_room) return 0;
      k->kept_cost[num] = least_cost;
      k->cell_segment[first + num++] = segment;
    }
  }
  I left = 0;
  for (I j = 0; j < num; j++)
    if (!(k->kept_cost[j] > bound * MORE + 1e-9)) k->cell_segment[first + left++] = k->cell_segment[first + j];
  k->used[1] = first + left;
  k->used[0]++;
  filled[1] = first;
  filled[2] = left;
  return 1;
}

/* A cell, which is filled if it is new; none if there is no room left. */
static const I *look_up(K *k, V place, I level, I sector) {
  I east = (I)floor(place.x / CELL) + MAX_NUMBER, north = (I)floor(place.y / CELL) + MAX_NUMBER;
  I number = east * (2 * MAX_NUMBER) + north;
  I key = sector < 0 ? AROUND_KEY + number : (number * SECTORS + sector) * (2 * MAX_LEVEL) + level + 1;
  I *cell = find_cell(k, key);
  if (cell[0] == key) return cell;
  if (k->used[0] >= MAX_CELLS || !fill_cell(k, cell, east, north, level, sector)) return 0;
  cell[0] = key;
  return cell;
}

/* Roads._places: the place on its lane's line, which leaves its chord in bends; and how far beyond its ends it is. */
static D bend(const K *k, Foot *foot, D *slope) {
  I point = k->segment_point[foot->segment];
  D length = k->segment_length[foot->segment], beyond = foot->distance - fabs(foot->lateral);
  *slope = 0.0;
  if (is_straight(k, point)) return beyond;
  foot->lateral = foot->lateral - bend_aside(k, point, foot->along, length);
  foot->distance = fabs(foot->lateral) + beyond;
  *slope = bend_slope(k, point, foot->along, length);
  return foot->distance - fabs(foot->lateral);
}

/* Roads.beside; the height of the line there, too. */
static void find_edges(const K *k, const Foot *foot, D *to_left, D *to_right, D *height) {
  I lane = k->segment_lane[foot->segment];
  D share;
  I point = locate(k, lane, k->s[k->segment_point[foot->segment]] + foot->along, &share);
  const D *border = k->border + 2 * point, *place = k->points + 3 * point;
  *to_left = border[0] + share * (border[2] - border[0]) - foot->lateral;
  *to_right = border[1] + share * (border[3] - border[1]) + foot->lateral;
  *height = place[2] + share * (place[5] - place[2]);
}

static inline int is_within(const K *k, Foot foot, D z) {
  D left, right, height, slope;
  bend(k, &foot, &slope);
  find_edges(k, &foot, &left, &right, &height);
  return left >= 0.0 && right >= 0.0 && (k->is_flat || fabs(height - z) < LEVEL);
}

/* ground.are_on_road, for a place in a cell: the nearest segment of each lane counts. */
static int is_on_road(const K *k, const I *cell, V place, D z) {
  Foot best = {-1, 0.0, 0.0, 0.0};
  for (I j = 0; j < cell[2]; j++) {
    Foot foot = project(k, k->cell_segment[cell[1] + j], place);
    if (!(foot.distance <= *k->edge_reach && foot.distance - fabs(foot.lateral) < BESIDE_LANE)) continue;
    int is_next = best.segment >= 0 && k->segment_lane[best.segment] != k->segment_lane[foot.segment];
    if (is_next && is_within(k, best, z)) return 1;
    if (is_next || best.segment < 0 || foot.distance < best.distance) best = foot;
  }
  return best.segment >= 0 && is_within(k, best, z);
}

/* SegmentCells.place: the nearest segment of a cell for a place and a heading. */
static Foot find_nearest(const K *k, const I *cell, V place, D z, V heading) {
  Foot best = {-1, 0.0, 0.0, 0.0};
  D least_score = 0.0;
  for (I j = 0; j < cell[2]; j++) {
    I segment = k->cell_segment[cell[1] + j];
    Foot foot = project(k, segment, place);
    D score = foot.distance;
    if (!k->is_flat) {
      D amount = fabs(k->segment_height[segment] + foot.along * k->segment_slope[segment] - z);
      score = score + HEIGHT_COST * most(amount - SAME_HEIGHT, 0.0);
    }
    score = score + TURN_COST * (1.0 - seen_from(heading, k->segment_direction[segment]).x);
    if (best.segment < 0 || score < least_score) { best = foot; least_score = score; }
  }
  return best;
}

static inline int has_cell(const K *k, V place, D z) {
  return fabs(place.x) < FARTHEST && fabs(place.y) < FARTHEST && (k->is_flat || fabs(z) < HIGHEST);
}

/* Roads.nearest and Roads.beside: the place of entity i on its lane. Returns whether cells had room for it. */
static int place_on_lane(K *k, I i, V place, D z, V heading) {
  /* At an edge of sectors numpy may choose the other one; what is kept of a cell is right for both. */
  I sector = least_of((I)((atan2(heading.y, heading.x) + PI) * (SECTORS / FULL_TURN)), SECTORS - 1);
  I level = k->is_flat ? 0 : (I)floor(z / CELL_LEVEL) + MAX_LEVEL;
  const I *cell = look_up(k, place, level, sector);
  if (!cell) return 0;
  D height;
  Foot foot = find_nearest(k, cell, place, z, heading);
  k->beyond[i] = bend(k, &foot, &k->slope_below[i]);
  find_edges(k, &foot, &k->to_left[i], &k->to_right[i], &height);
  k->num_curved += k->slope_below[i] != 0.0;
  k->lane_below[i] = k->segment_lane[foot.segment];
  k->s_below[i] = k->s[k->segment_point[foot.segment]] + foot.along;
  k->lateral_below[i] = foot.lateral;
  k->yaw_below[i] = k->segment_angle[foot.segment];
  return 1;
}

static inline int is_between_edges(const K *k, I i, D most_beyond) {
  return k->to_left[i] >= 0.0 && k->to_right[i] >= 0.0 && k->beyond[i] < most_beyond;
}

/* The headings whose sines are wanted: as the step began and as it ended, and of the search for lanes. */
EXPORT void list_headings(K *k) {
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    k->angle[i] = POSE(0, YAW, r);
    k->angle[k->n + i] = POSE(1, YAW, r);
    k->angle[2 * k->n + i] = k->yaw[r];
  }
}

/* A place ahead of ego i as the step began or ended. */
static inline V place_at(const K *k, I t, I i, D ahead) {
  I r = k->rows[i], at = t * k->n + i;
  return (V){POSE(t, X, r) + ahead * k->cosine[at], POSE(t, Y, r) + ahead * k->sine[at]};
}

/* The lanes below the middles of the boxes. Returns 0, NO_ROOM or WITH_ARRAYS. */
static I find_lanes_below(K *k) {
  I num = k->n;
  k->num_curved = 0;
  for (I i = 0; i < num; i++) {
    I r = k->rows[i];
    V heading = {k->cosine[2 * num + i], k->sine[2 * num + i]}, place = place_at(k, 1, i, k->centre[r]);
    if (!has_cell(k, place, k->z[r])) return WITH_ARRAYS;
    if (!place_on_lane(k, i, place, k->z[r], heading)) return NO_ROOM;
    k->is_on[i] = (B)is_between_edges(k, i, BESIDE_END);
    if (k->is_on[i]) continue;
    const I *cell = look_up(k, place, 0, -1);
    if (!cell) return NO_ROOM;
    k->is_on[i] = (B)is_on_road(k, cell, place, k->z[r]);
  }
  return 0;
}

/* A place at an arc length from the start of a lane, beyond whose end the lanes straight on follow. */
static V find_point(const K *k, I lane, D s) {
  for (I j = 0; j < LANES_AHEAD && s > k->length[lane] && k->straight_on[lane] >= 0; j++) {
    s -= k->length[lane];
    lane = k->straight_on[lane];
  }
  return find_place(k, lane, s);
}

/* surroundings.find_lanes, of rows whose headings are in `cosine` and `sine`; returns what `find_lanes_below` does. */
EXPORT I look_at_lanes(K *k) {
  k->num_curved = 0;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    V place = {k->x[r], k->y[r]}, heading = {k->cosine[i], k->sine[i]};
    if (!has_cell(k, place, k->z[r])) return WITH_ARRAYS;
    if (!place_on_lane(k, i, place, k->z[r], heading)) return NO_ROOM;
    k->is_on[i] = (B)is_between_edges(k, i, 1.0);
    for (I j = 0; j < k->num_ahead; j++) {
      V point = find_point(k, k->lane_below[i], k->s_below[i] + k->ahead[j]);
      k->points_ahead[k->num_ahead * i + j] = seen_from(heading, minus(point, place));
    }
  }
  return 0;
}

/* The middle of the box of a row, seen from a place; headings of all rows are in `cosine` and `sine`. */
static inline V middle_from(const K *k, I r, D x, D y) {
  return (V){k->x[r] + k->centre[r] * k->cosine[r] - x, k->y[r] + k->centre[r] * k->sine[r] - y};
}

/* surroundings.find_others: the nearest entities of egos, the nearest first, -1 for none, and by what they are turned. Returns 0;
   WITH_ARRAYS for equal distances, whose order is that of numpy's partitions. */
EXPORT I find_others(K *k) {
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i], found = 0, *nearest = k->nearest_rows + k->num_seen * i;
    D *turn_by = k->turn_by + k->num_seen * i;
    for (I other = r % k->num_worlds; other < k->num_rows; other += k->num_worlds) {
      if (!k->alive[other] || other == r) continue;
      V place = middle_from(k, other, k->x[r], k->y[r]);
      D away = place.x * place.x + place.y * place.y;
      I at = found;
      while (at && away < k->away[at - 1]) at--;
      if (at && away == k->away[at - 1]) return WITH_ARRAYS;
      if (at == k->num_seen || !(away < INFINITY)) continue;
      if (found < k->num_seen) found++;
      for (I j = found - 1; j > at; j--) {
        k->away[j] = k->away[j - 1];
        nearest[j] = nearest[j - 1];
      }
      k->away[at] = away;
      nearest[at] = other;
    }
    for (I j = 0; j < k->num_seen; j++) {
      if (j >= found) nearest[j] = -1;
      turn_by[j] = j < found ? k->yaw[nearest[j]] - k->yaw[r] : 0.0;
    }
  }
  return 0;
}

/* The figures of these entities; the cosines and sines of their turns are known now. */
EXPORT void describe_others(K *k) {
  for (I at = 0; at < k->n * k->num_seen; at++) {
    I r = k->rows[at / k->num_seen], other = k->nearest_rows[at];
    D *seen = k->seen + NUM_FIGURES * at, cos_ = k->cosine[r], sin_ = k->sine[r];
    for (int j = 0; j < NUM_FIGURES; j++) seen[j] = 0.0;
    if (other < 0) continue;
    V place = middle_from(k, other, k->x[r], k->y[r]);
    seen[0] = 1.0;
    seen[1] = place.x * cos_ + place.y * sin_;
    seen[2] = place.y * cos_ - place.x * sin_;
    seen[5] = k->turn_cosine[at];
    seen[6] = k->turn_sine[at];
    seen[3] = k->speed[other] * seen[5] - k->lateral_speed[other] * seen[6] - k->speed[r];
    seen[4] = k->speed[other] * seen[6] + k->lateral_speed[other] * seen[5] - k->lateral_speed[r];
    seen[7] = 2.0 * k->half_length[other];
    seen[8] = 2.0 * k->half_width[other];
  }
}

/* A box that slides straight: its middle and its velocity, with sines of this library, for a rough answer. */
typedef struct { V heading, middle, velocity; } Sliding;

static Sliding slide(const K *k, I r) {
  V unit = {cos(k->yaw[r]), sin(k->yaw[r])};
  D ahead = k->speed[r], aside = k->lateral_speed[r];
  V middle = {k->x[r] + k->centre[r] * unit.x, k->y[r] + k->centre[r] * unit.y};
  return (Sliding){unit, middle, {ahead * unit.x - aside * unit.y, ahead * unit.y + aside * unit.x}};
}

/* How far from its place a box may be within a little more than the horizon. */
static inline D reach_of(const K *k, I r) {
  D fast = fabs(k->speed[r]) + fabs(k->lateral_speed[r]);
  return k->half_length[r] + k->half_width[r] + fabs(k->centre[r]) + (HORIZON + TOLERANCE) * fast;
}

/* Cut the time in which a place is within a strip out of a time; whether something is left. */
static inline int cut(D place, D speed, D strip, D *enters, D *leaves) {
  if (speed == 0.0) return fabs(place) <= strip;
  D one = (-strip - place) / speed, other = (strip - place) / speed;
  *enters = most(*enters, least(one, other));
  *leaves = least(*leaves, most(one, other));
  return *enters <= *leaves;
}

/* Whether boxes a little larger than those of two rows touch within a little more than the horizon. */
static int may_meet(const K *k, I one, I other, const Sliding *own) {
  D near = reach_of(k, one) + reach_of(k, other) + TOLERANCE, enters = 0.0, leaves = HORIZON + TOLERANCE, reach[4];
  if (fabs(k->x[other] - k->x[one]) > near || fabs(k->y[other] - k->y[one]) > near) return 0;
  Sliding box = slide(k, other);
  V apart = minus(box.middle, own->middle), nearer = minus(box.velocity, own->velocity);
  V heading[2] = {own->heading, box.heading};
  D half[4] = {k->half_length[one], k->half_width[one], k->half_length[other], k->half_width[other]};
  find_octagon(heading, half, reach);
  for (I i = 0; i < 2; i++) {
    V place = seen_from(heading[i], apart), speed = seen_from(heading[i], nearer);
    if (!cut(place.x, speed.x, reach[2 * i] + TOLERANCE, &enters, &leaves)) return 0;
    if (!cut(place.y, speed.y, reach[2 * i + 1] + TOLERANCE, &enters, &leaves)) return 0;
  }
  return 1;
}

/* Pairs of an ego and another entity of its world that may touch within the horizon; room + 1: more than there is room for. */
static I find_meetings(K *k) {
  I found = 0, room = 2 * k->n + MORE_PAIRS;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    Sliding own = slide(k, r);
    k->time_to_collision[r] = INFINITY;
    for (I other = r % k->num_worlds; other < k->num_rows; other += k->num_worlds) {
      if (!k->alive[other] || other == r || !may_meet(k, r, other, &own)) continue;
      if (found == room) return room + 1;
      k->pair_ego[found] = i;
      k->pair_row[found] = r;
      k->pair_row[room + found++] = other;
    }
  }
  return found;
}

/* scoring._judge_comfort, and the distance driven. */
static void judge_motion(K *k, I i) {
  I r = k->rows[i];
  k->score_frames[r] += 1;
  k->score_distance[r] += fabs(POSE(0, SPEED, r) + POSE(1, SPEED, r)) * (0.5 * DT);
  int is_known = r < k->num_before && k->before_uid[r] == k->uid[r];
  D jerk = is_known ? (k->accel[r] - k->before_accel[r]) / DT : 0.0, lateral = k->lateral_accel[r];
  k->jerk[r] = jerk;
  k->max_jerk[r] = fmax(k->max_jerk[r], fabs(jerk));
  k->jerk_square_sum[r] += jerk * jerk;
  k->max_lateral_accel[r] = fmax(k->max_lateral_accel[r], fabs(lateral));
  k->lateral_accel_square_sum[r] += lateral * lateral;
}

/* scoring._judge_lanes, of the lanes below. */
static void judge_lane(K *k, I i) {
  I r = k->rows[i], lane = k->lane_below[i], former = k->near_lane[r] - 1, is_on = k->is_on[i];
  D offset = k->lateral_below[i], over_left, over_right;
  k->is_off_road[r] = !is_on;
  k->off_road_frames[r] += !is_on;
  k->road_frames[r] += is_on;
  D across = k->across[i];
  int was_left = k->is_over_left[r], was_right = k->is_over_right[r];
  if (former != lane) {
    D moved = offset - k->lane_offset[r];
    int to_the_left = moved < -SIDEWAYS, to_the_right = moved > SIDEWAYS, left = was_left;
    was_left = (left && !to_the_left && !to_the_right) || (was_right && to_the_right);
    was_right = (was_right && !to_the_left && !to_the_right) || (left && to_the_left);
    k->near_lane[r] = lane + 1;
  }
  over_left = across - k->to_left[i];
  over_right = across - k->to_right[i];
  int is_left = over_left > 0.0 || (was_left && over_left > -BACK_INSIDE);
  int is_right = over_right > 0.0 || (was_right && over_right > -BACK_INSIDE);
  D s = k->s_below[i];
  if (former >= 0 && k->controller[lane] < 0 && s >= k->edges_from[lane] && s <= k->edges_to[lane]) {
    k->num_lane_invasions[r] += is_left && !was_left && k->left_lane[lane] < 0;
    k->num_lane_invasions[r] += is_right && !was_right && k->right_lane[lane] < 0;
  }
  k->is_over_left[r] = (B)is_left;
  k->is_over_right[r] = (B)is_right;
  if (!is_on) offset = 0.0;
  k->lane_offset[r] = offset;
  k->lane_offset_sum[r] += fabs(offset);
  k->max_lane_offset[r] = fmax(k->max_lane_offset[r], fabs(offset));
}

/* Whether a stop line may be passed in this step; a little more than StopLines.find_passed finds. */
static int may_pass(const K *k, I i) {
  I r = k->rows[i];
  D reach = k->half_length[r] + k->centre[r];
  V first = place_at(k, 0, i, reach), last = place_at(k, 1, i, reach), way = minus(last, first);
  for (I j = 0; j < k->num_lines; j++) {
    V end = k->lines[2 * j], ahead = k->lines[2 * j + 1], before = minus(first, end), after = minus(last, end);
    if (fabs(after.x) > LINE_REACH + fabs(way.x) || fabs(after.y) > LINE_REACH + fabs(way.y)) continue;
    if (seen_from(ahead, before).x <= TOLERANCE && seen_from(ahead, after).x >= -TOLERANCE) return 1;
  }
  return 0;
}

/* How far boxes reach across their lanes, with sines of this library: whether they decide what edges are crossed. */
static int is_across_known(K *k) {
  int is_known = 1;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    D turn = POSE(1, YAW, r) - k->yaw_below[i] - atan(k->slope_below[i]);
    k->across[i] = fabs(sin(turn)) * k->half_length[r] + fabs(cos(turn)) * k->half_width[r];
    D left = k->across[i] - k->to_left[i], right = k->across[i] - k->to_right[i];
    is_known &= fabs(left) > NEAR_EDGE && fabs(left + BACK_INSIDE) > NEAR_EDGE;
    is_known &= fabs(right) > NEAR_EDGE && fabs(right + BACK_INSIDE) > NEAR_EDGE;
  }
  return is_known;
}

/* Judge all; a negative answer has changed nothing. Returns twice the number of pairs that may meet, and 1 more if an ego must be
   looked at for stop lines. */
EXPORT I judge_egos(K *k) {
  if (!k->has_across) {
    I found = find_lanes_below(k);
    if (found) return found;
    if (!is_across_known(k)) return NEAR_EDGES;
  }
  k->has_across = 0;
  int passes = 0;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    judge_motion(k, i);
    judge_lane(k, i);
    k->has_passed_red[r] = 0;
    passes |= k->open_line[r] != 0 || may_pass(k, i);
  }
  return 2 * find_meetings(k) + passes;
}

/* Distances by `hypot` of this library, to compare with numpy's. */
EXPORT void measure(K *k) {
  for (I i = 0; i < k->n; i++) k->lateral_below[i] = hypot(k->to_left[i], k->to_right[i]);
}
