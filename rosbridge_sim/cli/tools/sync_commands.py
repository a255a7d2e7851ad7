"""`sync`, `tick`, `step`: use synchronous mode from a shell; and the reason for a silent topic, often this mode."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from rosbridge_sim.cli.tools.text import put, put_json, show
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, frames_in, words
from rosbridge_sim.link.bridge_errors import BridgeError, RefusedError
from rosbridge_sim.link.terminal_text import safe

SYNC_INFO = "/SyncModeInfo"

BARRIER = "/sim/barrier"
"""Latched state of the barrier, and the master's id while one leads."""

PROCESS = "/sim/process/state/msg/MoraiSimProcStatus"
"""Latched state of the simulation, running or paused, which `/SyncModeInfo` does not contain."""

_REPLAY, _PAUSED, _ENDED = 16, 16, 32
"""Values of its fields `current_mode` and `current_status`."""

RESUME = "rosbridge-sim service call /Service_MoraiEventCmd '{request: {option: 8}}' resumes it"
"""Advice for a paused simulation; option 8 is the bit of `set_pause`, which is false if it is left out."""

INFO_PATIENCE = 1.0
"""Longest wait for a latched state [s]; a server that has it sends it at once."""

FRAME_MS = 20
"""Simulated time of one frame of MORAI SIM [ms]; a tick is a multiple of it."""


# The state of synchronous mode


@dataclass(frozen=True, slots=True)
class ModeInfo:
    """State of synchronous mode, from `/SyncModeInfo`.

    Attributes:
        master_id: user id of the master; empty if there is none.
        is_on: synchronous mode is on.
        frame: frame number of the simulation.
        can_send_tick: a tick of the master would be done now.
    """

    master_id: str
    is_on: bool
    frame: int
    can_send_tick: bool


async def read_sync_info(bridge: Bridge) -> ModeInfo | None:
    """Return the state of synchronous mode; None without a simulator. Other frames that come meanwhile are ignored."""
    msg = await _read_latched(bridge, SYNC_INFO)
    if msg is None:
        return None
    return ModeInfo(
        str(msg.get("master_id", "")),
        msg.get("status") is True,
        _whole(msg.get("frame")),
        msg.get("can_send_tick") is True,
    )


async def _read_latched(bridge: Bridge, topic: str) -> Frame | None:
    """Return the latched message of a topic; None if there is none. Other frames that come meanwhile are ignored."""
    try:
        kind = str((await bridge.ask("topic_type", topic=topic)).get("type", ""))
    except (BridgeError, RefusedError):
        return None
    if not kind:
        return None
    await bridge.send("subscribe", topic=topic, type=kind)
    until = bridge.now() + min(INFO_PATIENCE, bridge.patience)
    try:
        while (frame := await bridge.receive(until)) is not None:
            msg = frame.get("msg")
            if frame.get("op") == "publish" and absolute(str(frame.get("topic"))) == topic and isinstance(msg, dict):
                return msg
    finally:
        await bridge.send("unsubscribe", topic=topic)
    return None


def _whole(value: object) -> int:
    return value if isinstance(value, int) else 0


async def why_silent(bridge: Bridge, topic: str, patience: float) -> RefusedError:
    """Return the error that no message came in time, with the cause if the server tells it.

    Args:
        topic: absolute name of the topic.
        patience: time that was waited [s].
    """
    text = f"no message on {safe(topic)} within {patience:g} s"
    try:
        publishers = words(await bridge.ask("publishers", topic=topic), "publishers")
    except (BridgeError, RefusedError):
        return RefusedError(f"{text}; --timeout waits longer")
    if not publishers:
        return RefusedError(f"{text}: it has no publisher")
    return RefusedError(f"{text}{await why_standing(bridge) or '; --timeout waits longer'}")


async def why_standing(bridge: Bridge) -> str:
    """Return why the world does not move, for the end of an error; empty if that is not known."""
    info = await read_sync_info(bridge)
    if info is None:
        return ""
    process = await _read_latched(bridge, PROCESS) or {}
    status = process.get("current_status")
    if status == _ENDED:
        return ": the world is paused at the end of a replay; stop or play it again by /Morai_SimProc"
    if not info.is_on:
        what = "a replay" if process.get("current_mode") == _REPLAY else "the world"
        return f": {what} is paused; {RESUME}" if status == _PAUSED else ""
    leader = f"the master {safe(info.master_id)!r}" if info.master_id else ""
    if status == _PAUSED or (leader and not info.can_send_tick):
        return f": the world is paused, in synchronous mode with {leader or 'no master'}; {RESUME}"
    if not leader:
        return ": the world stands until a master ticks, and there is no master; rosbridge-sim tick N --start moves it"
    members = "; rosbridge-sim sync shows the members of the barrier" if info.master_id == BARRIER else ""
    return f": the world stands until a master ticks; the master is {safe(info.master_id)!r}{members}"


