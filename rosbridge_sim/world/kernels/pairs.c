/* Pairs of boxes that may touch: loops for collisions.py, near_pairs.py and planar.py. They decide which steps numpy
   judges, and never what touches: where a last digit could matter, they say that a pair may. */

enum { X, Y, YAW, SPEED };
#define POSE(t, c, r) (k->poses[(5 * (t) + (c)) * k->num_rows + (r)])

/* A pair of the list: the poses when it was judged last, and the distance that it had then; 0 for none. */
struct Pair {
  D gap, judged[2][3], half[4], centre[2], swing[2];
  I row[2];
};
/* A body, as the list is made: its box enlarged by its margins, in the steps of the list. */
struct Box {
  V heading, first, last, middle, span;
  D half[2];
  I column, line, next, is_wide;
};
_Static_assert(sizeof(Pair) == 8 * PAIR_WORDS && sizeof(Box) == 8 * BOX_WORDS, "room in pair_kernel.py");

/* planar._octagon; lengths and widths: of the one box, then of the other. */
static void find_octagon(const V *heading, const D *half, D *reach) {
  V between = seen_from(heading[1], heading[0]);
  D cosine = fabs(between.x), sine = fabs(between.y);
  for (I i = 0; i < 4; i++) reach[i] = half[i] + half[i ^ 2] * cosine + half[i ^ 3] * sine;
}

/* planar.do_boxes_meet */
static int do_boxes_meet(V first, V last, const V *heading, const D *half) {
  V middle = {(first.x + last.x) * 0.5, (first.y + last.y) * 0.5};
  V slide = {(last.x - first.x) * 0.5, (last.y - first.y) * 0.5};
  D reach[4], breadth = 0.0;
  find_octagon(heading, half, reach);
  for (I i = 0; i < 2; i++) {
    V to_other = seen_from(heading[i], middle), along = seen_from(heading[i], slide);
    if (!(fabs(to_other.x) <= reach[2 * i] + fabs(along.x))) return 0;
    if (!(fabs(to_other.y) <= reach[2 * i + 1] + fabs(along.y))) return 0;
    breadth += half[2 * i] * fabs(along.y) + half[2 * i + 1] * fabs(along.x);
  }
  return fabs(middle.x * slide.y - middle.y * slide.x) <= breadth;
}

/* planar.box_gaps */
static D find_gap(V apart, const V *heading, const D *half) {
  D reach[4], gap = -INFINITY;
  find_octagon(heading, half, reach);
  for (I i = 0; i < 2; i++) {
    V to_other = seen_from(heading[i], apart);
    gap = most(gap, most(fabs(to_other.x) - reach[2 * i], fabs(to_other.y) - reach[2 * i + 1]));
  }
  return gap;
}

/* CollisionDetector._are_still_apart, of one pair */
static int is_still_apart(const K *k, const Pair *pair) {
  if (pair->gap <= 0.0) return 0;
  for (I t = 0; t < 2; t++) {
    D way[2][3];
    for (I i = 0; i < 2; i++)
      for (I c = X; c <= YAW; c++) way[i][c] = POSE(t, c, pair->row[i]) - pair->judged[i][c];
    D nearer = fabs(way[1][X] - way[0][X]) + fabs(way[1][Y] - way[0][Y]);
    if (!(nearer + fabs(way[0][YAW]) * pair->swing[0] + fabs(way[1][YAW]) * pair->swing[1] < pair->gap)) return 0;
  }
  return 1;
}

/* The first half of CollisionDetector._judge, of one pair: whether it may touch; if not, its gap is kept. */
static int may_touch(const K *k, Pair *pair) {
  V heading[2][2], middle[2][2];
  D room[4];
  for (I i = 0; i < 2; i++) {
    for (I t = 0; t < 2; t++) {
      D yaw = POSE(t, YAW, pair->row[i]);
      V unit = heading[t][i] = (V){cos(yaw), sin(yaw)};
      middle[t][i].x = POSE(t, X, pair->row[i]) + unit.x * pair->centre[i];
      middle[t][i].y = POSE(t, Y, pair->row[i]) + unit.y * pair->centre[i];
    }
    V turn = minus(heading[1][i], heading[0][i]);
    D more = sqrt(turn.x * turn.x + turn.y * turn.y) * pair->swing[i] + TOUCHING;
    room[2 * i] = pair->half[2 * i] + more, room[2 * i + 1] = pair->half[2 * i + 1] + more;
  }
  V first = minus(middle[0][1], middle[0][0]), last = minus(middle[1][1], middle[1][0]);
  pair->gap = 0.0;
  if (do_boxes_meet(first, last, heading[1], room)) return 1;
  pair->gap = find_gap(last, heading[1], pair->half) - TOUCHING;
  for (I i = 0; i < 2; i++)
    for (I c = X; c <= YAW; c++) pair->judged[i][c] = POSE(1, c, pair->row[i]);
  return 0;
}

