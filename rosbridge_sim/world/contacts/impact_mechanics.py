"""Impacts of rigid boxes in the plane, within one step: when they touch, where, and the impulse between them.

*Moment*. Within a step a body moves along a straight line and turns evenly. The moment of touching is found by
conservative advancement: a pair advances by no more than the gap between the boxes allows, so nothing is passed over.

*Place*. The normal is that of the axis that separates the boxes best. Sheet metal gives way by `CRUSH`, so all of a box
that is within `CRUSH` of its foremost point takes part. The impulse acts in the middle of the part that both share.

*Impulse* (Brach and Brach, Vehicle Accident Analysis and Reconstruction Methods, ch. 6: planar impact mechanics). With
g the velocity of the one body relative to the other one at that place, J the impulse, and K the matrix that gives the
change of g for an impulse,

    g' = g + K J        g'_n = -e g_n        |J_t| <= mu J_n

J_t ends the sliding if friction can do that, else it is mu J_n against the sliding. With a lever these equations may
add energy (Kane's paradox). Then the first of these that adds none is taken: no restitution, or no friction.

*Order*. The impacts of a step are made one after the other, the earliest first; of equal ones that with the lower ids.
So a body that is thrown against another one hits it within the same step.

Limits of the model: an impact takes no time; bodies keep their shapes; nothing rolls over or is lifted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rosbridge_sim.records import Record

RESTITUTION: Final = 0.1
"""Share of the speed of approach with which vehicles part: 0 to 0.3, less the faster they are (Brach and Brach)."""

FRICTION: Final = 0.5
"""Friction between car bodies: 0.3 to 0.6 for sheet metal that slides along sheet metal, by the same source."""

SOFT: Final = 0.5
"""Below this speed of approach nothing bounces [m/s]: a car that leans against a wall rests."""

CRUSH: Final = 0.1
"""Depth within which a box touches as a whole [m]: bumpers give way by as much in light impacts."""

SLOP: Final = 1e-4
"""Gap at which boxes touch [m]; far below what a client can see."""

NO_APPROACH: Final = 1e-7
"""A slower approach is none, but rounding [m/s]."""

MIN_ADVANCE: Final = 1.0 / 64.0
"""Least advance while a moment of touching is searched, as a share of the step. Two cars that pass each other at 200
km/h move by 2 cm in it."""

BISECTIONS: Final = 16
"""Halvings of the last advance: 1.1 m of motion ends at less than `SLOP`."""

MAX_STRIKES: Final = 16
MAX_IMPACTS: Final = 512
"""Impacts of one pair, and of all, within a step, at most. A row of cars that is pushed together needs some for each
pair, and a body between two others could go on for ever. All take 50 ms at most."""

MAX_PUSH: Final = 0.2
"""Distance by which overlapping bodies are pushed apart in a step, at most [m]. Overlaps that turning leaves are
millimetres."""

SWEEPS: Final = 4
"""Times that all overlapping pairs are pushed apart in a step: enough for a queue of some cars."""

_Vector = tuple[float, float]


@dataclass(slots=True)
class Rigid:
    """A body within a step. It changes while the impacts are made.

    Attributes:
        x, y: centre of gravity at the moment `time` [m].
        yaw: heading then [rad].
        move_x, move_y, turn: change of these in a whole step, as it moves now [m, rad].
        velocity_x, velocity_y, rate: of the centre of gravity [m/s], and yaw rate [rad/s], for impulses.
        per_mass, per_inertia: 1 / mass [1/kg], 1 / moment of inertia [1/(kg m^2)]; 0 for what nothing moves.
        centre: from the centre of gravity forward to the middle of the box [m].
        half_length, half_width: of the box [m].
        can_be_pushed: it may be moved out of an overlap without an impact.
        time: 0 at the beginning of the step, 1 at its end.
        was_struck, was_pushed: what has happened to it in this step.
    """

    x: float
    y: float
    yaw: float
    move_x: float
    move_y: float
    turn: float
    velocity_x: float
    velocity_y: float
    rate: float
    per_mass: float
    per_inertia: float
    centre: float
    half_length: float
    half_width: float
    can_be_pushed: bool = True
    time: float = 0.0
    was_struck: bool = False
    was_pushed: bool = False

    def advance(self, time: float) -> None:
        """Move to a later moment of the step."""
        share = time - self.time
        self.x += share * self.move_x
        self.y += share * self.move_y
        self.yaw += share * self.turn
        self.time = time

    @property
    def reach(self) -> float:
        """Radius around the centre of gravity that holds the box [m]."""
        return math.hypot(self.half_length + abs(self.centre), self.half_width)


class Contact(Record):
    """Two boxes beside each other.

    Attributes:
        gap: between the boxes along the normal, negative if they overlap [m].
        normal: unit vector from the first box to the second one.
        x, y: the place where an impulse acts [m].
    """

    gap: float
    normal: _Vector
    x: float
    y: float


def find_contact(first: Rigid, second: Rigid) -> Contact:
    """Return how two bodies stand to each other at their present places."""
    gap, normal = _separate(first, second, first.time, second.time)
    low, high, top = _front(first, normal)
    other_low, other_high, bottom = _front(second, (-normal[0], -normal[1]))
    along = 0.5 * (max(low, -other_high) + min(high, -other_low))
    height = 0.5 * (top - bottom)
    return Contact(gap, normal, normal[0] * height - normal[1] * along, normal[1] * height + normal[0] * along)


def find_impact(first: Rigid, second: Rigid, since: float) -> float:
    """Return the moment at which two bodies touch, 0..1, inf for none in this step.

    Args:
        since: the earliest moment that counts. Bodies that touch then touch at once.
    """
    speed = math.hypot(second.move_x - first.move_x, second.move_y - first.move_y)
    speed += first.reach * abs(first.turn) + second.reach * abs(second.turn)
    time, gap = since, _separate(first, second, since, since)[0]
    if gap <= SLOP:
        return time
    while time < 1.0 and gap <= speed * (1.0 - time) + SLOP:
        later = min(1.0, time + max(gap / speed, MIN_ADVANCE)) if speed > 0.0 else 1.0
        gap = _separate(first, second, later, later)[0]
        if gap <= SLOP:
            for _ in range(BISECTIONS):
                middle = 0.5 * (time + later)
                if _separate(first, second, middle, middle)[0] <= SLOP:
                    later = middle
                else:
                    time = middle
            return later
        time = later
    return math.inf


def strike(first: Rigid, second: Rigid, contact: Contact) -> bool:
    """Change the velocities of two bodies by the impulse between them.

    Args:
        first: written.
        second: written.

    Returns:
        Whether they approached each other; if not, nothing has changed.
    """
    n_x, n_y = contact.normal
    t_x, t_y = -n_y, n_x
    a_x, a_y = contact.x - first.x, contact.y - first.y
    b_x, b_y = contact.x - second.x, contact.y - second.y
    g_x = second.velocity_x - second.rate * b_y - first.velocity_x + first.rate * a_y
    g_y = second.velocity_y + second.rate * b_x - first.velocity_y - first.rate * a_x
    g_n, g_t = g_x * n_x + g_y * n_y, g_x * t_x + g_y * t_y
    per_mass = first.per_mass + second.per_mass
    if g_n >= -NO_APPROACH or per_mass == 0.0:
        return False
    # Levers of impulses along the normal and across it.
    a_n, a_t = a_x * n_y - a_y * n_x, a_x * t_y - a_y * t_x
    b_n, b_t = b_x * n_y - b_y * n_x, b_x * t_y - b_y * t_x
    k_nn = per_mass + first.per_inertia * a_n * a_n + second.per_inertia * b_n * b_n
    k_tt = per_mass + first.per_inertia * a_t * a_t + second.per_inertia * b_t * b_t
    k_nt = first.per_inertia * a_n * a_t + second.per_inertia * b_n * b_t
    j_n, j_t = _choose(g_n, g_t, (k_nn, k_tt, k_nt), RESTITUTION if g_n < -SOFT else 0.0)
    j_x, j_y = j_n * n_x + j_t * t_x, j_n * n_y + j_t * t_y
    first.velocity_x -= first.per_mass * j_x
    first.velocity_y -= first.per_mass * j_y
    first.rate -= first.per_inertia * (j_n * a_n + j_t * a_t)
    second.velocity_x += second.per_mass * j_x
    second.velocity_y += second.per_mass * j_y
    second.rate += second.per_inertia * (j_n * b_n + j_t * b_t)
    return True


def _choose(g_n: float, g_t: float, k: tuple[float, float, float], restitution: float) -> _Vector:
    """Return the impulse along the normal and across it [N s]; see the head of this file.

    Args:
        g_n: relative velocity along the normal, negative [m/s].
        k: K_nn, K_tt and K_nt [1/kg].
    """
    k_nn, k_tt, k_nt = k
    determinant = k_nn * k_tt - k_nt * k_nt

    def stick(share: float) -> _Vector:
        r_n, r_t = -(1.0 + share) * g_n, -g_t
        return (k_tt * r_n - k_nt * r_t) / determinant, (k_nn * r_t - k_nt * r_n) / determinant

    wanted = stick(restitution)
    slope = math.copysign(FRICTION, wanted[1])
    divisor = k_nn + slope * k_nt
    slide = -(1.0 + restitution) * g_n / divisor if divisor > 0.0 else 0.0
    for j_n, j_t in (wanted, (slide, slope * slide), stick(0.0)):
        gain = j_n * (2.0 * g_n + k_nn * j_n + k_nt * j_t) + j_t * (2.0 * g_t + k_nt * j_n + k_tt * j_t)
        if j_n > 0.0 and abs(j_t) <= FRICTION * j_n * (1.0 + 1e-9) and gain <= 0.0:
            return j_n, j_t
    return -(1.0 + restitution) * g_n / k_nn, 0.0


def play(bodies: Sequence[Rigid], pairs: Sequence[tuple[int, int]], dt: float) -> None:
    """Move bodies to the end of the step, with all impacts on the way.

    Args:
        bodies: written; all at the moment 0.
        pairs: indices of two bodies each, at least one of which can be moved. Of impacts at the same moment, the
            first in this order is made first.
        dt: length of the step [s].
    """
    of_body: list[list[int]] = [[] for _ in bodies]
    for which, pair in enumerate(pairs):
        for i in pair:
            of_body[i].append(which)
    moments = [find_impact(bodies[i], bodies[j], 0.0) for i, j in pairs]
    num_left = [MAX_STRIKES] * len(pairs)
    for _ in range(MAX_IMPACTS if pairs else 0):
        which = min(range(len(pairs)), key=moments.__getitem__)
        moment = moments[which]
        if moment == math.inf:
            break
        i, j = pairs[which]
        first, second = bodies[i], bodies[j]
        first.advance(moment)
        second.advance(moment)
        num_left[which] -= 1
        if not strike(first, second, find_contact(first, second)):
            moments[which] = math.inf
            continue
        for body in (first, second):
            if body.per_mass > 0.0:
                body.was_struck = True
                body.move_x, body.move_y = body.velocity_x * dt, body.velocity_y * dt
                body.turn = body.rate * dt
        for other in sorted({*of_body[i], *of_body[j]}):
            a, b = pairs[other]
            moments[other] = find_impact(bodies[a], bodies[b], moment) if num_left[other] > 0 else math.inf
    for body in bodies:
        body.advance(1.0)
    _push_apart(bodies, pairs)


def _push_apart(bodies: Sequence[Rigid], pairs: Sequence[tuple[int, int]]) -> None:
    """Move bodies out of what is left of their overlaps, the heavier ones less."""
    for _ in range(SWEEPS):
        is_done = True
        for i, j in pairs:
            first, second = bodies[i], bodies[j]
            gap, normal = _separate(first, second, 1.0, 1.0)
            yields = [body.per_mass if body.can_be_pushed or body.was_struck else 0.0 for body in (first, second)]
            total = yields[0] + yields[1]
            if gap >= -SLOP or total == 0.0:
                continue
            is_done = False
            push = min(-gap, MAX_PUSH / SWEEPS) / total
            for body, share in ((first, -push * yields[0]), (second, push * yields[1])):
                if share:
                    body.x += share * normal[0]
                    body.y += share * normal[1]
                    body.was_pushed = True
        if is_done:
            return


def _separate(first: Rigid, second: Rigid, at_first: float, at_second: float) -> tuple[float, _Vector]:
    """Return the gap between two boxes at given moments, and the normal from the first to the second one.

    It is the largest gap along the normals of all edges (separating axis theorem). Boxes that are corner to corner are
    farther apart than that.
    """
    x, y, cos, sin = _middle(first, at_first)
    other_x, other_y, other_cos, other_sin = _middle(second, at_second)
    x, y = other_x - x, other_y - y
    across, along = abs(cos * other_sin - sin * other_cos), abs(cos * other_cos + sin * other_sin)
    best, normal = -math.inf, (1.0, 0.0)
    for n_x, n_y, reach in (
        (cos, sin, first.half_length + second.half_length * along + second.half_width * across),
        (-sin, cos, first.half_width + second.half_length * across + second.half_width * along),
        (other_cos, other_sin, second.half_length + first.half_length * along + first.half_width * across),
        (-other_sin, other_cos, second.half_width + first.half_length * across + first.half_width * along),
    ):
        distance = x * n_x + y * n_y
        gap = abs(distance) - reach
        if gap > best:
            best, normal = gap, (n_x, n_y) if distance >= 0.0 else (-n_x, -n_y)
    return best, normal


def _middle(body: Rigid, time: float) -> tuple[float, float, float, float]:
    """Return the middle of the box at a moment [m], and cosine and sine of its heading."""
    share = time - body.time
    yaw = body.yaw + share * body.turn
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y = body.x + share * body.move_x, body.y + share * body.move_y
    return x + body.centre * cos, y + body.centre * sin, cos, sin


def _front(body: Rigid, normal: _Vector) -> tuple[float, float, float]:
    """Return the part of a box within `CRUSH` of its foremost point along a normal.

    Returns:
        Least and greatest place of this part, counted to the left of the normal, and the foremost point along it [m].
    """
    x, y, cos, sin = _middle(body, body.time)
    n_x, n_y = normal
    corners = []
    for length, width in ((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)):
        along, across = length * body.half_length, width * body.half_width
        place_x, place_y = x + along * cos - across * sin, y + along * sin + across * cos
        corners.append((place_x * n_x + place_y * n_y, place_y * n_x - place_x * n_y))
    top = max(corners)[0]
    limit = top - CRUSH
    sides: list[float] = []
    for (height, side), (next_height, next_side) in zip(corners, corners[1:] + corners[:1], strict=True):
        if height >= limit:
            sides.append(side)
        if (height >= limit) != (next_height >= limit):
            sides.append(side + (limit - height) / (next_height - height) * (next_side - side))
    return min(sides), max(sides), top
