"""The first op of a small frame, read without its bodies: all that is decoded for a client without a token.

The normal reader (`json_decoding.py`) joins fragments, decompresses PNG images, reads CBOR and accepts frames of
megabytes. A client that has not sent its token gets none of that. Only a few kilobytes of plain JSON are decoded, with
types, and all fields but five are skipped.
"""

from __future__ import annotations

import msgspec
import orjson

from rosbridge_sim.protocol.json_decoding import end_of_value
from rosbridge_sim.protocol.json_encoding import op_frame, response_frame, status_frame
from rosbridge_sim.protocol.ops import Id
from rosbridge_sim.protocol.roslibpy_status import is_id_of_roslibpy, roslibpy_status_frame

MAX_SMALL = 4 * 1024
"""A longer frame is not decoded [bytes]. A token and an id need some hundred bytes, a JSON web token at most two
thousand."""

_ROS2_UNKNOWN = 0
"""`status` in an action's result if the goal was never accepted (action_msgs/GoalStatus)."""


class FirstOp(msgspec.Struct, frozen=True):
    """The fields of an op that name it or hold a token; others are not read.

    Attributes:
        op: name of the op.
        id: id to repeat in an answer.
        token: token of an `auth` op.
        service, action: called service or action, if the op waits for an answer.
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
        frame: content of a text or binary frame.

    Returns:
        The op, and the bytes behind it; None if the frame is long or does not begin with a plain JSON op.
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


def refusal_frame(op: FirstOp | None, why: str, *, may_be_roslibpy: bool = False) -> bytes:
    """Return the answer to an op that is refused. A call and a goal get their own kind of answer, other ops a status.

    Args:
        op: the refused op; None if it could not be read.
        why: reason, for people.
        may_be_roslibpy: the client gets `roslibpy_status_frame` if the op is one of roslibpy.
    """
    if op is None:
        return status_frame("error", why, None)
    if op.op == "call_service" and op.service is not None:
        op_id = op.id
        if op_id is None and "#" in op.service:  # old form of a call: `service#id`
            op_id = op.service.partition("#")[2]
        return response_frame(op.service, orjson.dumps(why), is_ok=False, op_id=op_id)
    if op.op == "send_action_goal" and op.action is not None:
        fields = {"action": op.action, "id": op.id, "status": _ROS2_UNKNOWN, "result": False, "values": why}
        return op_frame("action_result", {}, **fields)
    is_roslibpy = may_be_roslibpy and is_id_of_roslibpy(op.op, op.id)
    return (roslibpy_status_frame if is_roslibpy else status_frame)("error", why, op.id)
