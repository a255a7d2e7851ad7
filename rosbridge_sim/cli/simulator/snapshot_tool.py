"""`snapshot` and `restore`: save the state of a simulator, list what is saved, and go back to it."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Sequence
from pathlib import Path

from rosbridge_sim.cli.tools.text import put, put_json, put_table, show
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, frames_in
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.link.bridge_errors import BridgeError, RefusedError
from rosbridge_sim.link.terminal_text import safe

SUFFIX = ".rbsim"
"""Suffix of snapshots' files: what ends with it is no name that the server keeps."""


async def take_snapshot(bridge: Bridge, name: str, path: Path | None, *, is_json: bool) -> None:
    """Save the state of a simulator, there and perhaps in a file here.

    Args:
        name: of the snapshot; empty lets the server choose.
        path: of a file for its bytes; None for none.
        is_json: show the answer as it is, without the bytes.

    Raises:
        RefusedError: the simulator says no, or there is none.
        BridgeError: there is no answer.
        DocumentError: the file cannot be written.
    """
    answer = await _ask(bridge, "/sim/snapshot", {"id": name, "with_data": path is not None})
    data = answer.pop("data", "")
    if path is not None:
        _write(path, str(data))
    if is_json:
        put_json(answer)
    else:
        where = "" if path is None else f"  file {safe(str(path))}"
        put(f"snapshot {safe(str(answer.get('id')))}  {_describe(answer)}{where}")


async def list_snapshots(bridge: Bridge, remove: Sequence[str], *, is_json: bool) -> None:
    """Show the snapshots that a simulator keeps, after some were removed.

    Raises:
        RefusedError: the simulator says no, or there is none.
        BridgeError: there is no answer.
    """
    answer = await _ask(bridge, "/sim/snapshots", {"remove": list(remove)})
    rows = frames_in(answer, "snapshots")
    if is_json:
        put_json(rows)
    else:
        columns = ("id", "frame", "size", "state_hash")
        put_table(
            ("ID", "FRAME", "BYTES", "STATE HASH"), [[safe(str(row.get(key))) for key in columns] for row in rows]
        )


async def restore(bridge: Bridge, name: str, user_id: str, *, is_json: bool) -> None:
    """Return a simulator to a snapshot that it keeps, or to one in a file here.

    Args:
        name: of the snapshot, or the path of a file.
        user_id: of the master, in synchronous mode.

    Raises:
        RefusedError: the simulator says no, or there is none.
        BridgeError: there is no answer.
        DocumentError: the file cannot be read.
    """
    answer = await _ask(bridge, "/sim/restore", {"user_id": user_id} | _read(name))
    show(answer, f"restored  {_describe(answer)}", is_json=is_json)


def _write(path: Path, text: str) -> None:
    try:
        path.write_bytes(base64.b64decode(text))
    except OSError as error:
        raise DocumentError(f"--out: {path} cannot be written: {error.strerror}") from None
    except binascii.Error:
        raise BridgeError("/sim/snapshot: expected base64 in `data`") from None


def _read(name: str) -> Frame:
    """Return the part of a request that says which snapshot is meant: a file's bytes, or a name."""
    path = Path(name)
    if not (path.suffix == SUFFIX or path.name != name or path.is_file()):
        return {"id": name}
    try:
        return {"data": base64.b64encode(path.read_bytes()).decode()}
    except OSError as error:
        raise DocumentError(f"{path}: the snapshot cannot be read: {error.strerror}") from None


def _describe(answer: Frame) -> str:
    size = answer.get("size")
    bytes_text = f"  {size:,} bytes" if isinstance(size, int) else ""
    return f"frame {answer.get('frame')}  hash {safe(str(answer.get('state_hash')))}{bytes_text}"


async def _ask(bridge: Bridge, service: str, request: Frame) -> Frame:
    """Return the values of a service of ours.

    Raises:
        RefusedError: it refuses, or is not there.
        BridgeError: there is no answer.
    """
    values = await bridge.request(service, request)
    if values.get("result") is not True:
        raise RefusedError(f"{service}: {safe(str(values.get('message')))}")
    return values