# sync


async def show_sync(bridge: Bridge, *, is_json: bool) -> None:
    """Show the state of synchronous mode, and the members of the barrier if there is one.

    Args:
        is_json: show both messages as they are; `barrier` is null where there is none.

    Raises:
        RefusedError: there is no simulator.
    """
    info = await _read_latched(bridge, SYNC_INFO)
    if info is None:
        raise RefusedError(f"no message on {SYNC_INFO}; is a simulator there?")
    barrier = await _read_latched(bridge, BARRIER)
    if barrier is not None and not barrier.get("members"):
        barrier = None
    if is_json:
        put_json({"sync": info, "barrier": barrier})
        return
    frame = _whole(info.get("frame"))
    master = str(info.get("master_id", ""))
    if info.get("status") is not True:
        put(f"synchronous mode is off, frame {frame}")
    elif not master:
        put(f"synchronous mode is on, frame {frame}: there is no master; rosbridge-sim tick N --start moves the world")
    elif barrier is None:
        put(f"synchronous mode is on, frame {frame}: the master is {safe(master)!r}")
    else:
        put(f"synchronous mode is on, frame {frame}: a barrier leads, {_describe_terms(barrier)}")
    if barrier is not None:
        for line in _describe_members(barrier):
            put(line)


def _describe_terms(barrier: Frame) -> str:
    deadline = barrier.get("deadline_s")
    text = f"{deadline:g}" if isinstance(deadline, (int, float)) else "?"
    paused = ", paused" if barrier.get("is_paused") is True else ""
    return f"{_whole(barrier.get('time_step'))} ms a tick, deadline {text} s{paused}"


def _describe_members(barrier: Frame) -> list[str]:
    """Return a line for each member: what it does, and how often it was late."""
    members, counts = _list(barrier, "members"), _list(barrier, "late_counts")
    states = {"waited_for": "is waited for", "ticked": "has ticked", "joining": "joins", "leaving": "leaves"}
    lines: list[str] = []
    for i, member in enumerate(members):
        does = [text for key, text in states.items() if member in _list(barrier, key)] or ["rests"]
        num = _whole(counts[i]) if i < len(counts) else 0
        times = "once" if num == 1 else f"{num} times"
        lines.append(f"  {safe(str(member))}  {', '.join(does)}" + (f"; was late {times}" if num else ""))
    return lines


def _list(frame: Frame, key: str) -> list[object]:
    value = frame.get(key)
    return value if isinstance(value, list) else []


# tick


