"""Snapshots in any order of calls: the hash comes back, and so do the bytes of the frames behind it."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from hashlib import blake2b
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rosbridge_sim.errors import PeerError
from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.simulator.plain.snapshot_bytes import CHECKSUM_SIZE
from tests.mutations import examples
from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.replays.replay_harness import FILE, INFO, PAUSE, PLAY, STOP, replay, replay_info_messages
from tests.simulator.sim_harness import ALL, Client, SimHarness, put_egos
from tests.simulator.sim_services.snapshot_fixture import call, forge, hash_of, hear, restore, snapshot

pytestmark = pytest.mark.usefixtures("loops")

NUM_FRAMES = 8
"""Frames whose bytes are compared: a decision of the drivers, a load or a command ahead of its time."""

EGOS = st.lists(st.sampled_from([0, 2, 3, 7]), min_size=1, max_size=3, unique=True)
FRAMES = st.integers(0, 15)

PATH = [{"x": 0.0, "y": -5.0}, {"x": 20.0, "y": -5.0}, {"x": 30.0, "y": 5.0}]

OBJECTS: dict[str, dict[str, Any]] = {
    "a box": {"model": "Box"},
    "a walker": {"model": "Child", "speed": 1.2, "start_within": 20.0},
    "a car on a path": {"model": "kia k5", "path": PATH, "speed": 4.0, "loop": True},
    "a driver": {"model": "kia k5", "behaviour": "lane", "place": {"link": "A1B1", "distance": 3.0}},
    "an ego": {"is_ego": True, "ego_index": 2},
}
CHANGES: dict[str, dict[str, Any]] = {
    "place": {"set_place": True, "place": {"x": 12.0, "y": 9.0, "heading_deg": 30.0}},
    "speed": {"set_speed": True, "speed": 3.0},
    "path": {"set_behaviour": True, "behaviour": "path", "path": PATH},
    "lane": {"set_place": True, "place": {"link": "A1B1"}, "set_behaviour": True, "behaviour": "lane"},
    "lamps": {"set_lamps": True, "turn_signal": 2, "emergency_signal": 1},
}

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
    st.tuples(st.just("step"), st.integers(1, 6), st.sampled_from(["", "stop_on_collision", "stop_off_road"])),
    st.tuples(st.just("put"), st.sampled_from(sorted(OBJECTS)), st.floats(-20, 60)),
    st.tuples(st.just("change"), st.integers(0, 12), st.sampled_from(sorted(CHANGES))),
    st.tuples(st.just("take away"), st.integers(1, 12)),
    st.tuples(st.just("score"), st.booleans()),
    st.tuples(st.just("light"), st.sampled_from([-1, 1, 4, 16])),
    st.tuples(st.just("phase"), st.integers(0, 1)),
    st.tuples(st.just("play"), st.sampled_from(["drive", "short"]), st.integers(1, 7)),
    st.tuples(st.just("stop playing")),
    st.tuples(st.just("pause playing")),
    st.tuples(st.just("mirror"), st.integers(0, 3)),
    st.tuples(st.just("join"), st.sampled_from(["a", "b"])),
    st.tuples(st.just("leave"), st.sampled_from(["a", "b"])),
    st.tuples(st.just("forged")),
)


@cache
def recordings(release: str) -> MemoryRecordings:
    """Recordings `drive` and `short`, and what a client would publish to have them mirrored, as `info`."""
    recordings, harness = MemoryRecordings(), SimHarness(release=release)
    recordings.record(harness.bus, "drive", "/Ego_topic", "/Object_topic")
    harness.run(1.0)
    recordings.messages["short"] = recordings.messages["drive"][:6]
    infos = SimHarness("parked", release=release, recordings=recordings)
    recordings.record(infos.bus, "info", INFO)
    player = infos.client()
    assert replay(player, PLAY, FILE, "drive")
    infos.run(0.1)
    return recordings


class Run:
    """A simulator and what was saved of it."""

    def __init__(self, release: str) -> None:
        self.harness = SimHarness("crossing", start="sync", release=release, recordings=recordings(release))
        self.infos = replay_info_messages(recordings(release))
        self.client, self.source = self.harness.client(), self.harness.client()
        self.members: dict[str, Client] = {}
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

    @property
    def user_id(self) -> str:
        """The id that may restore: of a member of the barrier, or of the master."""
        return next(iter(self.members), "me")

    def tick(self, client: Client, num: int) -> None:
        for _ in range(num):
            if not self.members:
                client.tick()
            answers: list[Answer] = []
            for name, member in self.members.items():
                request = {"request": {"user_id": name}}
                self.harness.bus.call(member, "/SyncModeWaitForTick", request, answers.append, now=self.harness.now)
            assert len(answers) == len(self.members), "all ticks are answered with the last of them"

    def join(self, client: Client, name: str) -> None:
        if not self.members:
            client.stop()
        member = self.harness.client()
        member.now = self.harness.now
        if call(member, "/sim/barrier/join", user_id=name).result:
            self.members[name] = member

    def leave(self, client: Client, name: str) -> None:
        if name not in self.members:
            return
        assert call(self.members.pop(name), "/sim/barrier/leave", user_id=name).result
        if not self.members:
            client.start()

    def snapshot(self, client: Client) -> None:
        """Save, and keep what follows; then go back, so that the order of the acts stays what it is."""
        self.resume()
        if self.is_paused:
            return
        response = snapshot(client)
        assert response.state_hash == hash_of(client)
        following = self.follow()
        self.saved.append((response.id, bytes(response.data), response.state_hash, following))
        self.go_back(response.id)

    def restore(self, client: Client, which: int, is_data: bool) -> None:  # noqa: FBT001 - of ACTS
        if not self.saved:
            return
        name, data, state_hash, following = self.saved[which % len(self.saved)]
        assert self.go_back(data if is_data else name).state_hash == state_hash
        again = snapshot(client)
        assert bytes(again.data) == data, "what is saved again has the same bytes"
        assert self.follow() == following
        self.go_back(again.id)
        call(client, "/sim/snapshots", remove=[again.id])

    def go_back(self, saved: str | bytes) -> Any:  # noqa: ANN401 - a generated struct
        """Restore. A pause is no part of a snapshot, so there is none here, and none when one is taken."""
        self.resume()
        if self.is_paused:  # the end of a replay pauses again at once
            replay(self.client, STOP)
        response = restore(self.client, saved, self.user_id)
        assert response.message == ""
        assert hash_of(self.client) == response.state_hash
        return response

    @property
    def is_paused(self) -> bool:
        return self.harness.node.sync.is_paused

    def resume(self) -> None:
        if self.is_paused:
            self.client.ask("/Service_MoraiEventCmd", option=8, set_pause=False)

    def follow(self) -> list[bytes]:
        """Go on; all that is heard meanwhile. The name of the master is no part of a snapshot."""
        self.listener.raw.clear()
        self.tick(self.client, NUM_FRAMES)
        self.resume()
        heard = [raw.replace(b'"/sim/barrier"', b'"me"') for raw in self.listener.raw]
        return [*heard, hash_of(self.client).encode()]

    def forged(self, client: Client) -> None:
        """Restore what is refused only when all of it has been put into place: nothing changes."""
        response = snapshot(client, "forged")

        def change(_head: object, state: Any) -> None:  # noqa: ANN401 - plain data
            state["next_uid"] += 1

        for one in [(response.id, bytes(response.data)), *[(name, data) for name, data, _, _ in self.saved]]:
            assert "another state" in restore(client, forge(one[1], change), self.user_id).message
            assert hash_of(client) == response.state_hash
        call(client, "/sim/snapshots", remove=["forged"])

    def step(self, client: Client, n: int, stop: str) -> None:
        stops = {stop: True} if stop else {}
        commands = [{"ego": 0, "commands": [{"longlCmdType": 1, "accel": 0.5, "steering": 0.1}]}]
        with suppress(AssertionError):  # a call that is refused, with two members say
            call(client, "/sim/step", user_id=self.user_id, n=n, commands=commands, **stops)

    def put(self, client: Client, name: str, x: float) -> None:
        call(client, "/sim/spawn", objects=[{"place": {"x": x, "y": 6.0}, **OBJECTS[name]}])

    def change(self, client: Client, uid: int, what: str) -> None:
        call(client, "/sim/set", objects=[{"unique_id": uid, **CHANGES[what]}])

    def take_away(self, client: Client, uid: int) -> None:
        call(client, "/sim/remove", unique_ids=[uid])

    def score(self, client: Client, is_reset: bool) -> None:  # noqa: FBT001 - of ACTS
        call(client, "/sim/score", reset=is_reset)

    def light(self, client: Client, status: int) -> None:
        lights = {"trafficLightIndex": "C1", "trafficLightStatus": status}
        client.send("/SetTrafficLight", "morai_msgs/SetTrafficLight", **lights)

    def phase(self, client: Client, phase: int) -> None:
        client.send("/InsnControl", "morai_msgs/IntersectionControl", intersection_index=13, intersection_status=phase)

    def play(self, client: Client, name: str, targets: int) -> None:
        del targets
        replay(client, PLAY, FILE, name)

    def stop_playing(self, client: Client) -> None:
        replay(client, STOP)

    def pause_playing(self, client: Client) -> None:
        replay(client, PAUSE)
        self.resume()

    def mirror(self, client: Client, i: int) -> None:
        del client
        self.source.send(INFO, "morai_msgs/ReplayInfo", **self.infos[i])

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
        [("load later", "crossing", 6), ("load", "crossing", True), ("tick", 2), ("snapshot",), ("restore", 0, True)],
        [("snapshot",), ("play", "drive", 7), ("tick", 3), ("forged",), ("snapshot",), ("stop playing",), ("forged",)],
        [("mirror", 0), ("tick", 1), ("snapshot",), ("forged",), ("mirror", 2)],
        [("snapshot",), ("play", "short", 1), ("tick", 7), ("snapshot",), ("restore", 0, True), ("restore", 1, False)],
        [
            ("join", "a"),
            ("join", "b"),
            ("tick", 2),
            ("snapshot",),
            ("leave", "a"),
            ("restore", 0, False),
            ("step", 3, ""),
        ],
        [("egos", [7, 2]), ("snapshot",), ("take away", 7)],
        [("score", False), ("put", "a driver", 3.0), ("put", "an ego", 9.0), ("step", 5, "stop_on_collision")],
    ],
    ids=[
        *("egos and a load", "self-driving and a map", "ghosts", "same map twice", "refused in a replay"),
        *("refused while mirroring", "end of a replay", "barrier", "an ego that comes back", "scores"),
    ],
)
def test_hash_and_bytes_come_back(release: str, acts: list[tuple[Any, ...]]) -> None:
    check(release, acts)


@pytest.mark.slow
@examples(25, quick=3)
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
@settings(suppress_health_check=list(HealthCheck))
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
