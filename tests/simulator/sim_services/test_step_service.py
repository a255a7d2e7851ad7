"""/sim/step: many ticks in one call, the same world and bytes as by the services of synchronous mode."""

from __future__ import annotations

import json
import math
from hashlib import blake2b
from typing import Any

import pytest

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Answer, Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.sim_services.step_service import MAX_STEPS, MAX_TOPICS
from tests.simulator.sim_harness import ALL, Client, ManualReader, SimHarness, put_egos
from tests.simulator.town import Crossroads

RED = 1
"""`trafficLightStatus` of a red light."""

TOPICS = ("/Ego_topic", "/Object_topic", "/CollisionData", "/clock", "/tf", "/SyncModeInfo", "/gps", "/imu")


def in_sync(time_step: int = 20, **kinds: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - of the harness
    harness = SimHarness(start="sync", **kinds)
    client = harness.client()
    client.start(time_step=time_step)
    return harness, client


class Turns:
    """A clock that ends each turn after a few looks."""

    def __init__(self, looks: int = 1) -> None:
        self.looks = looks
        self._num = 0

    def __call__(self) -> float:
        """Return the time: a turn begins with one look, and is over `looks` later."""
        self._num += 1
        return 10.0 * (self._num // (self.looks + 1))


def ask(client: Client, harness: SimHarness, **request: object) -> list[Answer]:
    """Call without waiting; the list gets the answer."""
    answers: list[Answer] = []
    harness.bus.call(client, "/sim/step", request, answers.append, now=harness.now)
    return answers


def values(answer: Answer) -> dict[str, Any]:
    assert answer.is_ok, answer.values
    assert isinstance(answer.values, Message)
    response: dict[str, Any] = json.loads(answer.values.json)
    return response


def step(client: Client, n: int = 1, **request: object) -> dict[str, Any]:
    return values(client.call("/sim/step", {"user_id": "me", "n": n, **request}))


def command(i: int) -> dict[str, Any]:
    return {"longlCmdType": 1, "accel": 0.4 + 0.3 * math.sin(i), "steering": 0.2 * math.cos(0.3 * i)}


class Listener(Client):
    """Keeps no message, but a hash of all that it hears."""

    def __init__(self, harness: SimHarness) -> None:
        super().__init__(harness.bus, "/listener")
        self.hash = blake2b(digest_size=16)
        self.num = 0
        for topic in (*TOPICS, "/Ego-5/Ego_topic"):
            harness.bus.subscribe(self, topic, self._note)

    def _note(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self.num += 1
        self.hash.update(topic.name.encode() + message.json)


@pytest.mark.parametrize(
    ("release", "time_step", "num"),
    [
        ("22.R2", 60, 20),
        ("26.R1", 20, 40),
        pytest.param("22.R2", 20, 400, marks=pytest.mark.slow),
        pytest.param("26.R1", 60, 400, marks=pytest.mark.slow),
        pytest.param("22.R2", 20, 10_000, marks=[pytest.mark.slow, pytest.mark.long]),
        pytest.param("26.R1", 60, 10_000, marks=[pytest.mark.slow, pytest.mark.long]),
    ],
)
def test_steps_give_the_bytes_of_the_services_of_synchronous_mode(release: str, time_step: int, num: int) -> None:
    one, by_services = in_sync(time_step, release=release)
    other, by_steps = in_sync(time_step, release=release)
    for client in (by_services, by_steps):
        client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    heard = [Listener(harness) for harness in (one, other)]
    other.node.context.sync_driver.read_clock = Turns()
    for i in range(num):
        by_services.control(one.world.frame + 1, **command(i))
        assert by_services.ask("/Ego-5/SyncModeCtrlCmd", frame=one.world.frame + 1, command=command(7))["result"]
        by_services.tick()
    for start in range(0, num, 20):
        each = [command(start + i) for i in range(20)]
        commands = [{"ego": 0, "commands": each}, {"ego": 5, "commands": [command(7)]}]
        answers = ask(by_steps, other, user_id="me", n=20, commands=commands, topics=list(TOPICS))
        other.run(0.0)
        assert values(answers[0])["steps"] == 20
    assert one.world.digest() == other.world.digest()
    assert heard[0].num == heard[1].num
    assert heard[0].hash.digest() == heard[1].hash.digest()
    assert one.world.frame == num * time_step // 20


def test_one_step_is_done_within_the_call() -> None:
    harness, client = in_sync()
    harness.node.context.sync_driver.read_clock = Turns()
    response = step(client)
    assert (response["result"], response["frame"], response["steps"], response["stopped_by"]) == (True, 1, 1, "")
    assert harness.node.next_due(harness.now) is None


def test_many_steps_are_done_in_turns_and_answered_after_the_last() -> None:
    harness, client = in_sync()
    harness.node.context.sync_driver.read_clock = Turns()
    answers = ask(client, harness, user_id="me", n=5)
    for frame in range(1, 5):
        assert (harness.world.frame, answers) == (frame, [])
        assert harness.node.next_due(harness.now) == harness.now
        harness.node.advance(harness.now)
    assert values(answers[0])["steps"] == 5
    assert harness.node.next_due(harness.now) is None
    assert harness.node.sync.state.name == "LED"


def test_frames_of_one_step_are_divided_over_turns() -> None:
    harness, client = in_sync(time_step=1_000)
    harness.node.context.sync_driver.read_clock = Turns()
    answers = ask(client, harness, user_id="me", n=2, topics=["/Ego_topic"])
    for frame in range(1, 100):
        assert (harness.world.frame, answers) == (frame, [])
        assert harness.node.next_due(harness.now) == harness.now
        harness.node.advance(harness.now)
    assert (values(answers[0])["steps"], harness.world.frame, harness.node.context.sync_driver.num_ticks) == (2, 100, 2)
    assert harness.node.next_due(harness.now) is None


@pytest.mark.parametrize("looks", [1, 3, 7])
def test_frames_of_one_turn_are_bounded_by_the_clock(looks: int) -> None:
    harness, client = in_sync(time_step=200)
    harness.node.context.sync_driver.read_clock = Turns(looks)
    answers = ask(client, harness, user_id="me", n=6)
    numbers = [harness.world.frame]
    while not answers:
        before = harness.world.frame
        harness.node.advance(harness.now)
        numbers.append(harness.world.frame - before)
    assert set(numbers[:-1]) == {looks}
    assert sum(numbers) == 60


def test_tick_of_several_frames_is_divided_over_turns_and_gives_the_same_bytes() -> None:
    one, whole = in_sync(200)
    other, divided = in_sync(200)
    for client in (whole, divided):
        client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    heard = [Listener(harness) for harness in (one, other)]
    other.node.context.sync_driver.read_clock = Turns()
    for i in range(5):
        for harness, client in ((one, whole), (other, divided)):
            client.control(harness.world.frame + 4, **command(i))
        at_once = whole.tick()
        ticks = wait_for_tick(divided, other)
        assert (ticks, other.world.frame) == ([], 10 * i + 1)
        other.run(0.0)
        assert values(ticks[0])["response"] == at_once
    assert one.world.digest() == other.world.digest()
    assert (heard[0].num, heard[0].hash.digest()) == (heard[1].num, heard[1].hash.digest())


def wait_for_tick(client: Client, harness: SimHarness) -> list[Answer]:
    ticks: list[Answer] = []
    harness.bus.call(client, "/SyncModeWaitForTick", {"request": {"user_id": "me"}}, ticks.append, now=harness.now)
    return ticks


def test_commands_of_others_wait_for_the_frame_behind_a_tick_that_has_begun() -> None:
    harness, client = in_sync(time_step=200)
    harness.node.context.sync_driver.read_clock = Turns()
    ticks = wait_for_tick(client, harness)
    assert harness.client().control(2, longlCmdType=1, accel=1.0)
    harness.run(0.0)
    assert values(ticks[0])["response"]["vehicle_status"]["accel"] == 0.0
    harness.node.context.sync_driver.read_clock = None
    assert client.tick()["vehicle_status"]["accel"] == 1.0


@pytest.mark.parametrize(
    ("service", "request_"),
    [
        ("/Service_MoraiEventCmd", {"request": {"option": 8, "set_pause": True}}),
        ("/SyncModeCmd", {"request": {"user_id": "me", "start_sync_mode": False}}),
        ("/sim/reset", {"seed": -1}),
    ],
)
def test_other_event_ends_a_tick_behind_a_frame(service: str, request_: dict[str, Any]) -> None:
    harness, client = in_sync(time_step=200)
    harness.node.context.sync_driver.read_clock = Turns()
    steps = ask(client, harness, user_id="me", n=3, stop_on_collision=True, topics=["/gps"])
    ticks = wait_for_tick(client, harness)
    for _ in range(14):
        harness.node.advance(harness.now)
    other = harness.client()
    other.now = harness.now
    assert other.call(service, request_).is_ok
    response = values(steps[0])
    assert (response["result"], response["steps"], response["stopped_by"]) == (False, 1, "interrupted")
    assert response["frame"] == (0 if "reset" in service else 15)
    assert not values(ticks[0])["response"]["tick_status"]
    assert harness.node.sync.num_ticks == 0
    assert not harness.node.sync.is_in_tick
    other.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    harness.node.context.sync_driver.read_clock = None
    client.start(time_step=40)
    assert client.tick()["frame"] == response["frame"] + 2


def test_interrupted_step_looks_at_no_later_frame() -> None:
    harness, client = in_sync(time_step=200)
    hooks = harness.node.context.hooks.after_frame
    harness.node.context.sync_driver.read_clock = Turns()
    ask(client, harness, user_id="me", n=3, stop_on_collision=True)
    assert "_StepCall._after_frame" in [act.__qualname__ for act in hooks.awake]
    harness.client().call("/sim/reset", {"seed": -1})
    assert "_StepCall._after_frame" not in [act.__qualname__ for act in hooks.awake]


def test_tick_in_which_a_scenario_pauses_is_computed_to_its_end() -> None:
    harness, client = in_sync(time_step=200)
    assert client.ask("/SyncModeScenarioLoad", file_name="parked", frame=3, set_pause=True, **ALL)["result"]
    harness.node.context.sync_driver.read_clock = Turns()
    ticks = wait_for_tick(client, harness)
    for _ in range(2):
        harness.node.advance(harness.now)
    assert (harness.world.frame, values(ticks[0])["response"]["tick_status"]) == (10, True)
    assert harness.node.sync.state.name == "LED_PAUSED"


def test_caller_that_leaves_in_the_middle_of_a_step_has_that_step_finished() -> None:
    harness, client = in_sync(time_step=100)
    harness.node.context.sync_driver.read_clock = Turns()
    second = harness.client()
    answers = ask(second, harness, user_id="me", n=10)
    assert client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=100)["result"]
    second.leave()
    harness.run(0.0)
    assert (answers, harness.world.frame, harness.node.sync.state.name) == ([], 5, "LED")


def test_objects_of_others_come_behind_a_tick_that_has_begun() -> None:
    harness, client = in_sync(time_step=200)
    harness.node.context.sync_driver.read_clock = Turns()
    ticks = wait_for_tick(client, harness)
    spawns: list[Answer] = []
    box = {"model": "Child", "place": {"x": 100.0, "y": 300.0}}
    harness.bus.call(harness.client(), "/sim/spawn", {"objects": [box]}, spawns.append, now=harness.now)
    gone = harness.client()
    harness.bus.call(gone, "/sim/spawn", {"objects": [box]}, spawns.append, now=harness.now)
    gone.leave()
    num = len(harness.world)
    assert (spawns, ticks) == ([], [])
    for _ in range(8):
        harness.node.advance(harness.now)
    assert (spawns, ticks, len(harness.world)) == ([], [], num)
    harness.node.advance(harness.now)
    assert (values(spawns[0])["result"], len(spawns), len(harness.world)) == (True, 1, num + 1)
    assert harness.world.frame == 10
    ticks = wait_for_tick(client, harness)
    harness.bus.call(harness.client(), "/sim/spawn", {"objects": [box]}, spawns.append, now=harness.now)
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    assert (values(spawns[1])["result"], len(harness.world)) == (True, num + 2)


def test_snapshot_between_two_frames_of_a_tick_goes_on_to_the_same_bits() -> None:
    harness, client = in_sync(time_step=200)
    harness.node.context.sync_driver.read_clock = Turns()
    client.control(1, longlCmdType=2, velocity=20.0)
    ticks = wait_for_tick(client, harness)
    taken = values(client.call("/sim/snapshot", {"id": "middle"}))
    assert (taken["frame"], ticks) == (1, [])
    assert "waiting for their turn" in values(client.call("/sim/restore", {"user_id": "me", "id": "middle"}))["message"]
    harness.run(0.0)
    end = harness.world.digest()
    assert values(client.call("/sim/restore", {"user_id": "me", "id": "middle"}))["frame"] == 1
    harness.node.context.sync_driver.read_clock = None
    client.start(time_step=180)
    client.tick()
    assert harness.world.digest() == end


def test_without_a_clock_all_steps_are_done_within_the_call() -> None:
    _, client = in_sync()
    assert step(client, MAX_STEPS)["frame"] == MAX_STEPS


def test_answer_has_egos_and_topics_as_they_went_out() -> None:
    harness, client = in_sync()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    client.listen(*TOPICS)
    response = step(client, 3, topics=list(TOPICS), commands=[{"ego": -1, "commands": [{"accel": 1.0}]}])
    assert [ego["unique_id"] for ego in response["egos"]] == [0, 5]
    for sample in response["topics"]:
        assert json.loads(sample["message"]) == client.messages(sample["topic"])[-1], sample["topic"]
    assert response["topics"][0]["type"] == "morai_msgs/EgoVehicleStatus"
    assert response["egos"][0] == client.messages("/Ego_topic")[-1]
    silent = harness.client()
    unheard = step(silent, 2, topics=list(TOPICS))
    assert harness.bus.delivery.num_published > 0
    assert json.loads(unheard["topics"][0]["message"])["header"]["seq"] == harness.world.frame


def test_topic_that_nobody_hears_is_made_once_for_a_call() -> None:
    harness, client = in_sync()
    publisher = harness.node.context.publishers.find("/Object_topic")
    assert publisher is not None
    made = []
    make = publisher.make  # type: ignore[union-attr] # it goes out with each frame

    def count() -> object:
        made.append(harness.world.frame)
        return make()

    publisher.make = count  # type: ignore[union-attr]
    num = harness.bus.delivery.num_published
    silent = len(step(client, 50, topics=["/Object_topic"])["topics"])
    assert (made, silent) == ([50], 1)
    assert harness.bus.delivery.num_published - num == 50, "/SyncModeInfo, which is kept for those who come late"


def test_sampled_topic_gives_the_last_message_that_was_due_in_the_call() -> None:
    _, client = in_sync(network={"publishers": {"/gps": {"rate": 10}}})
    first = step(client, 7, topics=["/gps"])["topics"][0]
    assert json.loads(first["message"])["header"]["seq"] == 5
    assert step(client, 2, topics=["/gps"])["topics"][0]["message"] == "", "none was due in frames 8 and 9"


def test_latched_topic_gives_the_message_that_is_kept() -> None:
    _, client = in_sync()
    sample = step(client, topics=["SyncModeInfo"])["topics"][0]
    assert sample["topic"] == "SyncModeInfo"
    assert json.loads(sample["message"])["frame"] == 1


def test_command_goes_behind_those_that_wait_for_the_same_frame() -> None:
    one, by_services = in_sync()
    other, by_steps = in_sync()
    for client in (by_services, by_steps):
        assert client.control(1, longlCmdType=1, brake=1.0)
    by_services.control(1, longlCmdType=1, accel=1.0)
    by_services.tick()
    step(by_steps, commands=[{"ego": 0, "commands": [{"longlCmdType": 1, "accel": 1.0}]}])
    assert one.world.digest() == other.world.digest()


def test_commands_of_others_wait_for_the_frame_behind_the_call() -> None:
    harness, client = in_sync()
    harness.node.context.sync_driver.read_clock = Turns()
    answers = ask(client, harness, user_id="me", n=4)
    other = harness.client()
    assert other.control(2, longlCmdType=1, accel=1.0)
    harness.run(0.0)
    assert values(answers[0])["egos"][0]["accel"] == 0.0
    assert step(client)["egos"][0]["accel"] == 1.0


def test_commands_of_others_move_forward_if_the_call_ends_early() -> None:
    harness, client = in_sync()
    harness.node.context.sync_driver.read_clock = Turns()
    answers = ask(client, harness, user_id="me", n=900)
    assert harness.client().control(2, longlCmdType=1, accel=1.0)
    client.leave()
    assert (answers, harness.world.frame) == ([], 1)
    other = harness.client()
    other.start("other")
    assert values(other.call("/sim/step", {"user_id": "other", "n": 1}))["frame"] == 2


@pytest.mark.parametrize(
    ("service", "request_", "why"),
    [
        ("/Service_MoraiEventCmd", {"request": {"option": 8, "set_pause": True}}, "paused"),
        ("/SyncModeCmd", {"request": {"user_id": "me", "start_sync_mode": False}}, "has ended"),
        ("/sim/reset", {"seed": -1}, "reset"),
    ],
)
def test_other_event_ends_a_call_with_the_steps_done(service: str, request_: dict[str, Any], why: str) -> None:
    harness, client = in_sync()
    harness.node.context.sync_driver.read_clock = Turns()
    answers = ask(client, harness, user_id="me", n=10, topics=["/Ego_topic"])
    harness.node.advance(harness.now)
    other = harness.client()
    other.now = harness.now
    assert other.call(service, request_).is_ok
    response = values(answers[0])
    assert (response["result"], response["steps"], response["stopped_by"]) == (False, 2, "interrupted")
    assert why in response["message"]
    assert (response["frame"], client.told[-1][0]) == (harness.world.frame, "warning")
    frame = harness.world.frame
    harness.node.advance(harness.now)
    assert harness.world.frame == frame
    assert len(answers) == 1


def test_pause_by_a_command_of_a_step_ends_the_call_behind_that_step() -> None:
    harness, client = in_sync()
    load = client.ask("/SyncModeScenarioLoad", file_name="parked", frame=3, set_pause=True, **ALL)
    assert load["result"]
    response = step(client, 10)
    assert (response["result"], response["steps"], response["stopped_by"]) == (False, 3, "interrupted")
    assert harness.node.sync.state.name == "LED_PAUSED"


def test_master_that_leaves_gives_up_the_steps_that_are_left() -> None:
    harness, client = in_sync()
    harness.node.context.sync_driver.read_clock = Turns()
    answers = ask(client, harness, user_id="me", n=10)
    client.leave()
    harness.run(0.0)
    assert (answers, harness.node.sync.num_ticks) == ([], 0)


def test_caller_that_leaves_gives_up_its_steps_while_the_master_has_another_connection() -> None:
    harness, client = in_sync()
    harness.node.context.sync_driver.read_clock = Turns()
    second = harness.client()
    answers = ask(second, harness, user_id="me", n=10)
    waiting = ask(client, harness, user_id="me", n=2)
    second.leave()
    harness.run(0.0)
    assert (answers, values(waiting[0])["steps"]) == ([], 2)
    # One step of the first call, one more of it in the turn of the second call, and two of the second.
    assert harness.world.frame == 4
    assert harness.node.sync.state.name == "LED"


def test_tick_waits_behind_a_call_for_many_steps() -> None:
    harness, client = in_sync()
    harness.node.context.sync_driver.read_clock = Turns()
    answers = ask(client, harness, user_id="me", n=3)
    ticks: list[Answer] = []
    harness.bus.call(
        harness.client(), "/SyncModeWaitForTick", {"request": {"user_id": "me"}}, ticks.append, now=harness.now
    )
    assert (answers, ticks) == ([], [])
    harness.run(0.0)
    assert values(answers[0])["frame"] == 3
    assert values(ticks[0])["response"]["frame"] == 4


def test_steps_wait_for_a_scenario_that_is_being_read() -> None:
    reader = ManualReader()
    harness, client = in_sync(reader=reader)
    loads: list[Answer] = []
    request = {"request": {"file_name": "parked", "frame": 3, **ALL}}
    harness.bus.call(client, "/SyncModeScenarioLoad", request, loads.append, now=harness.now)
    answers = ask(client, harness, user_id="me", n=5)
    assert (harness.world.frame, answers, harness.node.next_due(harness.now)) == (2, [], None)
    reader.hand_over()
    assert values(answers[0])["frame"] == 5


def test_call_stops_at_a_collision_a_distance_and_a_place() -> None:
    harness, client = in_sync()
    go = [{"ego": 0, "commands": [{"longlCmdType": 2, "velocity": 36.0}]}]
    far = step(client, 400, commands=go, stop_after_m=3.0)
    assert (far["result"], far["stopped_by"]) == (True, "distance")
    assert 3.0 <= far["egos"][0]["position"]["y"] - 20.0 < 3.3
    place = step(client, 400, commands=go, stop_at_x=10.0, stop_at_y=40.0, stop_within_m=1.0)
    assert (place["stopped_by"], round(place["egos"][0]["position"]["y"])) == ("place", 39)
    client.send(
        "/NpcGhost_Topic",
        "morai_msgs/NpcGhostCmd",
        npc_list=[
            {"unique_id": 50, "name": "2016_Hyundai_Ioniq", "position": {"x": 10.0, "y": 60.0, "z": 0.0}, "rpy": {}}
        ],
    )
    hit = step(client, 400, commands=go, stop_on_collision=True)
    assert (hit["stopped_by"], hit["result"]) == ("collision", True)
    assert hit["steps"] < 400
    assert harness.node.sync.state.name == "LED"


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        ({"n": 0}, "n: expected 1 to 1,000 steps, got 0"),
        ({"n": MAX_STEPS + 1}, "n: expected 1 to 1,000 steps, got 1001"),
        ({"n": 1, "commands": [{"ego": 9, "commands": [{}]}]}, "commands[0].ego: expected the number of an ego"),
        ({"n": 1, "commands": [{"ego": 0, "commands": []}]}, "commands[0].commands: expected 1 or n = 1"),
        ({"n": 3, "commands": [{"commands": [{}, {}]}]}, "commands[0].commands: expected 1 or n = 3 commands, got 2"),
        ({"n": 1, "commands": [{"commands": [{}]}, {"ego": -1, "commands": [{}]}]}, "commands[1].ego: ego 0 is named"),
        ({"n": 1, "commands": [{"commands": [{"longlCmdType": 9}]}]}, "CtrlCmd.longlCmdType: expected 1"),
        ({"n": 1, "topics": ["/Ego_topik"]}, "no topic '/Ego_topik' (did you mean /Ego_topic?)"),
        ({"n": 1, "topics": [""]}, "not a valid graph name"),
        ({"n": 1, "topics": ["/clock", "/clock"]}, "a name stands there twice"),
        ({"n": 1, "topics": [f"/t{i}" for i in range(MAX_TOPICS + 1)]}, "expected at most 32 names"),
        ({"n": 1, "stop_after_m": -1.0}, "stop_after_m: expected a number of metres"),
        ({"n": 1, "stop_within_m": None}, "stop_within_m: expected a number of metres"),
        ({"n": 1, "stop_at_x": 1e300}, "stop_at_x: expected a number within"),
    ],
)
def test_bad_request_is_refused_with_the_reason_and_moves_nothing(request_: dict[str, Any], why: str) -> None:
    harness, client = in_sync()
    before = harness.world.digest()
    response = values(client.call("/sim/step", {"user_id": "me", **request_}))
    assert (response["result"], response["steps"], response["stopped_by"], response["topics"]) == (False, 0, "", [])
    assert why in response["message"]
    assert client.told[-1] == ("error", f"/sim/step: {response['message']}")
    assert harness.world.digest() == before


