/* Places on lanes, and the lanes ahead: loops for roads.py, lane_change_map.py and route_choice.py. */

#define LANE(r, j) (k->lane[(r) + (j) * k->stride])

static inline D least(D a, D b) { return b < a ? b : a; }
static inline D most(D a, D b) { return b > a ? b : a; }
static inline I least_of(I a, I b) { return b < a ? b : a; }
static inline I most_of(I a, I b) { return b > a ? b : a; }

static inline V minus(V a, V b) { return (V){a.x - b.x, a.y - b.y}; }

/* Seen from a unit vector: the part of a vector along it and the part across it, to the left. */
static inline V seen_from(V unit, V v) { return (V){v.x * unit.x + v.y * unit.y, v.y * unit.x - v.x * unit.y}; }

/* planar.wrap_angle */
static inline D wrap(D angle) {
  if (fabs(angle) < PI || angle == PI) return angle + 0.0;
  D wrapped = angle - FULL_TURN * ceil((angle - PI) / FULL_TURN);
  return fabs(wrapped) >= PI ? PI : wrapped;
}

/* numpy.searchsorted: the first place from `from` on whose number is not below the value, or is above it. */
static I find_not_below(const I *numbers, I num, I value) {
  I from = 0;
  while (num > 0) {
    I half = num / 2;
    if (numbers[from + half] < value) { from += half + 1; num -= half + 1; } else num = half;
  }
  return from;
}

static I find_above(const D *numbers, I num, D value) {
  I from = 0;
  while (num > 0) {
    I half = num / 2;
    if (numbers[from + half] <= value) { from += half + 1; num -= half + 1; } else num = half;
  }
  return from;
}

/* A place held within its lane, as by fmin and fmax: no number is the begin, for a place becomes an index. */
static inline D hold_on(const K *k, I lane, D s) { return isnan(s) ? 0.0 : least(most(s, 0.0), k->length[lane]); }

/* Roads.locate: the point before a place, and the share of the way to the next point. */
static I locate(const K *k, I lane, D s, D *share) {
  s = hold_on(k, lane, s);
  I first = k->first[lane], last = k->last_leg[lane];
  I point = least_of(first + (I)(s * k->legs_per_metre[lane]), last);
  if (s < k->s[point] || s >= k->leg_end_of[point])
    point = least_of(most_of(find_above(k->chain, k->num_points, k->base[lane] + s) - 1, first), last);
  *share = (s - k->s[point]) / k->segment_length[k->segment_of_point[point]];
  return point;
}

/* bends.offset and bends.slope, of the leg behind a point. */
static inline D bend_aside(const K *k, I point, D along, D length) {
  return along * (length - along) * (k->curve[2 * point] + k->curve[2 * point + 1] * along);
}
static inline D bend_slope(const K *k, I point, D along, D length) {
  D p = k->curve[2 * point], q = k->curve[2 * point + 1];
  return length * p + along * (2.0 * (length * q - p) - 3.0 * q * along);
}
static inline int is_straight(const K *k, I point) { return k->curve[2 * point] == 0.0 && k->curve[2 * point + 1] == 0.0; }

/* Roads.places, of a place on a lane. */
static V find_place(const K *k, I lane, D s) {
  D share;
  I point = locate(k, lane, s, &share);
  const D *here = k->points + 3 * point;
  D east = here[3] - here[0], north = here[4] - here[1], length = k->segment_length[k->segment_of_point[point]];
  V place = {here[0] + share * east, here[1] + share * north};
  if (is_straight(k, point)) return place;
  D aside = bend_aside(k, point, share * length, length) / length;
  return (V){place.x - aside * north, place.y + aside * east};
}

/* LaneNeighbours.cross: the lane beside a place, -1 for none, and the place on it. */
static I cross(const K *k, I side, I lane, D s, D *beside) {
  D share;
  I point = locate(k, lane, s, &share);
  const D *across = k->across + side * k->num_points;
  *beside = across[point] + share * (across[point + 1] - across[point]);
  if (!isnan(*beside)) return k->beside[side * k->num_lanes + lane];
  *beside = 0.0;
  return -1;
}

/* right_of_way.find_entered: where among the lanes ahead one is that the nose has reached, 0 for none. */
static I find_entered(const K *k, I i, I r, I lane) {
  D beyond = k->arc[r] + k->nose[i];
  I place = 0;
  if (lane < 0 || beyond < k->length[k->lane[r]]) return 0;
  for (I j = 1; j < NUM_LANES && LANE(r, j) >= 0; j++) {
    beyond = beyond - k->length[LANE(r, j - 1)];
    if (LANE(r, j) == lane && beyond >= 0.0) place = j;
  }
  return place;
}

/* chance.mix */
static inline uint64_t mix(uint64_t value) {
  value *= 0x9E3779B97F4A7C15ull;
  value = (value ^ (value >> 30)) * 0xBF58476D1CE4E5B9ull;
  value = (value ^ (value >> 27)) * 0x94D049BB133111EBull;
  return value ^ (value >> 31);
}

/* RouteChoice.find_wanted: the lane of the route at a turn, -1 for none; and the index into the route. */
static I find_on_route(const K *k, I i, I turn, I *index) {
  *index = k->is_loop[i] ? turn % most_of(k->route_length[i], 1) : turn;
  return *index < k->route_length[i] ? k->route[k->route_first[i] + *index] : -1;
}

/* RouteChoice._beside_route */
static I find_beside_route(const K *k, I lane, I wanted) {
  I found = -1, nearest = 0;
  I in_map = lane % k->num_in_map;
  for (I j = k->first_successor[in_map]; j < k->first_successor[in_map + 1]; j++) {
    I other = k->successor[j] + lane - in_map, apart = k->place[other] - k->place[wanted];
    if (k->group[other] != k->group[wanted]) continue;
    if (apart < 0) apart = -apart;
    if (found < 0 || apart < nearest) { found = other; nearest = apart; }
  }
  return found;
}

/* RouteChoice.choose */
static I choose(const K *k, I i, I lane, I turn) {
  I chosen = -1, index;
  if (lane < 0) return chosen;
  if (k->onward_first[lane] < k->onward_first[lane + 1]) {
    uint64_t bits = mix(k->salt[i] + (uint64_t)turn);
    I first = k->onward_first[lane], num = k->onward_first[lane + 1] - first;
    if (k->num_bounds) {
      I place = lane * ONE + (I)(bits % ONE);
      chosen = k->onward_other[find_not_below(k->bounds, k->num_bounds, place + 1)];
    } else chosen = k->onward_other[first + (I)(bits % (uint64_t)num)];
  }
  if (!k->has_route) return chosen;
  I wanted = find_on_route(k, i, turn, &index), length = k->route_length[i];
  if (index >= length) return chosen;
  if (!k->is_any) return wanted;
  I before = k->route[k->route_first[i] + (index - 1 + length) % length];
  return lane == before ? wanted : find_beside_route(k, lane, wanted);
}

/* RouteChoice.preview: a lane and the five after it. */
static void preview(const K *k, I i, I lane, I *lanes) {
  I turns = k->turns[k->rows[i]];
  lanes[0] = lane;
  for (I j = 1; j < NUM_LANES; j++) lanes[j] = choose(k, i, lanes[j - 1], turns + j);
}
