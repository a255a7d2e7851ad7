"""The equations of the single track model in C, of the text of `single_track`, in stages.

Between two stages numpy makes sines, cosines and arc tangents of arrays. A stage has all equations that need no more
than those made before. What a later stage needs is kept in rows of an array, a row for each number.
"""

from __future__ import annotations

import re
from functools import cache
from itertools import pairwise
from typing import Final, NamedTuple

from rosbridge_sim.world.kernels.c_source import COperators
from rosbridge_sim.world.state.entity_arrays import FLOATS
from rosbridge_sim.world.state.world import DT
from rosbridge_sim.world.state.written_equations import Script
from rosbridge_sim.world.vehicle.dynamics import FIRST, LAST, RESULTS, columns_from, find_after

_NAMES: Final = re.compile(r"\b[ab]\d+\b")
_CALL: Final = re.compile(r"(sin|cos|arctan) (\w+)")


class CarStages(NamedTuple):
    """The stages.

    Attributes:
        bodies: the text of each, for car i in row r.
        calls: before each further one, functions of numpy with the first and last of the rows of `args` that they take.
        num_kept, num_args: rows that they need.
    """

    bodies: list[str]
    calls: list[list[tuple[str, int, int]]]
    num_kept: int
    num_args: int


@cache
def car_stages(*, is_stable: bool) -> CarStages:
    """Return the stages, with or without stability control."""
    columns = FLOATS[FLOATS.index(FIRST) : FLOATS.index(LAST) + 1]
    script = Script(len(columns))
    after = find_after(COperators(script, is_any=True), script.given, DT, is_stable=is_stable)
    lines = dict(line.split(" = ", 1) for line in script.lines[1:])
    # The stage of a number: one more than that of what it needs if it is a sine, a cosine or an arc tangent.
    calls = {name: found.groups() for name, text in lines.items() if (found := _CALL.fullmatch(text))}
    stage = {term.name: 0 for term in script.given}
    for name, text in lines.items():
        stage[name] = max((stage[each] for each in _NAMES.findall(text)), default=0) + (name in calls)
    last = max(stage.values())
    # Numbers of all stages stand in columns of the world, or in rows of `found` if numpy makes them.
    order = sorted(calls, key=lambda name: (stage[name], calls[name][0]))
    places = {name: f"k->found[{i} * k->n + i]" for i, name in enumerate(order)}
    places |= {term.name: f"k->now[{i} * k->stride + r]" for i, term in enumerate(script.given)}
    targets = [
        place for names in RESULTS for place in columns_from([places[term.name] for term in script.given], *names)
    ]
    # The names that each stage reads: for its equations, for the next calls of numpy, and at the end for the results.
    used = [
        {
            each
            for name, text in lines.items()
            if stage[name] == s and name not in calls
            for each in _NAMES.findall(text)
        }
        | {calls[name][1] for name in order if stage[name] == s + 1}
        | {term.name for term in after if s == last}
        for s in range(last + 1)
    ]
    # What an earlier stage has made is kept in rows of `kept`.
    later = sorted({name for s, names in enumerate(used) for name in names if stage[name] < s and name not in places})
    places |= {name: f"k->kept[{i} * k->n + i]" for i, name in enumerate(later)}
    bodies = []
    for s, names in enumerate(used):
        own = [name for name in lines if stage[name] == s and name not in calls]
        body = [f"D {name} = {places[name]};" for name in sorted(names) if name not in own]
        body += [f"D {name} = {lines[name]};" for name in own]
        body += [f"{places[name]} = {name};" for name in later if stage[name] == s]
        body += [f"k->args[{i} * k->n + i] = {calls[name][1]};" for i, name in enumerate(order) if stage[name] == s + 1]
        body += [f"{place} = {term.name};" for place, term in zip(targets, after, strict=True) if s == last]
        bodies.append("".join(f"    {line}\n" for line in body))
    # Neighbours in `order` of one stage and one function are one call of numpy.
    kinds = [(stage[name], calls[name][0]) for name in order]
    starts = [i for i, kind in enumerate(kinds) if not i or kind != kinds[i - 1]]
    runs = [(*kinds[a], a, b) for a, b in pairwise([*starts, len(kinds)])]
    groups = [[(function, a, b) for at, function, a, b in runs if at == s] for s in range(1, last + 1)]
    return CarStages(bodies, groups, len(later), len(order))


def write_cars() -> str:
    """Return the functions of all stages, and the one that calls them by number: first those without control."""
    bodies = [body for is_stable in (False, True) for body in car_stages(is_stable=is_stable).bodies]
    loop = "  for (I i = 0, r; i < k->n; i++) {\n    r = k->rows[i];\n"
    text = [f"static void car_{i}(const K *k) {{\n{loop}{body}  }}\n}}\n" for i, body in enumerate(bodies)]
    names = ", ".join(f"car_{i}" for i in range(len(bodies)))
    table = f"static void (*const CARS[])(const K *) = {{{names}}};\n"
    return "".join([*text, table, "EXPORT void drive_cars(K *k, I stage) { CARS[stage](k); }\n"])
