"""The first op of a small frame, read without its bodies: all that is decoded for a client without a token.

The session's own reader (`codec.py`) joins pieces, inflates pictures and reads CBOR, and it takes frames of megabytes.
A client that has not shown its token gets none of that: one typed decode of a few kilobytes of plain JSON, which skips
every field but five.
"""

from __future__ import annotations

import msgspec
import orjson

from rosbridge_sim.protocol.codec import end_of_value, op_frame, response_frame, status_frame
from rosbridge_sim.protocol.ops import Id

__all__ = ["MAX_SMALL", "FirstOp", "read_first_op", "refusal_frame"]

MAX_SMALL = 4 * 1024
"""A longer frame is not decoded [bytes]: a token and an id are some hundred, a JSON web token at most two thousand."""

_ROS2_UNKNOWN = 0
"""`status` of an action's result where the goal was never taken (action_msgs/GoalStatus)."""


class FirstOp(msgspec.Struct, frozen=True):
    """An op of which only what names it and what shows a token was read.

    Attributes:
        op: its name.
        id: to be repeated in an answer.
        token: what an `auth` shows.
        service, action: what it asks, if it waits for an answer.
    """

    op: str
    id: Id = None
    token: str | None = None
    service: str | None = None
    action: str | None = None


_decode = msgspec.json.Decoder(FirstOp).decode


def read_first_op(frame: bytes) -> tuple[FirstOp, bytes] | None:
    """Read the first JSON object of a small frame. Never raises.

    Args:
        frame: what came, of a text or of a binary frame.

    Returns:
        The op, and what is glued behind it; None where the frame is long or does not begin with a plain JSON op.
    """
    if len(frame) > MAX_SMALL:
        return None
    try:
        return _decode(frame), b""
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        end = end_of_value(error)
    if end is None:
        return None
    try:
        return _decode(frame[:end]), frame[end:]
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None


def refusal_frame(op: FirstOp | None, why: str) -> bytes:
    """Write the answer to an op that is not done: a call and a goal get theirs, everything else a status.

    Args:
        op: what was asked; None where it could not be read.
        why: for people to read.
    """
    if op is None:
        return status_frame("error", why, None)
    if op.op == "call_service" and op.service is not None:
        op_id = op.id
        if op_id is None and "#" in op.service:  # an old form has both in one: `service#id`
            op_id = op.service.partition("#")[2]
        return response_frame(op.service, orjson.dumps(why), is_ok=False, op_id=op_id)
    if op.op == "send_action_goal" and op.action is not None:
        fields = {"action": op.action, "id": op.id, "status": _ROS2_UNKNOWN, "result": False, "values": why}
        return op_frame("action_result", {}, **fields)
    return status_frame("error", why, op.id)