static I judge_list(const K *k) {
  I found = 0;
  for (I m = 0; m < k->num_pairs; m++)
    if (!is_still_apart(k, &k->pair[m])) found |= may_touch(k, &k->pair[m]);
  return found;
}

/* CollisionDetector._is_astray */
static int is_astray(K *k) {
  int found = 0;
  for (I t = 0; t < 2; t++)
    for (I c = X; c <= YAW; c++)
      for (I r = 0; r < k->num_rows; r++) {
        I at = c * k->num_rows + r;
        D seen = k->seen[3 * t * k->num_rows + at] += k->rate[at], drift = fabs(POSE(t, c, r) - seen);
        if (drift > k->margin[at]) found |= c < YAW || FULL_TURN - drift > k->margin[at];
      }
  return found;
}

/* Takes the poses as the step has ended. Returns 0 if nothing touches, 1 if something may, 2 if the list has ended. */
EXPORT I watch_pairs(K *k, I is_due) {
  for (I c = 0; c < 5; c++)
    for (I r = 0; r < k->num_rows; r++) POSE(1, c, r) = k->now[c * k->stride + r];
  return is_astray(k) || is_due ? 2 : judge_list(k);
}

/* CollisionDetector._look_around: what is foreseen, and the boxes from the beginning of this step on. */
static void foresee_bodies(K *k) {
  for (I t = 0; t < 2; t++)
    for (I at = 0; at < 3 * k->num_rows; at++) k->seen[3 * t * k->num_rows + at] = k->poses[5 * t * k->num_rows + at];
  for (I r = 0; r < k->num_rows; r++) {
    D *rate = &k->rate[r], *margin = &k->margin[r];
    D x = POSE(1, X, r) - POSE(0, X, r), y = POSE(1, Y, r) - POSE(0, Y, r);
    D turn = fabs(wrap(POSE(1, YAW, r) - POSE(0, YAW, r)));
    D stray = MARGIN + 0.5 * LIFE * LIFE * most(fabs(x), fabs(y)) * turn;
    rate[0] = x, rate[k->num_rows] = y, rate[2 * k->num_rows] = 0.0;
    margin[0] = margin[k->num_rows] = stray, margin[2 * k->num_rows] = TURN_MARGIN / k->reach[r] + LIFE * turn;
  }
  for (I i = 0; i < k->n; i++) {
    I r = k->rows[i];
    Box *box = &k->box[i];
    V slide = {k->rate[r], k->rate[k->num_rows + r]}, unit = box->heading = (V){k->unit_x[r], k->unit_y[r]};
    V middle = {unit.x * k->centre[r] + POSE(1, X, r), unit.y * k->centre[r] + POSE(1, Y, r)};
    D cosine = fabs(unit.x), sine = fabs(unit.y);
    D length = k->half_length[r], width = k->half_width[r];
    D extra = sqrt(2.0) * k->margin[r] + k->margin[2 * k->num_rows + r] * k->reach[r];
    box->half[0] = length + extra, box->half[1] = width + extra;
    box->first = minus(middle, slide);
    box->last = (V){middle.x + LIFE * slide.x, middle.y + LIFE * slide.y};
    box->middle = (V){0.5 * (box->first.x + box->last.x), 0.5 * (box->first.y + box->last.y)};
    box->span.x = length * cosine + width * sine + (0.5 * (LIFE + 1) * fabs(slide.x) + extra);
    box->span.y = length * sine + width * cosine + (0.5 * (LIFE + 1) * fabs(slide.y) + extra);
  }
}

/* near_pairs.find_near_pairs: those that are larger than usual. */
static void find_wide(K *k) {
  D largest[MAX_WIDE + 1] = {0.0};
  for (I i = 0; i < k->n; i++) {
    D size = most(k->box[i].span.x, k->box[i].span.y);
    for (I j = 0; j <= MAX_WIDE; j++)
      if (size > largest[j]) {
        D smaller = largest[j];
        largest[j] = size, size = smaller;
      }
  }
  k->num_wide = 0;
  for (I i = 0; i < k->n; i++) {
    k->box[i].is_wide = most(k->box[i].span.x, k->box[i].span.y) > MUCH * largest[MAX_WIDE];
    if (k->box[i].is_wide) k->wide[k->num_wide++] = i;
  }
}

static I *find_head(K *k, I column, I line) {
  uint64_t mixed = ((uint64_t)column * 0x9E3779B97F4A7C15u ^ (uint64_t)line) * 0xC2B2AE3D27D4EB4Fu;
  return &k->head[(I)(mixed >> 32) & (k->num_heads - 1)];
}