async def tick(bridge: Bridge, count: int, user_id: str, step_ms: int, *, is_starting: bool, is_json: bool) -> None:
    """Move the world by some ticks, and print the frame and the ego after each.

    With `is_starting`, synchronous mode is started first, and ended afterwards if it was off before. If it was on
    without a master, only the connection is closed, and the server's `--sync-on-loss` applies.

    Args:
        bridge: the rosbridge of the simulator.
        step_ms: simulated time of a tick, if the mode is started here [ms].
        is_json: print each answer as a line of JSON.

    Raises:
        RefusedError: the simulator refuses, or there is none.
        BridgeError: there is no answer.
    """
    async with _leading(bridge, user_id, step_ms if is_starting else None) as first:
        frame = first
        for _ in range(count):
            request = {"user_id": user_id, "frame": frame + step_ms // FRAME_MS}
            response = await _ask(bridge, "/SyncModeWaitForTick", request)
            if response.get("tick_status") is not True:
                raise await _refusal(bridge, "the tick is refused", user_id)
            frame = _whole(response.get("frame"))
            show(response, _describe(response), is_json=is_json)


@asynccontextmanager
async def _leading(bridge: Bridge, user_id: str, step_ms: int | None) -> AsyncIterator[int]:
    """Have the server tell why it refuses and, if that is wanted, be master of synchronous mode meanwhile.

    Args:
        step_ms: start the mode with this time step [ms]; None for the mode as it is.

    Yields:
        The frame that the world stands at.

    Raises:
        RefusedError: the mode cannot be started.
        BridgeError: there is no answer.
    """
    before = await read_sync_info(bridge)
    await bridge.send("set_level", level="warning")  # why a simulator says no is one
    frame, has_started = (0, False) if before is None else (before.frame, False)
    try:
        if step_ms is not None:
            response = await _command(bridge, user_id, step_ms, is_on=True)
            if response.get("result") is not True:
                raise await _refusal(bridge, "synchronous mode cannot be started", user_id)
            has_started = before is None or not before.is_on
            frame = _whole(response.get("frame"))
        yield frame
    finally:
        if has_started:
            await _command(bridge, user_id, step_ms or FRAME_MS, is_on=False)


# step


async def step(bridge: Bridge, request: Frame, step_ms: int | None, *, is_json: bool) -> None:
    """Move the world by one call of `/sim/step`, and show frame, steps, ego and topics.

    Args:
        step_ms: start synchronous mode with this time step [ms]; None for the mode as it is.

    Raises:
        RefusedError: the simulator says no, there is none, or the call was interrupted.
        BridgeError: there is no answer.
    """
    user_id = str(request["user_id"])
    async with _leading(bridge, user_id, step_ms):
        response = await _ask(bridge, "/sim/step", request)
        num = _whole(response.get("steps"))
        if is_json and num:
            put_json(response)
        elif num:
            _show_steps(response)
        if response.get("result") is not True:
            what = f"interrupted after {num} steps" if num else "the step is refused"
            reason = str(response.get("message") or "")
            raise await _refusal(bridge, what, user_id, reason)


def _show_steps(response: Frame) -> None:
    """Show what a call of `/sim/step` has answered."""
    why = str(response.get("stopped_by") or "")
    put(
        f"frame {_whole(response.get('frame'))}  steps {_whole(response.get('steps'))}"
        f"{f'  stopped by {safe(why)}' if why else ''}"
    )
    for ego in frames_in(response, "egos"):
        put(f"ego {_whole(ego.get('unique_id'))}  {_describe_ego(ego)}")
    for sample in frames_in(response, "topics"):
        text = str(sample.get("message") or "(no message)")
        put(f"{safe(str(sample.get('topic')))}  {safe(text)}")


async def _command(bridge: Bridge, user_id: str, step_ms: int, *, is_on: bool) -> Frame:
    request = {"user_id": user_id, "start_sync_mode": is_on, "time_step": step_ms}
    return await _ask(bridge, "/SyncModeCmd", request)


async def _ask(bridge: Bridge, service: str, request: Frame) -> Frame:
    """Return the response of a service; the services of MORAI wrap request and response.

    Raises:
        RefusedError: it refuses, or does not exist.
        BridgeError: there is no answer.
    """
    is_ours = service.startswith("/sim/")
    values = await bridge.request(service, request if is_ours else {"request": request})
    response = values if is_ours else values.get("response")
    return response if isinstance(response, dict) else {}


async def _refusal(bridge: Bridge, what: str, user_id: str, reason: str = "") -> RefusedError:
    """Return the error of a refused start or tick: the server's reason, who is master, and what to do.

    Args:
        reason: where the answer has it; else it is in a status frame.
    """
    statuses = [frame for frame in bridge.take_inbox() if frame.get("op") == "status"]
    reasons = [str(frame.get("msg")) for frame in statuses if frame.get("level") in {"warning", "error"}]
    reason = reason or (reasons[-1] if reasons else "")
    text = what + (f": {safe(reason)}" if reason else "")
    info = await read_sync_info(bridge)
    if info is None:
        return RefusedError(text)
    if not info.is_on or not info.master_id:
        return RefusedError(f"{text}; --start starts the mode")
    if info.master_id == user_id:
        return RefusedError(text if info.can_send_tick else f"{text}; {RESUME}")
    if info.master_id == BARRIER:
        return RefusedError(f"{text}; rosbridge-sim sync shows the members of the barrier")
    master = safe(info.master_id)
    named = "" if repr(info.master_id) in text else f"; the master is {master!r}"
    return RefusedError(f"{text}{named}; --id {master} ticks in its name")


def _describe(response: Frame) -> str:
    """Return a line about frame and ego."""
    status = response.get("vehicle_status")
    ego: Frame = status if isinstance(status, dict) else {}
    return f"frame {_whole(response.get('frame'))}  time {safe(str(response.get('time', '?')))} s  {_describe_ego(ego)}"


def _describe_ego(ego: Frame) -> str:
    """Return an ego's place, heading and speed as text."""
    x, y, z = (_number(ego.get("position"), axis) for axis in "xyz")
    heading, speed = _number(ego, "heading"), _number(ego.get("velocity"), "x")
    return f"x {x:.3f}  y {y:.3f}  z {z:.3f} m  heading {heading:.2f} deg  speed {speed:.3f} m/s"


def _number(value: object, key: str) -> float:
    number = value.get(key) if isinstance(value, dict) else None
    return float(number) if isinstance(number, (int, float)) else float("nan")