def test_only_the_master_steps_and_only_in_synchronous_mode() -> None:
    harness = SimHarness()
    client = harness.client()
    assert values(client.call("/sim/step", {"n": 1}))["message"] == "synchronous mode is off"
    client.start()
    response = values(client.call("/sim/step", {"user_id": "you", "n": 1, "topics": ["/Ego_topic"]}))
    assert response["message"] == "another user id is the master: 'me'"
    assert (response["topics"][0]["message"], harness.world.frame) == ("", 0)
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    assert step(client)["message"] == "the simulation is paused"


def test_listener_of_a_step_cannot_step_from_within() -> None:
    harness, client = in_sync()
    answers: list[Answer] = []

    def hear(*_: object) -> None:
        answers.extend([client.call("/sim/step", {"user_id": "me", "n": 1})])

    harness.bus.subscribe(client, "/Ego_topic", hear)
    assert step(client)["frame"] == 1
    assert [answer.values for answer in answers] == ["/sim/step: a tick is in progress"]


def test_ego_that_goes_in_the_middle_of_a_call_is_passed_over() -> None:
    _, client = in_sync()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    client.ask("/SyncModeScenarioLoad", file_name="parked", frame=3, **ALL)
    response = step(client, 5, commands=[{"ego": 5, "commands": [{"accel": 1.0}]}])
    assert (response["steps"], [ego["unique_id"] for ego in response["egos"]]) == (5, [0])


def test_call_stops_at_a_red_light_and_off_the_road() -> None:
    town = Crossroads.tiny(x=80.0)
    town.client.start()
    ahead = step(town.client, topics=["/GetTrafficLightStatus"])["topics"][0]
    index = json.loads(ahead["message"])["trafficLightIndex"]
    town.client.send("/SetTrafficLight", "morai_msgs/SetTrafficLight", trafficLightIndex=index, trafficLightStatus=RED)
    go = [{"commands": [{"longlCmdType": 2, "velocity": 36.0}]}]
    red = step(town.client, 400, commands=go, stop_on_red_light=True)
    assert (red["stopped_by"], red["steps"] < 400) == ("red_light", True)
    assert red["egos"][0]["position"]["x"] > 90.0
    turn = [{"commands": [{"longlCmdType": 2, "velocity": 36.0, "steering": 0.3}]}]
    off = step(town.client, 400, commands=turn, stop_off_road=True)
    assert (off["stopped_by"], off["result"]) == ("off_road", True)
    assert step(town.client, 5, stop_off_road=True)["steps"] == 1, "it stands beside the road still"
