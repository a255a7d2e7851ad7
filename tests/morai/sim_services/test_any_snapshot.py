"""Snapshots in any order of calls: the hash comes back, and so do the bytes of the frames behind it."""

from __future__ import annotations

from contextlib import suppress
from hashlib import blake2b
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rosbridge_sim.errors import PeerError
from rosbridge_sim.morai.snapshot_bytes import CHECKSUM_SIZE
from tests.morai.sim_harness import ALL, Client, SimHarness, put_egos
from tests.morai.sim_services.snapshot_fixture import call, hash_of, hear, restore, snapshot

NUM_FRAMES = 12
"""Frames whose bytes are compared: a decision of the drivers, a change of lights, a few commands."""

EGOS = st.lists(st.sampled_from([0, 2, 3, 7]), min_size=1, max_size=3, unique=True)
FRAMES = st.integers(0, 15)

ACTS = st.one_of(
    st.tuples(st.just("tick"), st.integers(1, 6)),
    st.tuples(st.just("snapshot")),
    st.tuples(st.just("restore"), st.integers(0, 9), st.booleans()),
    st.tuples(st.just("reset"), st.sampled_from([-1, 0, 5])),
    st.tuples(st.just("load"), st.sampled_from(["crowd", "parked", "elsewhere", "crossing"]), st.booleans()),
    st.tuples(st.just("load later"), st.sampled_from(["crowd", "crossing"]), FRAMES),
    st.tuples(st.just("egos"), EGOS),
    st.tuples(st.just("spawn"), st.sampled_from(["Box", "Van", "Man"]), FRAMES),
    st.tuples(st.just("remove"), st.integers(1, 12), FRAMES),
    st.tuples(st.just("ghost"), st.integers(40, 42), st.floats(0, 50)),
    st.tuples(st.just("control"), FRAMES, st.floats(0, 1)),
    st.tuples(st.just("gear"), FRAMES, st.sampled_from([-1, 1, 2, 4])),
    st.tuples(st.just("mode"), st.sampled_from([1, 3, 6])),
    st.tuples(st.just("lamps"), st.integers(0, 2)),
    st.tuples(st.just("sensor"), st.floats(-2, 2)),
)


class Run:
    """A simulator and what was saved of it."""

    def __init__(self, release: str) -> None:
        self.harness = SimHarness("crossing", start="sync", release=release)
        self.client = self.harness.client()
        self.client.start()
        self.egos(self.client, [2, 3, 7])  # so that their topics are there to be listened to
        self.listener = hear(self.harness, *(f"/Ego-{i}/{name}" for i in (2, 3, 7) for name in ("Ego_topic", "gps")))
        self.reset(self.client, -1)
        self.saved: list[tuple[str, bytes, str, list[bytes] | None]] = []

    def do(self, what: str, *args: Any) -> None:  # noqa: ANN401 - of ACTS
        act = getattr(self, what.replace(" ", "_"))
        if what in {"snapshot", "restore"}:
            act(self.client, *args)
            return
        with suppress(PeerError):  # a number that is an ego's, a lane that is not there: not what this is about
            act(self.client, *args)

    def tick(self, client: Client, num: int) -> None:
        for _ in range(num):
            client.tick()

    def snapshot(self, client: Client) -> None:
        """Save, and keep what follows; then go back, so that the order of the acts stays what it is."""
        response = snapshot(client)
        assert response.state_hash == hash_of(client)
        following = self.follow()
        self.saved.append((response.id, bytes(response.data), response.state_hash, following))
        assert restore(client, response.id).result

    def restore(self, client: Client, which: int, is_data: bool) -> None:  # noqa: FBT001 - of ACTS
        if not self.saved:
            return
        name, data, state_hash, following = self.saved[which % len(self.saved)]
        response = restore(client, data if is_data else name)
        assert (response.message, response.state_hash) == ("", state_hash)
        assert hash_of(client) == state_hash
        again = snapshot(client)
        assert bytes(again.data) == data, "what is saved again has the same bytes"
        assert self.follow() == following
        assert restore(client, again.id).result
        call(client, "/sim/snapshots", remove=[again.id])

    def follow(self) -> list[bytes]:
        self.listener.raw.clear()
        self.tick(self.client, NUM_FRAMES)
        return [*self.listener.raw, hash_of(self.client).encode()]

    def reset(self, client: Client, seed: int) -> None:
        call(client, "/sim/reset", seed=seed)

    def load(self, client: Client, name: str, is_clearing: bool) -> None:  # noqa: FBT001 - of ACTS
        client.ask("/Service_MoraiSL", file_name=name, **ALL | {"delete_all": is_clearing})

    def load_later(self, client: Client, name: str, ahead: int) -> None:
        frame = self.harness.world.frame + ahead
        client.ask("/SyncModeScenarioLoad", file_name=name, frame=frame, **ALL)

    def egos(self, client: Client, indices: list[int]) -> None:
        client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(*indices))

    def spawn(self, client: Client, name: str, ahead: int) -> None:
        place = {"name": name, "position": {"x": 5.0 * ahead, "y": 30.0}, "frame": self.harness.world.frame + ahead}
        if "SyncModeAddObj" in " ".join(self.harness.bus.topics):
            client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", **place)
        else:
            client.ask("/SyncModeAddObject", **place)

    def remove(self, client: Client, uid: int, ahead: int) -> None:
        request = {"unique_id": uid, "frame": self.harness.world.frame + ahead}
        if "SyncModeRemoveObj" in " ".join(self.harness.bus.topics):
            client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", **request)
        else:
            client.ask("/SyncModeRemoveObject", **request)

    def ghost(self, client: Client, uid: int, x: float) -> None:
        ghosts = [{"unique_id": uid, "name": "Van", "position": {"x": x, "y": -20.0}}]
        client.send("/NpcGhost_Topic", "morai_msgs/NpcGhostCmd", npc_list=ghosts)

    def control(self, client: Client, ahead: int, accel: float) -> None:
        client.control(self.harness.world.frame + ahead, longlCmdType=1, accel=accel)

    def gear(self, client: Client, ahead: int, gear: int) -> None:
        client.ask("/SyncModeSetGear", frame=self.harness.world.frame + ahead, gear=gear)

    def mode(self, client: Client, mode: int) -> None:
        client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=mode)

    def lamps(self, client: Client, turn: int) -> None:
        client.ask("/Service_MoraiEventCmd", option=4, lamps={"turnSignal": turn, "emergencySignal": 0})

    def sensor(self, client: Client, x: float) -> None:
        place = {f"pose_{axis}": [x] for axis in "xyz"}
        angles = {axis: [0.1] for axis in ("roll", "pitch", "yaw")}
        client.send("/SensorPosControl", "morai_msgs/SensorPosControl", sensor_index=[1], **place, **angles)


