"""The state diagram of synchronous mode and the table of all its transitions, from `SYNC_TABLE`."""

from __future__ import annotations

import math
from typing import Final

from rosbridge_sim.simulator.sync.sync_table import SYNC_TABLE, SyncEvent, SyncState
from scripts.docs_pages.svg import INK, PAPER, PAUSED_FILL, Point, arrow, box, document, quadratic_point, text

SIZE: Final = (150.0, 54.0)
"""Width and height of a state's box [px]."""

MIDDLES: Final[dict[SyncState, Point]] = {
    SyncState.FREE: (110, 250),
    SyncState.OPEN: (400, 90),
    SyncState.LED: (640, 250),
    SyncState.WAITING: (860, 385),
    SyncState.FREE_PAUSED: (110, 520),
    SyncState.OPEN_PAUSED: (400, 680),
    SyncState.LED_PAUSED: (640, 520),
}
"""Middle of each state's box [px]: running states above, their paused twins below."""

BENDS: Final[dict[tuple[SyncState, SyncState], float]] = {
    (SyncState.WAITING, SyncState.OPEN): 130.0,
    (SyncState.WAITING, SyncState.FREE): 14.0,
    (SyncState.WAITING, SyncState.FREE_PAUSED): -30.0,
    (SyncState.LED, SyncState.FREE_PAUSED): 0.0,
}
"""Arrows that would cross a box or another number: how far their middle lies beside the straight line [px]."""

USUAL_BEND: Final = 26.0
"""The same for all others: far enough that an arrow and its way back are two lines."""

BADGE_AT: Final = 0.45
"""Place of a number on its arrow: nearer to the start, so that numbers at a busy end do not touch."""

MEANINGS: Final = {
    SyncState.FREE: "real time",
    SyncState.OPEN: "waits for a master",
    SyncState.LED: "moves by ticks",
    SyncState.WAITING: "ticks wait",
    SyncState.FREE_PAUSED: "real time, paused",
    SyncState.OPEN_PAUSED: "no master, paused",
    SyncState.LED_PAUSED: "master, paused",
}

EVENTS: Final = {
    SyncEvent.START_BY_MASTER: "start by the master",
    SyncEvent.START_BY_OTHER: "start by another id",
    SyncEvent.START_MISFIT: "start with a bad time step or id",
    SyncEvent.STOP_BY_MASTER: "stop by the master",
    SyncEvent.STOP_BY_OTHER: "stop by another id",
    SyncEvent.TICK_BY_MASTER: "tick by the master",
    SyncEvent.TICK_BY_OTHER: "tick by another id",
    SyncEvent.TICK_MISFIT: "tick for a wrong frame (strict)",
    SyncEvent.COMMAND: "command for a frame",
    SyncEvent.COMMAND_TOO_FAR: "command too many frames ahead",
    SyncEvent.COMMAND_TOO_MANY: "command while too many wait",
    SyncEvent.PAUSE: "pause",
    SyncEvent.RESUME: "resume",
    SyncEvent.LOSS_TO_RUN: "master lost (on loss: run)",
    SyncEvent.LOSS_TO_PAUSE: "master lost (on loss: pause)",
    SyncEvent.LOSS_TO_WAIT: "master lost (on loss: wait)",
    SyncEvent.TICK_EARLY: "tick that needs a load that is still read; steps",
    SyncEvent.TURN: "turn of the first tick that waits",
    SyncEvent.LAST_DONE: "last tick that waits is done or given up",
    SyncEvent.RESET: "reset",
}
"""Each event in words. Where there is no master, every id is another id."""

Edge = tuple[SyncState, SyncState]


def list_edges() -> dict[Edge, list[SyncEvent]]:
    """Return the pairs of different states that some event leads between, with these events."""
    edges: dict[Edge, list[SyncEvent]] = {}
    for state, outcomes in SYNC_TABLE.items():
        for event, outcome in outcomes.items():
            if outcome.state is not state:
                edges.setdefault((state, outcome.state), []).append(event)
    return edges


