"""`snapshot` and `restore` over a real socket, and the methods of the client."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.client import Client, ServiceRefusedError
from tests.cli.tool_fixture import run
from tests.support import PATIENCE


@pytest.fixture
def sim() -> Iterator[Simulator]:
    with Simulator(port=0, start="sync") as simulator:
        yield simulator


@pytest.fixture
def client(sim: Simulator) -> Iterator[Client]:
    with Client(sim.url, timeout=PATIENCE) as client:
        client.start_sync(user_id="rosbridge-sim")
        yield client


def test_client_goes_back_and_forth(client: Client) -> None:
    client.tick(5)
    saved = client.snapshot("a", with_data=True)
    assert (saved.name, saved.frame, saved.state_hash) == ("a", 5, client.state_hash())
    later = client.tick(10)
    for which in (saved, "a", saved.data):
        assert client.restore(which) == 5
        assert client.next_frame == 6
        assert client.state_hash() == saved.state_hash
        assert client.tick(10) == later
    assert [one.name for one in client.snapshots()] == ["a"]
    assert client.snapshots(remove=["a"]) == []
    with pytest.raises(ServiceRefusedError, match="no snapshot 'a'"):
        client.restore("a")


def test_snapshot_in_a_file_restores_into_another_server(sim: Simulator, client: Client, tmp_path: Path) -> None:
    client.tick(7)
    path = tmp_path / "seven.rbsim"
    shown = run("snapshot", "--id", "seven", "--out", str(path), url=sim.url)
    assert (shown.code, shown.err) == (0, "")
    assert shown.out.startswith(f"snapshot seven  frame 7  hash {client.state_hash()}")
    with Simulator(port=0) as other:
        restored = run("restore", str(path), "--json", url=other.url).json
        assert (restored["frame"], restored["state_hash"]) == (7, client.state_hash())
    client.tick()
    assert run("restore", "seven", url=sim.url).out == f"restored  frame 7  hash {client.state_hash()}\n"


def test_list_and_remove(sim: Simulator) -> None:
    assert run("snapshot", "--json", url=sim.url).json["id"] == "snapshot-1"
    assert run("snapshot", "--list", "--json", url=sim.url).json[0]["id"] == "snapshot-1"
    assert run("snapshot", "--list", url=sim.url).lines[1].startswith("snapshot-1")
    assert run("snapshot", "--remove", "snapshot-1", "--json", url=sim.url).json == []
    refused = run("snapshot", "--remove", "snapshot-1", url=sim.url)
    assert (refused.code, "no snapshot 'snapshot-1'" in refused.complaint) == (1, True)


def test_mistakes_are_one_line(sim: Simulator, client: Client, tmp_path: Path) -> None:
    client.tick()
    run("snapshot", "--id", "a", url=sim.url)
    assert "another user id is the master" in run("restore", "a", "--user", "me", url=sim.url).complaint
    assert "cannot be read" in run("restore", str(tmp_path / "no.rbsim"), url=sim.url).complaint
    (tmp_path / "odd.rbsim").write_bytes(b"odd")
    assert "expected a snapshot" in run("restore", str(tmp_path / "odd.rbsim"), url=sim.url).complaint
    assert "cannot be written" in run("snapshot", "--out", str(tmp_path), url=sim.url).complaint
    assert "--list" in run("snapshot", "--list", "--id", "a", url=sim.url).complaint