def check(release: str, acts: list[tuple[Any, ...]]) -> None:
    run = Run(release)
    for act in [*acts, ("snapshot",), ("tick", 3), ("restore", len(acts), True), ("restore", 0, True)]:
        run.do(*act)


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
@pytest.mark.parametrize(
    "acts",
    [
        [("egos", [0, 2]), ("load later", "crowd", 4), ("snapshot",), ("tick", 6), ("restore", 0, True)],
        [("mode", 6), ("tick", 5), ("snapshot",), ("load", "elsewhere", True), ("restore", 0, False), ("reset", 5)],
        [("ghost", 40, 3.0), ("tick", 3), ("ghost", 40, 4.0), ("snapshot",), ("ghost", 40, 9.0), ("restore", 0, True)],
    ],
    ids=["egos and a load", "self-driving and a map", "ghosts"],
)
def test_hash_and_bytes_come_back(release: str, acts: list[tuple[Any, ...]]) -> None:
    check(release, acts)


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(release=st.sampled_from(["22.R2", "26.R1"]), acts=st.lists(ACTS, max_size=14))
def test_hash_and_bytes_come_back_after_any_order_of_calls(release: str, acts: list[tuple[Any, ...]]) -> None:
    check(release, acts)


@pytest.fixture(scope="module")
def fuzzed() -> tuple[Run, bytes]:
    """A simulator, and a snapshot of a rich state."""
    run = Run("22.R2")
    acts: list[tuple[Any, ...]] = [("egos", [0, 2]), ("ghost", 40, 3.0), ("load later", "crowd", 9), ("tick", 3)]
    for act in acts:
        run.do(*act)
    return run, bytes(snapshot(run.client).data)


@pytest.mark.slow
@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_changed_bytes_with_a_right_checksum_change_nothing(fuzzed: tuple[Run, bytes], data: st.DataObject) -> None:
    run, whole = fuzzed
    changed = bytearray(whole[:-CHECKSUM_SIZE])
    for _ in range(data.draw(st.integers(1, 3))):
        changed[data.draw(st.integers(8, len(changed) - 1))] = data.draw(st.sampled_from([0, 1, 2, 127, 128, 255]))
    forged = bytes(changed) + blake2b(bytes(changed), digest_size=CHECKSUM_SIZE).digest()
    before = hash_of(run.client)
    response = restore(run.client, forged)
    if response.result:  # a byte that is no part of the state, or the same as before
        assert hash_of(run.client) == response.state_hash
    else:
        assert response.message
        assert hash_of(run.client) == before
    assert run.client.tick()["tick_status"]
