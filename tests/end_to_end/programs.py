"""Runs the programs of `clients/`: each talks through a released client library and says what it saw in JSON."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from tests import fork_server
from tests.cpu_time import communicate
from tests.fork_server import ForkedProgram
from tests.support import ROOT, require_node_modules, require_tool

__all__ = ["LIBRARIES", "finish", "is_python", "start"]

CLIENTS = Path(__file__).parent / "clients"

LIBRARIES = ("roslibpy-twisted", "roslibpy-asyncio", "roslib2", "roslib1")
"""The client libraries; roslibpy by each of its transports."""


def is_python(library: str) -> bool:
    """Whether a library is Python's."""
    return library.startswith("roslibpy")


def start(library: str, subject: str, port: int, *words: str) -> subprocess.Popen[str] | ForkedProgram:
    """Start the program on a subject that uses a library.

    Args:
        library: one of LIBRARIES, or `lichtblick` for the fork that Lichtblick uses.
        subject: what the program is about: its file's name in `clients/`.
        port: of the server.
        words: the program's own arguments.
    """
    if is_python(library):
        module = f"tests.end_to_end.clients.{subject}"
        transport = library.partition("-")[2]
        return fork_server.popen(["-m", module, transport, port, *words], stdin=subprocess.PIPE)
    require_node_modules()
    package = {"roslib2": "roslib", "lichtblick": "@lichtblick/roslibjs"}.get(library, library)
    command = [require_tool("node"), str(CLIENTS / f"{subject}.mjs"), package]
    pipe = subprocess.PIPE
    return subprocess.Popen([*command, str(port), *words], cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe, text=True)


def finish(process: subprocess.Popen[str] | ForkedProgram) -> dict[str, Any]:
    """What a program said last, once it has ended well; its stdin ends, which tells one that serves to go."""
    with process:
        out, err = communicate(process)
    assert process.returncode == 0, f"the client ended with {process.returncode}:\n{out}\n{err}"
    seen: dict[str, Any] = json.loads(out.splitlines()[-1]) if out.strip() else {}
    return seen
