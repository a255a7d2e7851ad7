"""Aliases of the simulator's topics and services: a pattern for one holds for all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.ways import Use
from rosbridge_sim.simulator.bus.interface_registry import ListedInterface
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind
from rosbridge_sim.simulator.bus.simulator_ways import _EFFECTS, _SAME, SimulatorWays
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import PRESETS
from tests.graph.bus_fixture import Wire
from tests.simulator.sensors.analytic_makers import AtOnceWorker
from tests.simulator.sim_harness import ALL, SimHarness, put_egos

COMMAND, LOAD = "morai_msgs/CtrlCmd", "morai_msgs/ScenarioLoad"
RENAMED = {
    "publishers": {"/Ego_topic": {"name": "/car/state"}, "/tf": {"name": "/frames"}},
    "subscribers": {"/ctrl_cmd": {"name": "/car/drive"}, "/Ego-3/ctrl_cmd": {"name": "/third"}},
    "services": {"/Service_MoraiSL": {"name": "/load"}},
}


def completed(policy: Policy, harness: SimHarness | None) -> Policy:
    ways = SimulatorWays(None if harness is None else harness.node.interfaces)
    policy.ways.add(ways.effects, ways.others)
    if harness is not None:
        harness.node.interfaces.on_change = policy.ways.change
    return policy


def denying(harness: SimHarness | None, **patterns: str) -> Policy:
    rules = {use: Rule(deny=(pattern,)) for use, pattern in patterns.items()}
    none = Rule()
    policy = Policy(rules.get("publish", none), rules.get("subscribe", none), rules.get("service", none))
    return completed(policy, harness)


def may(policy: Policy, use: Use, name: str) -> bool:
    try:
        if use is Use.SERVICE:
            policy.check_call(name)
        else:
            (policy.check_publish if use is Use.PUBLISH else policy.check_subscribe)(name)
    except GraphError:
        return False
    return True


@pytest.fixture(scope="module")
def harness() -> SimHarness:
    return SimHarness()


@pytest.fixture(scope="module")
def renamed() -> SimHarness:
    return SimHarness(network=RENAMED)


@pytest.mark.parametrize("row", _SAME, ids=lambda row: row[0].name)
def test_denying_one_alias_denies_all(harness: SimHarness, row: tuple[tuple[Use, str], ...]) -> None:
    flags = {Use.PUBLISH: "publish", Use.SUBSCRIBE: "subscribe", Use.SERVICE: "service"}
    for use, name in row:
        policy = denying(harness, **{flags[use]: name})
        for other_use, other in row:
            assert not may(policy, other_use, other), f"{name} denied, {other} open"
            assert not may(policy, other_use, f"/Ego-7{other}")
        assert may(policy, Use.PUBLISH, "/lamps")


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_names_in_the_alias_table_exist_in_the_simulator(release: str) -> None:
    """Of one release or the other."""
    camera, *others = PRESETS["all"]
    rig = (camera.changed(detections=True), *others)
    node = SimHarness(release=release, sensors=rig, worker=AtOnceWorker(), standard_topics=True).node
    items = {(item.kind, item.default) for item in node.interfaces.listing()}
    items |= {(InterfaceKind.SUBSCRIBER, f"/SyncMode{what}Obj") for what in ("Add", "Remove")}
    items |= {(InterfaceKind.SERVICE, f"/SyncMode{what}Object") for what in ("Add", "Remove")}
    kinds = {
        Use.PUBLISH: {InterfaceKind.SUBSCRIBER},
        Use.SUBSCRIBE: {InterfaceKind.PUBLISHER, InterfaceKind.SUBSCRIBER},
        Use.SERVICE: {InterfaceKind.SERVICE},
    }
    ways = {way for effect in _EFFECTS for way in (*effect.ways, *effect.also)} | {way for row in _SAME for way in row}
    for use, name in ways:
        assert any((kind, name) in items for kind in kinds[use]) or name == "/rosapi/get_time", name


def test_every_input_and_service_with_an_effect_is_in_the_log_table(harness: SimHarness) -> None:
    """Whoever adds one has to say what it does, so that the log can name it."""
    known = {way for effect in _EFFECTS for way in (*effect.ways, *effect.also)}
    alone = {"/Service_MoraiVehicleSpec", "/Service_MoraiMapSpec"}
    # They tell what no drive changes.
    alone |= {"/sim/catalogue", "/sim/map", "/sim/scene/mesh", "/sim/route", "/sim/nearest_lane"}
    alone |= {"/sim/scenarios", "/sim/scenario_picture"}
    alone |= {"/sim/story"}  # it tells how far a story is
    alone |= {"/sim/score"}  # no other service tells or resets scores
    alone |= {"/sim/control_lease"}  # it lifts the pedals of its own caller

    def is_known(item: ListedInterface) -> bool:
        use = Use.SERVICE if item.kind is InterfaceKind.SERVICE else Use.PUBLISH
        return (use, item.default) in known or item.default in alone

    items = [item for item in harness.node.interfaces.listing() if item.kind is not InterfaceKind.PUBLISHER]
    assert [item.default for item in items if not is_known(item)] == []


def test_pattern_without_an_ego_prefix_holds_for_further_egos_and_not_the_reverse(harness: SimHarness) -> None:
    policy = denying(harness, publish="/ctrl_cmd", service="/SyncModeCtrlCmd", subscribe="/Ego_topic")
    for prefix in ("/", "/Ego-2/", "/Ego-31/"):
        assert not may(policy, Use.PUBLISH, f"{prefix}ctrl_cmd")
        assert not may(policy, Use.SERVICE, f"{prefix}SyncModeCtrlCmd")
        assert not may(policy, Use.SUBSCRIBE, f"{prefix}Ego_topic")
    policy = denying(harness, publish="/Ego-2/*")
    assert [may(policy, Use.PUBLISH, f"{prefix}ctrl_cmd") for prefix in ("/", "/Ego-2/", "/Ego-3/")] == [
        True,
        False,
        True,
    ]


def test_allowing_one_alias_allows_all(harness: SimHarness) -> None:
    policy = completed(Policy(publish=Rule(allow=("/ctrl_cmd",)), service=Rule(allow=("/Service_MoraiSL",))), harness)
    assert may(policy, Use.PUBLISH, "/ctrl_cmd_0")
    assert may(policy, Use.PUBLISH, "/Ego-2/ctrl_cmd")
    assert may(policy, Use.PUBLISH, "/ScenarioLoad")
    assert may(policy, Use.SERVICE, "/SyncModeScenarioLoad")
    assert not may(policy, Use.PUBLISH, "/lamps")
    assert not may(policy, Use.SERVICE, "/SyncModeCmd")
    objects = Rule(allow=("/SyncModeAddObj", "/SyncModeRemoveObj"))
    policy = completed(Policy(publish=objects, service=Rule(allow=("/nothing",))), harness)
    assert may(policy, Use.SERVICE, "/SyncModeAddObject")
    assert may(policy, Use.SERVICE, "/SyncModeRemoveObject")
    policy = completed(Policy(publish=Rule(allow=("/Ego-2/*",))), harness)
    assert not may(policy, Use.PUBLISH, "/ctrl_cmd")


@pytest.mark.parametrize("pattern", ["/ctrl_cmd", "/ctrl_cmd_0", "/car/drive"])
def test_pattern_holds_for_custom_and_default_names(renamed: SimHarness, pattern: str) -> None:
    policy = denying(renamed, publish=pattern)
    for name in ("/car/drive", "/ctrl_cmd", "/ctrl_cmd_0", "/Ego-2/car/drive", "/Ego-2/ctrl_cmd", "/third"):
        assert not may(policy, Use.PUBLISH, name), name
    assert may(policy, Use.PUBLISH, "/car")


def test_renamed_outputs_and_services_keep_their_aliases(renamed: SimHarness) -> None:
    policy = denying(renamed, subscribe="/Ego_topic", service="/load", publish="/tf")
    assert not may(policy, Use.SUBSCRIBE, "/car/state")
    assert not may(policy, Use.SUBSCRIBE, "/Ego-2/car/state")
    assert not may(policy, Use.SERVICE, "/SyncModeScenarioLoad")
    assert not may(policy, Use.PUBLISH, "/ScenarioLoad")
    assert not may(policy, Use.PUBLISH, "/frames"), "a client could tell other transforms there"
    assert may(policy, Use.SUBSCRIBE, "/frames")


def test_rename_by_a_scenario_does_not_allow_a_denied_name() -> None:
    harness = SimHarness()
    harness.networks.tables["parked"] = RENAMED
    policy = denying(harness, publish="/ctrl_cmd")
    assert may(policy, Use.PUBLISH, "/car/drive")
    client = harness.client()
    assert client.ask("/Service_MoraiSL", file_name="parked", **ALL, load_network_connection_data=True)["result"]
    assert not may(policy, Use.PUBLISH, "/car/drive")
    assert not may(policy, Use.PUBLISH, "/ctrl_cmd")


WITHOUT_EGO = Rule(deny=("/Ego_topic",))
ONLY_CLOCK = Rule(allow=("/clock",))


def ask(client: Wire, service: str, /, **args: object) -> Any:  # noqa: ANN401 - the fields of its answer
    """The values of an answer, which comes behind the statuses of the call."""
    return client.says(op="call_service", service=service, args=args)[-1]["values"]


@pytest.mark.parametrize("rule", [WITHOUT_EGO, ONLY_CLOCK])
def test_step_answers_with_no_topic_that_its_caller_may_not_subscribe_to(rule: Rule) -> None:
    harness = SimHarness(network=RENAMED)
    client = Wire(harness.bus, completed(Policy(subscribe=rule), harness))
    ask(client, "/SyncModeCmd", request={"user_id": "me", "start_sync_mode": True, "time_step": 20})
    frame = harness.world.frame
    answer = ask(client, "/sim/step", user_id="me", n=1, topics=["/clock"])
    assert [sample["topic"] for sample in answer["topics"]] == ["/clock"]
    for name in ("/car/state", "car/state"):
        answer = ask(client, "/sim/step", user_id="me", n=1, topics=["/clock", name])
        assert answer["message"].startswith(f"topics[1]: Not allowed to subscribe to {name}")
        assert (answer["result"], answer["topics"]) == (False, [])
    answer = ask(client, "/sim/step", user_id="me", n=1, topics=["/car/stat"])
    assert "/car/state" not in answer["message"], "a hint has only names that the client may use"
    assert harness.world.frame == frame + 1


@pytest.mark.parametrize("rule", [WITHOUT_EGO, ONLY_CLOCK, Rule(deny=("*",))])
def test_bytes_of_a_snapshot_need_every_topic_of_the_simulator(rule: Rule) -> None:
    harness = SimHarness()
    client = Wire(harness.bus, completed(Policy(subscribe=rule), harness))
    answer = ask(client, "/sim/snapshot", with_data=True)
    assert answer["message"].startswith("with_data: Not allowed to subscribe to ")
    assert (answer["result"], answer["data"]) == (False, "")
    assert ask(client, "/sim/snapshots")["snapshots"] == [], "nothing was saved"
    assert ask(client, "/sim/snapshot")["result"] is True
    other = Wire(harness.bus, completed(Policy(subscribe=Rule(deny=("/chat",))), harness))
    assert ask(other, "/sim/snapshot", with_data=True)["data"]


def test_client_that_had_a_new_denied_name_loses_it() -> None:
    harness = SimHarness()
    harness.networks.tables["parked"] = RENAMED
    thief, user = Wire(harness.bus, denying(harness, publish="/ctrl_cmd")), harness.client()
    assert thief.says(op="advertise", topic="/car/drive", type=COMMAND) == []
    user.ask("/Service_MoraiSL", file_name="parked", **ALL, load_network_connection_data=True)
    (status,) = thief.hears()
    assert status["msg"].startswith("Not allowed to publish to /car/drive, another way of publishing /ctrl_cmd")
    (status,) = thief.says(op="publish", topic="/car/drive", type=COMMAND, msg={"accel": 1.0})
    assert status["msg"].startswith("Not allowed to publish to /car/drive")


def test_subscriber_under_a_new_denied_name_receives_nothing() -> None:
    """What is latched is said again under a new name, at once."""
    harness = SimHarness()
    harness.networks.tables["parked"] = {"publishers": {"/SyncModeInfo": {"name": "/mode"}, "/clock": {"name": "/now"}}}
    spy, user = Wire(harness.bus, denying(harness, subscribe="/SyncModeInfo")), harness.client()
    assert spy.says(op="subscribe", topic="/mode", type="morai_msgs/SyncModeInfo") == []
    user.ask("/Service_MoraiSL", file_name="parked", **ALL, load_network_connection_data=True)
    (status,) = spy.hears()
    assert status["msg"].startswith("Not allowed to subscribe to /mode, another way of listening to /SyncModeInfo")


def test_further_ego_added_later_is_denied_from_the_start() -> None:
    harness = SimHarness()
    client = Wire(harness.bus, denying(harness, publish="/ctrl_cmd"))
    (status,) = client.says(op="advertise", topic="/Ego-2/ctrl_cmd", type=COMMAND)
    assert status["msg"] == "Not allowed to publish to /Ego-2/ctrl_cmd, another way of publishing /ctrl_cmd"
    harness.client().send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    (status,) = client.says(op="advertise", topic="/Ego-2/ctrl_cmd", type=COMMAND)
    assert status["level"] == "error"


def test_aliases_hold_where_a_client_is_the_simulator() -> None:
    policy = denying(None, publish="/ctrl_cmd", service="/Service_MoraiSL")
    assert not may(policy, Use.PUBLISH, "/Ego-2/ctrl_cmd_0")
    assert not may(policy, Use.PUBLISH, "/ScenarioLoad")
    assert policy.left_open() == []


LINES: tuple[tuple[Mapping[str, Any], dict[str, str], str], ...] = (
    (
        {},
        {"publish": "/ctrl_cmd"},
        (
            "--deny-publish /ctrl_cmd leaves these ways open to move an ego: publishing /ghost_ctrl_cmd, /ego_setting,"
            " calling /SyncModeCtrlCmd, /sim/step, /sim/set, /Service_MoraiEventCmd, publishing /ReplayInfo_topic,"
            " calling /Morai_SimProc, and 5 more"
        ),
    ),
    (
        {"subscribers": {"/InsnControl": {"name": "/phase"}}, "publishers": {"/IntscnTL_topic": {"on": False}}},
        {"publish": "/SetTrafficLight"},
        (
            "--deny-publish /SetTrafficLight leaves these ways open to set traffic lights: publishing /phase,"
            " /ScenarioLoad, calling /Service_MoraiSL, /SyncModeScenarioLoad, /sim/reset, /sim/restore"
        ),
    ),
    (
        {"publishers": {"/IntscnTL_topic": {"on": False}}},
        {"service": "/Morai_TLSrv"},
        (
            "--deny-service /Morai_TLSrv leaves these ways open to learn what traffic lights show:"
            " listening to /GetTrafficLightStatus, /InsnStatus, /sim/scene/objects, /sim/scene/state,"
            " /sim/scene/view, calling /sim/describe"
        ),
    ),
)


def test_start_log_names_loads_among_the_ways_to_pause(harness: SimHarness) -> None:
    (line,) = denying(harness, service="/SyncModeCmd").left_open()
    assert "to stop time or let it go on: calling /Service_MoraiEventCmd, /SyncModeWaitForTick, /sim/step, " in line
    assert "publishing /ScenarioLoad" in line


@pytest.mark.parametrize(("network", "patterns", "line"), LINES)
def test_start_log_names_other_routes_with_the_same_effect(
    network: Mapping[str, Any], patterns: dict[str, str], line: str
) -> None:
    assert denying(SimHarness(network=network), **patterns).left_open() == [line]


def test_denying_one_of_many_broad_routes_logs_nothing_about_the_others(harness: SimHarness) -> None:
    (line,) = denying(harness, service="/Service_MoraiSL").left_open()
    assert "to put another scene in place: calling /sim/reset" in line
    assert "/ctrl_cmd" not in line


# Sensors

CLOSED = Rule(deny=("/closed/*", "/image_jpeg/*"))
IMAGE = "sensor_msgs/CompressedImage"


def with_camera(**settings: Any) -> SimHarness:  # noqa: ANN401 - NodeSettings' own fields
    return SimHarness(sensors=PRESETS["camera"], worker=AtOnceWorker(), **settings)


def camera(topic: str) -> str:
    return f'{{"camera": [{{"frame_id": "mine", "topic": "{topic}"}}]}}'


def publishers(harness: SimHarness, name: str) -> list[str]:
    topic = harness.bus.find_topic(name)
    return [] if topic is None else [owner.name for owner in topic.publishers]


@pytest.mark.parametrize("rule", [CLOSED, Rule(allow=("/open/*",))])
def test_client_adds_a_sensor_only_where_it_may_publish(rule: Rule) -> None:
    harness = with_camera()
    harness.client().send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    client = Wire(harness.bus, completed(Policy(publish=rule), harness))
    for ego in (0, 2):
        answer = ask(client, "/sim/sensors", ego=ego, add=camera("/closed/compressed"))
        assert (answer["result"], len(answer["sensors"])) == (False, 3)
        assert answer["message"].startswith("Not allowed to publish to ")
        assert ask(client, "/sim/sensors", ego=ego, add=camera("/open/compressed"))["result"] is True
    assert publishers(harness, "/closed/compressed") == publishers(harness, "/Ego-2/closed/compressed") == []


def test_client_takes_the_camera_of_the_start_away_and_puts_it_back_where_it_may_not_publish() -> None:
    harness = with_camera()
    client = Wire(harness.bus, completed(Policy(publish=CLOSED), harness))
    topic = "/image_jpeg/compressed"
    kept = ask(client, "/sim/snapshot")["id"]
    assert ask(client, "/sim/sensors", remove=["Camera"])["result"] is True
    assert publishers(harness, topic) == []
    assert ask(client, "/sim/sensors", add='{"camera": [{}]}')["result"] is True
    assert ask(client, "/sim/sensors", remove=["Camera"])["result"] is True
    assert ask(client, "/sim/restore", id=kept)["result"] is True
    assert publishers(harness, topic) == ["/morai_sim"]


def test_sensor_that_a_client_adds_takes_no_topic_of_another_client() -> None:
    harness = with_camera()
    owner, client = harness.client(), Wire(harness.bus, completed(Policy(), harness))
    harness.bus.advertise(owner, "/mine/compressed", IMAGE)
    answer = ask(client, "/sim/sensors", add=camera("/mine/compressed"))
    assert answer["message"] == "mine: topic /mine/compressed is published by /client_1; choose another one"
    assert answer["result"] is False
    assert publishers(harness, "/mine/compressed") == ["/client_1"]
    assert owner.lost == []
    assert ask(client, "/sim/sensors", add=camera("/other/compressed"))["result"] is True
    assert ask(client, "/sim/sensors", remove=["mine"], add=camera("/other/compressed"))["result"] is True


@pytest.mark.parametrize("is_by_name", [True, False])
@pytest.mark.parametrize("is_taken", [True, False])
def test_restored_sensors_need_the_right_and_a_free_topic_too(*, is_by_name: bool, is_taken: bool) -> None:
    harness = with_camera()
    user, owner = Wire(harness.bus, completed(Policy(), harness)), harness.client()
    topic = "/closed/compressed"
    assert ask(user, "/sim/sensors", add=camera(topic))["result"] is True
    taken = ask(user, "/sim/snapshot", with_data=True)
    assert ask(user, "/sim/sensors", remove=["mine"])["result"] is True
    policy = Policy() if is_taken else Policy(publish=CLOSED)
    client = Wire(harness.bus, completed(policy, harness))
    if is_taken:
        harness.bus.advertise(owner, topic, IMAGE)
    which = {"id": taken["id"]} if is_by_name else {"data": taken["data"]}
    answer = ask(client, "/sim/restore", **which)
    why = f"mine: topic {topic} is published by /client_1" if is_taken else f"Not allowed to publish to {topic}"
    assert answer["message"].startswith(why)
    assert answer["result"] is False
    assert publishers(harness, topic) == (["/client_1"] if is_taken else [])
    if not is_taken:
        assert ask(user, "/sim/restore", **which)["result"] is True
        assert publishers(harness, topic) == ["/morai_sim"]


def test_start_log_names_the_ways_to_see_what_a_denied_camera_sees() -> None:
    ways = "to see what cameras, lidars and radars see: "
    (line,) = denying(with_camera(), subscribe="/image_jpeg/*").left_open()
    assert line.endswith(f"{ways}listening to /lidar3D, /lidar2D, /radar, calling /sim/sensors, /sim/restore")
    (spec,) = PRESETS["camera"]
    harness = SimHarness(sensors=(spec.changed(topic="/front/compressed"),), worker=AtOnceWorker())
    (line,) = denying(harness, subscribe="/front/*").left_open()
    assert f"{ways}listening to /image_jpeg/compressed, " in line
    assert "calling /sim/sensors, " in line
    (line,) = denying(harness, subscribe="/Object_topic").left_open()
    assert "/front/compressed" in line