/* Puts all that are not wide into cells, the last one first. Returns whether there is a cell for each. */
static int fill_cells(K *k) {
  V side = {1.0, 1.0};
  for (I i = 0; i < k->n; i++)
    if (!k->box[i].is_wide) side.x = most(side.x, k->box[i].span.x), side.y = most(side.y, k->box[i].span.y);
  for (I j = 0; j < k->num_heads; j++) k->head[j] = -1;
  for (I i = k->n - 1; i >= 0; i--) {
    Box *box = &k->box[i];
    D column = floor(box->middle.x / (2.0 * side.x)), line = floor(box->middle.y / (2.0 * side.y));
    if (!(fabs(column) < FAR_CELL && fabs(line) < FAR_CELL)) return 0;
    box->column = (I)column, box->line = (I)line;
    if (box->is_wide) continue;
    I *head = find_head(k, box->column, box->line);
    box->next = *head, *head = i;
  }
  return 1;
}

/* Lists a pair whose rectangles overlap and of which one is a car, if the boxes may meet: in order within those of i. */
static void add_if_near(K *k, I i, I j) {
  const Box *one = &k->box[i], *other = &k->box[j];
  if (!(fabs(one->middle.x - other->middle.x) <= one->span.x + other->span.x)) return;
  if (!(fabs(one->middle.y - other->middle.y) <= one->span.y + other->span.y)) return;
  if (!k->is_car[i] && !k->is_car[j]) return;
  k->num_near += 1;
  V heading[2] = {one->heading, other->heading};
  D sides[4] = {one->half[0], one->half[1], other->half[0], other->half[1]};
  if (!do_boxes_meet(minus(other->first, one->first), minus(other->last, one->last), heading, sides)) return;
  I at = k->num_pairs++, *pairs = k->pairs;
  if (at >= k->most_pairs) return; /* it is counted, so that there is room for all at the next try */
  for (; at > 0 && pairs[at - 1] == i && pairs[k->most_pairs + at - 1] > j; at--)
    pairs[k->most_pairs + at] = pairs[k->most_pairs + at - 1];
  pairs[at] = i, pairs[k->most_pairs + at] = j;
  pairs[k->num_pairs - 1] = i;
}

/* The partners of one that come after it. Returns how many there are in its cell and in those beside it. */
static I find_partners(K *k, I i) {
  const Box *box = &k->box[i];
  I num = 0;
  if (k->is_small || box->is_wide) {
    for (I j = i + 1; j < k->n && k->world[j] == k->world[i]; j++) add_if_near(k, i, j);
    return 0;
  }
  for (I w = 0; w < k->num_wide; w++)
    if (k->wide[w] > i) add_if_near(k, i, k->wide[w]);
  for (I column = box->column - 1; column <= box->column + 1; column++)
    for (I line = box->line - 1; line <= box->line + 1; line++)
      for (I j = *find_head(k, column, line); j >= 0; j = k->box[j].next, k->num_visited++)
        if (j > i && k->box[j].column == column && k->box[j].line == line) add_if_near(k, i, j), num++;
  return num;
}

/* The pairs of the list, by headings of numpy. Returns their number, or -1 for a heap, of which numpy takes a part. */
EXPORT I list_pairs(K *k) {
  foresee_bodies(k);
  k->num_pairs = k->num_near = k->num_wide = k->num_visited = 0;
  if (!k->is_small) {
    find_wide(k);
    if (!fill_cells(k)) return -1;
  }
  I num_compared = 0, most_compared = most_of(MAX_BOX_PAIRS, PAIRS_EACH * k->n);
  for (I i = 0; i < k->n; i++) {
    num_compared += find_partners(k, i);
    if (k->is_small) continue;
    if (num_compared > most_compared || k->num_near > most_of(MAX_NEAR, NEAR_EACH * k->n)) return -1;
    if (k->num_visited > MAX_VISITS * most_compared) return -1; /* somebody has chosen places of one head */
  }
  for (I m = 0; m < least_of(k->num_pairs, k->most_pairs); m++)
    for (I i = 0; i < 2; i++) k->pairs[i * k->most_pairs + m] = k->rows[k->pairs[i * k->most_pairs + m]];
  return k->num_pairs;
}

/* CollisionDetector._measure for the first pairs of rows, and their judgement: 1 if some may touch. */
EXPORT I judge_pairs(K *k, I num) {
  k->num_pairs = num;
  for (I m = 0; m < num; m++) {
    Pair *pair = &k->pair[m];
    pair->gap = 0.0;
    for (I i = 0; i < 2; i++) {
      I r = pair->row[i] = k->pairs[i * k->most_pairs + m];
      D corner = sqrt(k->half_length[r] * k->half_length[r] + k->half_width[r] * k->half_width[r]);
      pair->half[2 * i] = most(k->half_length[r] - TOUCHING / 2.0, 0.0);
      pair->half[2 * i + 1] = most(k->half_width[r] - TOUCHING / 2.0, 0.0);
      pair->centre[i] = k->centre[r], pair->swing[i] = 0.5 * PI * (corner + fabs(k->centre[r]));
    }
  }
  return judge_list(k);
}
