"""Stop signals that come while a server starts."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support import PATIENCE, ROOT

START = """
import os, signal, sys, weakref

class Thing:
    pass

def kill():
    os.kill(os.getpid(), signal.SIGTERM)
    for _ in range(1000):
        pass  # here the handler runs

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "rosbridge_sim.shell.app":
            WAY

sys.meta_path.insert(0, Finder())
from rosbridge_sim.serving import serve
sys.exit(serve(["--port", "0"]))
"""
IN_CALLBACK = "thing = Thing(); reference = weakref.ref(thing, lambda _: kill()); del thing"


@pytest.mark.slow
@pytest.mark.parametrize(("way", "num_lines"), [("kill()", 0), (IN_CALLBACK, 1)])
def test_signal_during_the_start_ends_a_server(way: str, num_lines: int) -> None:
    code = START.replace("WAY", way)
    program = [sys.executable, "-c", code]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert done.returncode == 0
    assert done.stdout.count("listening on") == num_lines  # the interpreter has dropped the end of the start
