/* Places of people on their paths, and kerbs: loops for people.py. */

/* _People._ahead */
static D path_ahead(const W *p, I i, D arc, D distance) {
  D there = arc + distance;
  return p->is_loop[i] ? fmod(there, p->path_length[i]) : least(p->path_length[i], there); /* as by fmin */
}

/* Paths.find; of a place that is no number, or beyond all keys, the last leg, as numpy finds it. */
static const D *find_leg(const W *p, I i, D arc) {
  D place = arc * KEYS_PER_METRE;
  I key = fabs(place) < MAX_KEY ? p->base[i] + (I)place : -1, from = 0, num = p->num_keys;
  while (num > 0) {
    I half = num / 2;
    if (p->keys[from + half] <= key) { from += half + 1; num -= half + 1; } else num = half;
  }
  return p->segments + LEG_COLUMNS * ((from ? from : p->num_keys) - 1);
}

/* _People._feet: the foot of person i on a leg; returns whether it is at the end. No number is the begin, as by fmax. */
static int find_foot(const W *p, I i, const D *leg, D *foot, D *away) {
  I r = p->rows[i];
  D length = leg[LEG_END] - leg[LEG_START], east = p->x[r] - leg[LEG_X], north = p->y[r] - leg[LEG_Y];
  D along = east * leg[LEG_DX] + north * leg[LEG_DY], on = least(length, most(0.0, along));
  *foot = leg[LEG_START] + on, *away = hypot(east - on * leg[LEG_DX], north - on * leg[LEG_DY]);
  return along >= length;
}

/* _People._look_along */
static void look_on(W *p, I i, D arc) {
  D ahead = path_ahead(p, i, arc, LOOK_AHEAD), side = p->side[i];
  const D *leg = find_leg(p, i, ahead), *here = find_leg(p, i, arc);
  D along = ahead - leg[LEG_START];
  p->arc[i] = arc;
  p->goal[2 * i] = leg[LEG_X] + along * leg[LEG_DX] + side * leg[LEG_DY];
  p->goal[2 * i + 1] = leg[LEG_Y] + along * leg[LEG_DY] - side * leg[LEG_DX];
  p->course[2 * i] = here[LEG_DX] + 0.0, p->course[2 * i + 1] = here[LEG_DY] + 0.0;
}

/* _People._project and _hold_at_kerb */
EXPORT void find_places(W *p) {
  for (I i = 0; i < p->n; i++) {
    I r = p->rows[i];
    D before = p->leg_start[r], here, there, away, other;
    int is_over = find_foot(p, i, find_leg(p, i, before), &here, &away);
    find_foot(p, i, find_leg(p, i, path_ahead(p, i, before, LOOK_AHEAD)), &there, &other);
    look_on(p, i, other < away || is_over ? there : here);
    if (hypot(p->goal[2 * i] - p->x[r], p->goal[2 * i + 1] - p->y[r]) < 0.5 * LOOK_AHEAD)
      look_on(p, i, path_ahead(p, i, p->arc[i], 0.25 * LOOK_AHEAD));
    D arc = p->arc[i], held = arc;
    for (I c = p->first[i]; c < p->first[i + 1]; c++)
      if (before < p->start[c] && arc >= p->start[c] && p->yields[r] != COMMITTED + c - p->first[i])
        held = least(held, nextafter(p->start[c], 0.0));
    if (held < arc) look_on(p, i, held);
  }
}

/* The speed that person i wants, and the crossing that is next on its way: _People._wishes and _mind_kerb. */
static void look_at_kerb(W *p, I i) {
  I r = p->rows[i], first = p->first[i], state = p->yields[r], next = -1;
  D arc = p->arc[i], nearest = INFINITY;
  int is_inside = 0;
  for (I c = first; c < p->first[i + 1]; c++) {
    D to = p->start[c] - arc;
    if (to <= 0.0 && arc <= p->end[c]) to = 0.0, is_inside = 1;
    else if (to <= 0.0 && p->is_loop[i]) to += p->path_length[i];
    if (to >= 0.0 && to < INFINITY && to <= nearest) nearest = to, next = c - first;
  }
  if (state >= COMMITTED && next != state - COMMITTED) state = 1;
  if (is_inside && state < COMMITTED) state = COMMITTED + next;
  p->wish[i] = p->start_within[r] > 0.0 || arc >= p->stop_from[i] ? 0.0 : p->desired_speed[r];
  p->nearest[i] = nearest, p->next[i] = next, p->yields[r] = state;
}

/* Returns how many ask whether they may cross: asks, and the crossings. */
EXPORT I look_at_kerbs(W *p) {
  I num = 0;
  for (I i = 0; i < p->n; i++) {
    look_at_kerb(p, i);
    if (p->yields[p->rows[i]] < COMMITTED && p->nearest[i] < AT_KERB && p->wish[i] > 0.0)
      p->crossing[num] = p->first[i] + p->next[i], p->asks[num++] = i;
  }
  return num;
}

/* Some begin to cross; the others stop at the kerb. */
EXPORT void mind_kerbs(W *p, I num) {
  for (I j = 0; j < num; j++)
    if (p->goes[j]) p->yields[p->rows[p->asks[j]]] = COMMITTED + p->next[p->asks[j]];
  for (I i = 0; i < p->n; i++) {
    D stop = sqrt(2.0 * BRAKE * most(p->nearest[i] - KERB_GAP, 0.0));
    p->slower[i] = p->yields[p->rows[i]] < COMMITTED ? least(p->wish[i], stop) : p->wish[i];
  }
}
