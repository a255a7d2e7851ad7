/* Scores of egos: loops for scoring.py, segment_cells.py, ground.py and time_to_collision.py. */

#define POSE_OF(when, line) (k->poses[(5 * (when) + (line)) * k->num_rows + r])

typedef struct { I segment; D along, lateral, distance; } Foot;

static inline Foot foot_on(const K *k, I segment, D x, D y, D *beyond) {
  D east = x - k->segment_start[2 * segment], north = y - k->segment_start[2 * segment + 1];
  D along_x = k->segment_direction[2 * segment], along_y = k->segment_direction[2 * segment + 1];
  D full = east * along_x + north * along_y;
  Foot foot = {segment, least(most(full, 0.0), k->segment_length[segment]), north * along_x - east * along_y, 0.0};
  *beyond = full - foot.along;
  return foot;
}

/* LaneSegments.project */
static inline Foot project(const K *k, I segment, D x, D y) {
  D beyond;
  Foot foot = foot_on(k, segment, x, y, &beyond);
  foot.distance = hypot(beyond, foot.lateral);
  return foot;
}

/* The cell with a key, of the key, the first of its segments, and their number; none if it is not known. */
static const I *find_cell(const K *k, I key) {
  for (I at = (I)(mix((uint64_t)key) % CELL_PLACES);; at = (at + 1) % CELL_PLACES) {
    const I *cell = k->cells + CELL_WORDS * at;
    if (cell[0] == key) return cell;
    if (!cell[0]) return 0;
  }
}

/* Squared distance from a place to the box of a block of segments. */
static inline D from_block(const K *k, I block, D x, D y) {
  const D *low = k->block_low + 2 * block, *high = k->block_high + 2 * block;
  D east = most(most(low[0] - x, x - high[0]), 0.0), north = most(most(low[1] - y, y - high[1]), 0.0);
  return east * east + north * north;
}

/* The middle of a cell and of its sector of headings. */
typedef struct { D x, y, z, cos_, sin_; } Middle;

/* Least and greatest score of a segment anywhere in a cell and its sector; see SegmentCells. Rounding is within MORE. */
static inline D find_costs(const K *k, const Middle *cell, I segment, D *most_cost) {
  const D reach = CORNER * MORE, cos_half = cos(PI / SECTORS * MORE), sin_half = sin(PI / SECTORS * MORE);
  D beyond;
  Foot foot = foot_on(k, segment, cell->x, cell->y, &beyond);
  D distance = sqrt(beyond * beyond + foot.lateral * foot.lateral);
  const D *direction = k->segment_direction + 2 * segment;
  D along = cell->cos_ * direction[0] + cell->sin_ * direction[1];
  D across = fabs(cell->cos_ * direction[1] - cell->sin_ * direction[0]);
  D with = along > cos_half ? 1.0 : along * cos_half + across * sin_half;
  D against = along < -cos_half ? -1.0 : along * cos_half - across * sin_half;
  D least_cost = most(distance - reach, 0.0) + TURN_COST * (1.0 - with);
  *most_cost = distance + reach + TURN_COST * (1.0 - against);
  if (!k->is_flat) {
    D slope = k->segment_slope[segment], more = (0.5 * CELL_LEVEL + fabs(slope) * reach) * MORE;
    D rise = fabs(k->segment_height[segment] + foot.along * slope - cell->z);
    least_cost += HEIGHT_COST * most(rise - more - SAME_HEIGHT, 0.0);
    *most_cost += HEIGHT_COST * most(rise + more - SAME_HEIGHT, 0.0);
  }
  return least_cost;
}

/* SegmentCells.look_at and look_around: keep the segments that count in a cell of this key. `sector` is -1 for the lanes around.
   A bound that is a little greater only keeps more. Returns the cell; none if there is no room left. */
