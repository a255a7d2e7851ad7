"""Status frames for roslibpy, which cannot read them.

For a `status` roslibpy logs a traceback that ends with `No handler registered for operation "status"`, and not the text
of the frame (1.8 to 2.1, `comm/comm.py`). It quotes the op of each frame that it cannot read. So the text goes into the
op: `No handler registered for operation "status error: Message type ..."`.
A client is known as roslibpy by two signs together: a handshake of Autobahn, and ids as roslibpy makes them
(`core.py`). A client that has sent `set_level` has said that it reads `status` frames, and gets those.
"""

from __future__ import annotations

from typing import Final

from rosbridge_sim.printable import printable
from rosbridge_sim.protocol.json_encoding import op_frame
from rosbridge_sim.protocol.ops import Id

OPS_WITH_ID: Final = frozenset({"advertise", "publish", "subscribe", "call_service", "send_action_goal"})
"""Ops to which roslibpy gives an id of its own, in each of its versions."""


def is_id_of_roslibpy(op: str, op_id: Id) -> bool:
    """Return True if an id has the form of roslibpy's: op, name and number, such as `publish:/ctrl_cmd:3`."""
    head, _, number = op_id.rpartition(":") if isinstance(op_id, str) else ("", "", "")
    return head.startswith(f"{op}:") and number.isdecimal()


def roslibpy_status_frame(level: str, text: str, op_id: object) -> bytes:
    """Return a frame that makes roslibpy log a text.

    Args:
        level: `info`, `warning` or `error`.
    """
    return op_frame(f"status {level}: {printable(text)}", {}, level=level, id=op_id)