def draw_states() -> str:
    """Return the state diagram as SVG: an arrow for each edge, with its number in `write_table`."""
    arrows: list[str] = []
    badges: list[str] = []
    for number, edge in enumerate(list_edges(), 1):
        start, end = (MIDDLES[state] for state in edge)
        bend = beside(start, end, BENDS.get(edge, USUAL_BEND))
        begin, finish = border(start, bend), border(end, bend)
        arrows.append(arrow(begin, finish, bend))
        badges.append(badge(quadratic_point(begin, bend, finish, BADGE_AT), number))
    starts = [
        *(arrow((24, 186), (60, 222)), text((20, 178), "--start run", size=12, anchor="start")),
        *(arrow((290, 30), (340, 62)), text((230, 24), "--start sync", size=12, anchor="start")),
    ]
    boxes = [
        box(
            (x - SIZE[0] / 2, y - SIZE[1] / 2),
            SIZE,
            [state.name, MEANINGS[state]],
            **({"fill": PAUSED_FILL} if state.name.endswith("PAUSED") else {}),
        )
        for state, (x, y) in MIDDLES.items()
    ]
    title = "States of synchronous mode; the numbers stand in the table below the picture"
    return document(960, 740, title, [*arrows, *starts, *boxes, *badges])


def beside(start: Point, end: Point, distance: float) -> Point:
    """Return the control point of a curve whose middle lies so far to the right of the straight line."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    return (start[0] + end[0]) / 2 - 2 * distance * dy / length, (start[1] + end[1]) / 2 + 2 * distance * dx / length


def border(middle: Point, towards: Point) -> Point:
    """Return where the line from the middle of a box towards a point leaves the box."""
    dx, dy = towards[0] - middle[0], towards[1] - middle[1]
    shares = [half / abs(way) for half, way in ((SIZE[0] / 2, dx), (SIZE[1] / 2, dy)) if way]
    share = min(shares)
    return middle[0] + share * dx, middle[1] + share * dy


def badge(at: Point, number: int) -> str:
    """Return a number in a circle."""
    return (
        f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="11" fill="{PAPER}" stroke="{INK}"/>'
        f"{text((at[0], at[1] + 4), str(number), size=12)}"
    )


def write_table() -> str:
    """Return the page with the picture's legend and with every outcome of the table."""
    lines = [
        "# Table of synchronous mode",
        "",
        "Generated by `scripts/write_docs.py` from the table that runs, `rosbridge_sim/simulator/sync/sync_table.py`.",
        "[Synchronous mode](synchronous_mode.md) explains the states.",
        "",
        "![States of synchronous mode](../images/sync_mode.svg)",
        "",
        "## Arrows of the picture",
        "",
        "| number | from | to | event |",
        "|---|---|---|---|",
    ]
    for number, ((start, end), events) in enumerate(list_edges().items(), 1):
        lines.append(f"| {number} | {start.name} | {end.name} | {'; '.join(EVENTS[event] for event in events)} |")
    lines += [
        "",
        "## Every event in every state",
        "",
        "*Effects* in the order in which they happen: `lead` and `release` change the master, `queue` keeps a command",
        "for its frame, `drop` forgets waiting commands, `move` computes frames, `wait` keeps a tick, `refuse` refuses",
        "the ticks that wait, `flow` starts real time again, `announce` publishes `/SyncModeInfo`.",
        "",
    ]
    for state, outcomes in SYNC_TABLE.items():
        lines += [
            f"### {state.name}",
            "",
            "| event | answer | next state | effects, or reason of the refusal |",
            "|---|---|---|---|",
        ]
        for event, outcome in outcomes.items():
            more = ", ".join(effect.value for effect in outcome.effects) or outcome.why or "none"
            answer = "yes" if outcome.is_accepted else "no"
            lines.append(f"| {EVENTS[event]} | {answer} | {outcome.state.name} | {more} |")
        lines.append("")
    return "\n".join(lines)
