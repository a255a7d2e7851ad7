"""Random ops of several clients beside an honest one: the short sibling of `scripts/soak/fuzz.py`."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.soak.fuzz import Report, fuzz, replay
from scripts.soak.fuzz_frames import Act
from scripts.soak.fuzz_server import CONFIGURATIONS, make_data, serving
from scripts.soak.fuzz_tape import Tape


@pytest.mark.slow
@pytest.mark.parametrize("name", ["town", "attached"])
async def test_honest_client_is_not_affected_by_fuzzing_clients(tmp_path: Path, name: str) -> None:
    (configuration,) = (one for one in CONFIGURATIONS if one.name == name)
    make_data(tmp_path, seed=0, has_recordings=False)
    report = Report()
    with serving(configuration, tmp_path) as server:
        await fuzz(server, Tape(configuration), report, seed="0", num_clients=3, visits=3)
    assert report.num["visits"] == 9
    assert report.innocent[0]["calls"] > 0


def test_recorded_fuzz_round_reads_back_as_written(tmp_path: Path) -> None:
    tape = Tape(CONFIGURATIONS[1])
    tape.add(7, Act("binary", b"\xa1\x61a\x01"))
    tape.add(8, Act("text", b"{}"))
    tape.write(tmp_path / "tape.jsonl")
    assert Tape.read(tmp_path / "tape.jsonl") == tape


@pytest.mark.slow
async def test_replayed_clients_make_their_honest_call_too(tmp_path: Path) -> None:
    (configuration,) = (one for one in CONFIGURATIONS if one.name == "demo")
    make_data(tmp_path, seed=0, has_recordings=False)
    tape, report = Tape(configuration), Report()
    for client in (0, 1, 0, 2):
        tape.add(client, Act("text", b'{"op":"nonsense"}'))
    tape.add(2, Act("binary", b"\xff"))
    tape.add(3, Act("part", b"\x81\x85"))
    tape.add(3, Act("text", b"{}"))
    with serving(configuration, tmp_path) as server:
        await replay(server, tape, report)
    assert report.num["honest calls answered"] == 3, "of 0, 1 and 2; 3 leaves within a frame"
