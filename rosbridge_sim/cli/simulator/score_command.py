"""`score`: what the driver of each ego is judged by, once or as it changes."""

from __future__ import annotations

from rosbridge_sim.cli.tools.text import note, put, put_json
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, frames_in
from rosbridge_sim.cli.tools.tool_subscription import Listener
from rosbridge_sim.link.terminal_text import safe

SCORE = "/sim/score"
"""Name of the service and of the topic."""

FOLLOW_MS = 1_000
"""Between two lines of an ego [ms]: as fast as a person reads them."""

LINES = (
    ("distance", "distance", "m"),
    ("collisions", "collisions", ""),
    ("red lights", "red_lights", ""),
    ("stop lines", "stop_lines", ""),
    ("lane invasions", "lane_invasions", ""),
    ("off the road", "off_road_time", "s"),
)
"""Title, field and unit of the totals."""

NOW_AND_MOST = (
    ("time to collision", "time_to_collision", "min_time_to_collision", "", "s"),
    ("from lane's middle", "lane_offset", "max_lane_offset", "mean_lane_offset", "m"),
    ("jerk", "jerk", "max_jerk", "rms_jerk", "m/s^3"),
    ("lateral acceleration", "lateral_accel", "max_lateral_accel", "rms_lateral_accel", "m/s^2"),
)
"""Title, field of now, of the extreme and of the mean, and unit."""


async def show(bridge: Bridge, *, is_reset: bool, is_json: bool) -> None:
    """Show the scores of all egos.

    Args:
        is_reset: begin all counts anew afterwards.

    Raises:
        RefusedError: the simulator says no, or there is none.
        BridgeError: there is no answer.
    """
    values = await bridge.request(SCORE, {"reset": is_reset})
    if is_json:
        put_json(values)
        return
    if values.get("message"):
        note(str(values["message"]))
    for score in frames_in(values, "scores"):
        _put_score(score)
    _put_verdict(values)


async def follow(bridge: Bridge, count: int | None, *, is_json: bool) -> None:
    """Show the scores of all egos as they change, once a second at most.

    Args:
        count: of messages; None for no end.
        is_json: show messages as they are, one a line.

    Raises:
        RefusedError: there is no such topic.
    """
    listener = await Listener.open(bridge, SCORE, None, throttle_ms=FOLLOW_MS)
    num_left = count
    while num_left != 0:
        msg = await listener.expect(None)
        if is_json:
            put_json(msg)
        else:
            for score in frames_in(msg, "scores"):
                put(_line(score))
            _put_verdict(msg)
        if num_left is not None:
            num_left -= 1


def _put_score(score: Frame) -> None:
    put(f"ego {_text(score, 'unique_id')}, since frame {_text(score, 'since_frame')}")
    for title, field, unit in LINES:
        ids = score.get("collision_ids") if field == "collisions" else None
        more = f"  the last with {safe(', '.join(map(str, ids)))}" if isinstance(ids, list) and ids else ""
        put(f"  {title:20}  {_text(score, field)}{f' [{unit}]' if unit else ''}{more}")
    for title, now, most, mean, unit in NOW_AND_MOST:
        least = "least" if now == "time_to_collision" else "most"
        parts = [f"now {_text(score, now)}", f"{least} {_text(score, most)}"]
        if mean:
            parts.append(f"{'rms' if mean.startswith('rms') else 'mean'} {_text(score, mean)}")
        put(f"  {title:20}  {', '.join(parts)} [{unit}]")


def _put_verdict(values: Frame) -> None:
    """Show the verdict of a story, if it has an evaluation."""
    verdict = values.get("verdict")
    if not isinstance(verdict, dict) or not verdict.get("result"):
        return
    result, group, reason = (safe(str(verdict.get(key))) for key in ("result", "group", "reason"))
    put(f"story: {result}" + (f" at {_text(verdict, 'time')} s: {group}: {reason}" if verdict.get("group") else ""))


def _line(score: Frame) -> str:
    """Return a line about one ego."""
    counts = "  ".join(f"{title} {_text(score, field)}{f' {unit}' if unit else ''}" for title, field, unit in LINES)
    ttc = _text(score, "time_to_collision")
    return f"ego {_text(score, 'unique_id')}  {counts}  time to collision {ttc}{'' if ttc == 'none' else ' s'}"


def _text(score: Frame, field: str) -> str:
    """Return a figure for a person."""
    value = score.get(field)
    if isinstance(value, float):
        return "none" if value < 0.0 and field.endswith("time_to_collision") else f"{value:.3f}"
    return safe(str(value)) if isinstance(value, (int, str)) else "?"