static const I *fill_cell(K *k, I key, I east, I north, I level, I sector) {
  Middle cell = {CELL * ((D)(east - MAX_NUMBER) + 0.5), CELL * ((D)(north - MAX_NUMBER) + 0.5), 0.0, 0.0, 0.0};
  D angle = ((D)sector + 0.5) * (FULL_TURN / SECTORS) - PI, reach = CORNER * MORE, bound = INFINITY, most_cost;
  cell.z = CELL_LEVEL * ((D)(level - MAX_LEVEL) + 0.5);
  cell.cos_ = cos(angle);
  cell.sin_ = sin(angle);
  I first = k->used[1], num = 0, nearest = 0;
  for (I block = 0; block < k->num_blocks; block++) {
    k->block_away[block] = from_block(k, block, cell.x, cell.y);
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
        if (project(k, segment, cell.x, cell.y).distance > far) continue;
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
  I at = (I)(mix((uint64_t)key) % CELL_PLACES);
  while (k->cells[CELL_WORDS * at]) at = (at + 1) % CELL_PLACES;
  I *place = k->cells + CELL_WORDS * at;
  place[0] = key;
  place[1] = first;
  place[2] = left;
  return place;
}

/* A cell, which is filled if it is new; none if there is no room left. */
static const I *look_up(K *k, I east, I north, I level, I sector) {
  I place = east * (2 * MAX_NUMBER) + north;
  I key = sector < 0 ? AROUND_KEY + place : (place * SECTORS + sector) * (2 * MAX_LEVEL) + level + 1;
  const I *cell = find_cell(k, key);
  if (cell || k->used[0] >= MAX_CELLS) return cell;
  return fill_cell(k, key, east, north, level, sector);
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
static int is_on_road(const K *k, const I *cell, D x, D y, D z) {
  Foot best = {-1, 0.0, 0.0, 0.0};
  for (I j = 0; j < cell[2]; j++) {
    Foot foot = project(k, k->cell_segment[cell[1] + j], x, y);
    if (!(foot.distance <= *k->edge_reach && foot.distance - fabs(foot.lateral) < BESIDE_LANE)) continue;
    int is_next = best.segment >= 0 && k->segment_lane[best.segment] != k->segment_lane[foot.segment];
    if (is_next && is_within(k, best, z)) return 1;
    if (is_next || best.segment < 0 || foot.distance < best.distance) best = foot;
  }
  return best.segment >= 0 && is_within(k, best, z);
}

/* SegmentCells.place: the nearest segment of a cell for a place and a heading. */
static Foot find_nearest(const K *k, const I *cell, D x, D y, D z, D cos_, D sin_) {
  Foot best = {-1, 0.0, 0.0, 0.0};
  D least_score = 0.0;
  for (I j = 0; j < cell[2]; j++) {
    I segment = k->cell_segment[cell[1] + j];
    Foot foot = project(k, segment, x, y);
    D score = foot.distance;
    if (!k->is_flat) {
      D amount = fabs(k->segment_height[segment] + foot.along * k->segment_slope[segment] - z);
      score = score + HEIGHT_COST * most(amount - SAME_HEIGHT, 0.0);
    }
    const D *direction = k->segment_direction + 2 * segment;
    score = score + TURN_COST * (1.0 - (cos_ * direction[0] + sin_ * direction[1]));
    if (best.segment < 0 || score < least_score) { best = foot; least_score = score; }
  }
  return best;
}

static inline int has_cell(const K *k, D x, D y, D z) {
  return fabs(x) < FARTHEST && fabs(y) < FARTHEST && (k->is_flat || fabs(z) < HIGHEST);
}

static inline I cell_of(D place) { return (I)floor(place / CELL) + MAX_NUMBER; }

/* Roads.nearest and Roads.beside: the place of entity i on its lane. Returns whether cells had room for it. */
static int place_on_lane(K *k, I i, D x, D y, D z, D cos_, D sin_) {
  /* At an edge of sectors numpy may choose the other one; what is kept of a cell is right for both. */
  I sector = least_of((I)((atan2(sin_, cos_) + PI) * (SECTORS / FULL_TURN)), SECTORS - 1);
  I level = k->is_flat ? 0 : (I)floor(z / CELL_LEVEL) + MAX_LEVEL;
  const I *cell = look_up(k, cell_of(x), cell_of(y), level, sector);
  if (!cell) return 0;
  D height;
  Foot foot = find_nearest(k, cell, x, y, z, cos_, sin_);
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
    k->angle[i] = POSE_OF(0, 2);
    k->angle[k->n + i] = POSE_OF(1, 2);
    k->angle[2 * k->n + i] = k->yaw[r];
  }
}

/* The lanes below the middles of the boxes. Returns 0, NO_ROOM or WITH_ARRAYS. */
static I find_lanes_below(K *k) {
  I num = k->n;
  k->num_curved = 0;
  for (I i = 0; i < num; i++) {
    I r = k->rows[i];
    D x = POSE_OF(1, 0) + k->centre[r] * k->cosine[num + i], y = POSE_OF(1, 1) + k->centre[r] * k->sine[num + i];
    if (!has_cell(k, x, y, k->z[r])) return WITH_ARRAYS;
    if (!place_on_lane(k, i, x, y, k->z[r], k->cosine[2 * num + i], k->sine[2 * num + i])) return NO_ROOM;
    k->is_on[i] = (B)is_between_edges(k, i, BESIDE_END);
    if (k->is_on[i]) continue;
    const I *cell = look_up(k, cell_of(x), cell_of(y), 0, -1);
    if (!cell) return NO_ROOM;
    k->is_on[i] = (B)is_on_road(k, cell, x, y, k->z[r]);
  }
  return 0;
}

/* A place at an arc length from the start of a lane, beyond whose end the lanes straight on follow. */
static void find_point(const K *k, I lane, D s, D *x, D *y) {
  for (I j = 0; j < LANES_AHEAD && s > k->length[lane] && k->straight_on[lane] >= 0; j++) {
    s -= k->length[lane];
    lane = k->straight_on[lane];
  }
  find_place(k, lane, s, x, y);
}

/* surroundings.find_lanes, of rows whose headings are in `cosine` and `sine`; returns what `find_lanes_below` does. */
EXPORT I look_at_lanes(K *k) {
  k->num_curved = 0;
  for (I i = 0; i < k->n; i++) {
    D x = k->x[k->rows[i]], y = k->y[k->rows[i]], z = k->z[k->rows[i]], cos_ = k->cosine[i], sin_ = k->sine[i];
    if (!has_cell(k, x, y, z)) return WITH_ARRAYS;
    if (!place_on_lane(k, i, x, y, z, cos_, sin_)) return NO_ROOM;
    k->is_on[i] = (B)is_between_edges(k, i, 1.0);
    for (I j = 0; j < k->num_ahead; j++) {
      D east, north, *ahead = k->points_ahead + 2 * (k->num_ahead * i + j);
      find_point(k, k->lane_below[i], k->s_below[i] + k->ahead[j], &east, &north);
      east -= x;
      north -= y;
      ahead[0] = east * cos_ + north * sin_;
      ahead[1] = north * cos_ - east * sin_;
    }
  }
  return 0;
}

/* The middle of the box of a row, seen from a place; headings of all rows are in `cosine` and `sine`. */
static inline V middle_from(const K *k, I r, D x, D y) {
  V found = {k->x[r] + k->centre[r] * k->cosine[r] - x, k->y[r] + k->centre[r] * k->sine[r] - y};
  return found;
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
typedef struct { D x, y, cos_, sin_, east, north; } Sliding;

static Sliding slide(const K *k, I r) {
  Sliding box = {0.0, 0.0, cos(k->yaw[r]), sin(k->yaw[r]), 0.0, 0.0};
  box.x = k->x[r] + k->centre[r] * box.cos_;
  box.y = k->y[r] + k->centre[r] * box.sin_;
  box.east = k->speed[r] * box.cos_ - k->lateral_speed[r] * box.sin_;
  box.north = k->speed[r] * box.sin_ + k->lateral_speed[r] * box.cos_;
  return box;
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
  D wide = k->half_length[one] + k->half_width[one] + k->half_length[other] + k->half_width[other] + TOLERANCE;
  wide += fabs(k->centre[one]) + fabs(k->centre[other]);
  D fast = fabs(k->speed[one]) + fabs(k->lateral_speed[one]) + fabs(k->speed[other]) + fabs(k->lateral_speed[other]);
  wide += (HORIZON + TOLERANCE) * fast;
  if (fabs(k->x[other] - k->x[one]) > wide || fabs(k->y[other] - k->y[one]) > wide) return 0;
  Sliding box = slide(k, other);
  D x = box.x - own->x, y = box.y - own->y, east = box.east - own->east, north = box.north - own->north;
  D cos_ = fabs(own->cos_ * box.cos_ + own->sin_ * box.sin_), sin_ = fabs(own->cos_ * box.sin_ - own->sin_ * box.cos_);
  D enters = 0.0, leaves = HORIZON + TOLERANCE;
  for (int j = 0; j < 2; j++) {
    I mine = j ? other : one, its = j ? one : other;
    D ahead_x = j ? box.cos_ : own->cos_, ahead_y = j ? box.sin_ : own->sin_;
    D along = k->half_length[mine] + k->half_length[its] * cos_ + k->half_width[its] * sin_ + TOLERANCE;
    D across = k->half_width[mine] + k->half_length[its] * sin_ + k->half_width[its] * cos_ + TOLERANCE;
    if (!cut(x * ahead_x + y * ahead_y, east * ahead_x + north * ahead_y, along, &enters, &leaves)) return 0;
    if (!cut(y * ahead_x - x * ahead_y, north * ahead_x - east * ahead_y, across, &enters, &leaves)) return 0;
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
  k->score_distance[r] += fabs(POSE_OF(0, 3) + POSE_OF(1, 3)) * (0.5 * DT);
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
  D x = POSE_OF(0, 0) + reach * k->cosine[i], y = POSE_OF(0, 1) + reach * k->sine[i];
  D new_x = POSE_OF(1, 0) + reach * k->cosine[k->n + i], new_y = POSE_OF(1, 1) + reach * k->sine[k->n + i];
  for (I j = 0; j < k->num_lines; j++) {
    const D *line = k->lines + 4 * j;
    if (fabs(new_x - line[0]) > LINE_REACH + fabs(new_x - x)) continue;
    if (fabs(new_y - line[1]) > LINE_REACH + fabs(new_y - y)) continue;
    D before = (x - line[0]) * line[2] + (y - line[1]) * line[3];
    D after = (new_x - line[0]) * line[2] + (new_y - line[1]) * line[3];
    if (before <= TOLERANCE && after >= -TOLERANCE) return 1;
  }
  return 0;
}

/* How far boxes reach across their lanes, with sines of this library: whether they decide what edges are crossed. */
static int is_across_known(K *k) {
  int is_known = 1;
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    D turn = POSE_OF(1, 2) - k->yaw_below[i] - atan(k->slope_below[i]);
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
