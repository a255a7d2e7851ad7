"""Services and input topics: valid, invalid, early, late and excessive requests."""

from __future__ import annotations

import logging
import math
from typing import Any

import pytest

from rosbridge_sim.errors import FieldError, GraphError
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO
from rosbridge_sim.simulator.sync.sync_table import MAX_AHEAD, MAX_WAITING_COMMANDS
from tests.simulator.sim_harness import ALL, Client, SimHarness

NOT_NUMBERS = [math.nan, math.inf, -math.inf]


def ego_row(harness: SimHarness) -> int:
    return harness.world.row(FIRST_EGO)


def in_sync(**settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings' own fields
    harness = SimHarness(start="sync", **settings)
    client = harness.client()
    client.start()
    return harness, client


# /ctrl_cmd


def test_invalid_command_is_reported_and_the_last_one_holds() -> None:
    harness = SimHarness()
    client = harness.client()
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=2, velocity=36.0)
    for wrong in ({"longlCmdType": 4}, {"accel": None}, {"steering": math.inf}):
        with pytest.raises(FieldError, match=r"morai_msgs/CtrlCmd\."):
            client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", **wrong)
    harness.run(10.0)
    assert harness.world.speed[ego_row(harness)] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("field", "near"),
    [
        ("longCmdTyp", "longlCmdType"),
        ("longcmdtype", "longlCmdType"),
        ("front_ster", "front_steer"),
        ("stering", "steering"),
    ],
)
def test_suggestion_names_an_alias_only_where_no_field_of_the_message_is_near(field: str, near: str) -> None:
    client = SimHarness().client()
    with pytest.raises(FieldError, match=rf"does not have a field {field} \(did you mean {near}\?\)"):
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", **{field: 1})


def test_commands_are_clipped_to_vehicle_limits() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/Ego_topic")
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=7.0, brake=-3.0, steering=-2.0)
    harness.run(2.0)
    status = client.messages("/Ego_topic")[-1]
    assert (status["accel"], status["brake"]) == (1.0, 0.0)
    assert status["wheel_angle"] == pytest.approx(-math.radians(36.25), rel=1e-6)


def test_values_in_another_unit_are_told_once_for_each_client_and_field() -> None:
    harness = SimHarness()
    client, other = harness.client(), harness.client()
    for i in range(5):
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=30 + i, brake=-1, steering=45 + i)
    client.send("/ctrl_cmd_0", "morai_msgs/CtrlCmd", accel=30, steering=-45)
    steering = "/ctrl_cmd: steering: expected rad; 45 looks like degrees and is clipped to the vehicle's limit"
    assert client.told == [
        ("warning", f"{steering} (45 degrees are 0.785 rad)"),
        ("warning", "/ctrl_cmd: accel: expected 0..1; 30 looks like percent and is clipped to 1"),
        ("warning", "/ctrl_cmd: brake: expected 0..1; -1 is clipped to 0"),
    ]
    other.send("/ctrl_cmd", "morai_msgs/CtrlCmd", steering=1e9)
    text = "/ctrl_cmd: steering: expected rad; 1e+09 looks like degrees and is clipped to the vehicle's limit"
    assert other.told == [("warning", text)]


def test_values_that_count_and_saturated_steering_are_no_mistakes() -> None:
    harness = SimHarness()
    client = harness.client()
    for command in (
        {"longlCmdType": 1, "accel": 1.0, "brake": 0.0, "steering": 1.5},
        {"longlCmdType": 1, "accel": 1.0005, "steering": -1.0},
        {"longlCmdType": 2, "velocity": 60, "accel": 30, "brake": 50},  # in this mode the pedals do not count
        {"longlCmdType": 3, "acceleration": -9},
    ):
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", **command)
    assert client.told == []


def test_control_of_synchronous_mode_is_told_of_units_too() -> None:
    _, client = in_sync(release="26.R1")
    assert client.control(1, longlCmdType=1, accel=0.5, front_steer=20.0, rear_steer=9.0)
    assert [text.partition(";")[0] for _, text in client.told] == [
        "/SyncModeCtrlCmd: front_steer: expected rad",
        "/SyncModeCtrlCmd: rear_steer: expected rad",
    ]


def test_control_topic_is_ignored_in_synchronous_mode_with_one_warning_per_client() -> None:
    harness, client = in_sync()
    other = harness.client()
    for _ in range(3):
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
        client.tick()
    other.send("/ctrl_cmd_0", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    client.tick()
    assert harness.world.speed[ego_row(harness)] == 0.0
    assert [level for level, _ in client.told] == ["warning"]
    assert "ignored in synchronous mode" in client.told[0][1]
    assert [level for level, _ in other.told] == ["warning"]
    assert "/ctrl_cmd_0 is ignored in synchronous mode" in other.told[0][1]


def test_control_topic_is_ignored_until_the_mode_is_external() -> None:
    harness = SimHarness(start_mode="keyboard")
    client = harness.client()
    state = client.ask("/Service_MoraiEventCmd", option=0)
    assert (state["ctrl_mode"], state["gear"]) == (1, 1)
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    assert [text for _, text in client.told] == [
        "/ctrl_cmd is ignored: ctrl_mode is KEYBOARD; set 3 by /Service_MoraiEventCmd"
    ]
    state = client.ask("/Service_MoraiEventCmd", option=3, ctrl_mode=3, gear=4)
    assert (state["ctrl_mode"], state["gear"]) == (3, 4)
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    harness.run(1.0)
    assert harness.world.speed[ego_row(harness)] > 1.0


def test_control_in_a_gear_without_drive_is_told_once_until_the_gear_changes() -> None:
    harness = SimHarness(start_mode="keyboard")
    client = harness.client()
    client.start()
    for command in ({"longlCmdType": 1, "brake": 1.0}, {"longlCmdType": 2}, {"longlCmdType": 3, "acceleration": -1.0}):
        assert client.control(0, **command)
        client.tick()
    assert client.told == [], "it does not want to move"
    for _ in range(3):
        assert client.control(0, longlCmdType=1, accel=1.0)
        client.tick()
    text = "/SyncModeCtrlCmd: the command moves nothing: ego 0 is in gear PARK; shift to 4 (D) or 2 (R) first"
    assert client.told == [("warning", text)]
    client.ask("/SyncModeSetGear", frame=0, gear=3)
    client.control(0, longlCmdType=2, velocity=5.0)
    client.tick()
    assert client.told[1:] == [("warning", text.replace("PARK", "NEUTRAL"))]
    client.ask("/SyncModeSetGear", frame=0, gear=4)
    client.control(0, longlCmdType=2, velocity=5.0)
    client.tick()
    assert len(client.told) == 2
    assert harness.world.speed[ego_row(harness)] > 0.0


def test_gear_of_synchronous_mode_at_speed_is_told_to_its_sender() -> None:
    harness, client = in_sync()
    for _ in range(30):
        client.control(0, longlCmdType=1, accel=1.0)
        client.tick()
    assert client.ask("/SyncModeSetGear", frame=0, gear=2) == {"result": False}
    assert len(harness.node.sync.waiting()) == 0
    client.tick()
    ((level, text),) = client.told
    assert level == "warning"
    assert text.startswith("/SyncModeSetGear: gear REVERSE refused: the ego moves at ")
    assert harness.world.gear[ego_row(harness)] == 4


def test_ctrl_mode_of_another_message_is_explained_and_one_without_its_bit_is_told_once() -> None:
    client = SimHarness().client()
    why = client.refused("/Service_MoraiEventCmd", option=1, ctrl_mode=16)
    assert why.endswith("got 16; 16 is the number of external in a MultiEgoSetting, here it is 3")
    for ctrl_mode in (0, 1, 3, 16, 16):  # answers have a mode, and may be sent back
        client.ask("/Service_MoraiEventCmd", option=2, ctrl_mode=ctrl_mode, gear=4)
    text = "ctrl_mode 16 is ignored; option 1 sets a mode, and 3 is external here"
    assert client.told == [("warning", f"/Service_MoraiEventCmd: {text}")]


def test_change_from_client_control_releases_the_pedals() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/Ego_topic")
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    harness.run(1.0)
    client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=1)
    harness.run(0.1)
    assert client.messages("/Ego_topic")[-1]["accel"] == 0.0


# /SyncModeCtrlCmd, /SyncModeSetGear


def test_command_takes_effect_at_its_frame() -> None:
    harness, client = in_sync()
    client.listen("/Ego_topic")
    assert client.control(3, longlCmdType=1, accel=0.5)
    assert client.control(5, longlCmdType=1, accel=0.25)
    for _ in range(6):
        client.tick()
    assert [m["accel"] for m in client.messages("/Ego_topic")] == [0.0, 0.0, 0.5, 0.5, 0.25, 0.25]
    assert len(harness.node.sync.waiting()) == 0


def test_commands_within_one_tick_take_effect_at_their_own_frames() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start(time_step=100)
    client.listen("/Ego_topic")
    client.control(4, longlCmdType=1, accel=0.5)
    client.control(0, longlCmdType=1, accel=0.75)
    client.control(2.0, longlCmdType=1, accel=0.25)
    client.tick()
    assert [m["accel"] for m in client.messages("/Ego_topic")] == [0.75, 0.25, 0.25, 0.5, 0.5]


def test_synchronous_control_needs_no_external_mode() -> None:
    harness, client = in_sync(start_mode="keyboard")
    assert client.ask("/SyncModeSetGear", gear=4, frame=0)["result"]
    assert client.control(0, longlCmdType=1, accel=1.0)
    for _ in range(10):
        client.tick()
    assert harness.world.speed[ego_row(harness)] > 0.0


def test_sync_commands_are_refused_without_synchronous_mode() -> None:
    harness = SimHarness()
    client = harness.client()
    assert client.control(1, longlCmdType=1, accel=1.0) is False
    assert client.ask("/SyncModeSetGear", gear=1, frame=1) == {"result": False}
    assert client.ask("/SyncModeScenarioLoad", file_name="crowd", frame=1, **ALL) == {"result": False}
    assert client.told == [
        ("warning", f"/SyncMode{name}: synchronous mode is off") for name in ("CtrlCmd", "SetGear", "ScenarioLoad")
    ]


def test_invalid_commands_are_refused_with_a_reason() -> None:
    harness, client = in_sync()
    assert client.control(1, longlCmdType=9) is False
    assert client.control(1, longlCmdType=1, steering=None) is False
    assert client.ask("/SyncModeSetGear", gear=7, frame=1) == {"result": False}
    assert [level for level, _ in client.told] == ["error"] * 3
    assert "longlCmdType: expected" in client.told[0][1]
    assert "CtrlCmd.steering: expected a finite number" in client.told[1][1]
    assert "gear: expected" in client.told[2][1]
    assert len(harness.node.sync.waiting()) == 0


def test_waiting_commands_are_bounded_in_number_and_frame_distance() -> None:
    harness, client = in_sync()
    assert client.control(MAX_AHEAD, longlCmdType=1)
    assert client.control(MAX_AHEAD + 1, longlCmdType=1) is False
    assert "frames ahead" in client.told[-1][1]
    for _ in range(MAX_WAITING_COMMANDS - 1):
        client.control(5, longlCmdType=1)
    assert client.control(5, longlCmdType=1) is False
    assert "waiting already" in client.told[-1][1]
    assert len(harness.node.sync.waiting()) == MAX_WAITING_COMMANDS


def test_stop_drops_waiting_commands() -> None:
    harness, client = in_sync()
    client.control(3, longlCmdType=1, accel=1.0)
    client.stop()
    harness.run(1.0)
    assert harness.world.speed[ego_row(harness)] == 0.0


def test_gear_change_at_speed_is_refused_at_its_frame_and_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    _, client = in_sync()
    client.control(0, longlCmdType=1, accel=1.0)
    for _ in range(10):
        client.tick()
    for i in range(3):  # how it will move at a later frame is not known when it asks
        assert client.ask("/SyncModeSetGear", gear=2, frame=12 + 2 * i)["result"] is True
        client.tick()
        client.tick()
    assert client.ask("/Service_MoraiEventCmd", option=0)["gear"] == 4
    assert client.told[0][1].startswith("/SyncModeSetGear: gear REVERSE refused: the ego moves at 0.")
    assert sum("gear REVERSE refused" in record.message for record in caplog.records) == 1


def test_gear_minus_one_keeps_the_gear_and_zero_is_refused() -> None:
    _, client = in_sync()
    assert client.ask("/SyncModeSetGear", gear=-1, frame=0)["result"] is True
    client.tick()
    assert client.told == []
    assert client.ask("/SyncModeSetGear", gear=0, frame=0)["result"] is False
    text = "/SyncModeSetGear: gear: expected 1 (P), 2 (R), 3 (N), 4 (D) or -1 to leave it, got 0"
    assert client.told == [("error", text)]
    assert client.ask("/Service_MoraiEventCmd", option=0)["gear"] == 4


def test_gear_at_speed_is_accepted_behind_a_load_that_waits() -> None:
    harness, client = in_sync()
    for _ in range(30):
        client.control(0, longlCmdType=1, accel=1.0)
        client.tick()
    assert client.ask("/SyncModeScenarioLoad", file_name="crowd", frame=0, **ALL)["result"]
    assert client.ask("/SyncModeSetGear", gear=2, frame=0)["result"] is True
    client.tick()
    assert harness.world.gear[ego_row(harness)] == 2


# /SyncModeAddObj, /SyncModeRemoveObj


def test_objects_are_added_and_removed_at_their_frames() -> None:
    harness, client = in_sync()
    client.listen("/Object_topic")
    client.send(
        "/SyncModeAddObj",
        "morai_msgs/SyncModeAddObj",
        name="traffic cone",
        position={"x": 1.0, "y": 2.0, "z": 3.0},
        heading=90.0,
        frame=2,
    )
    client.tick()
    client.tick()
    before, after = client.messages("/Object_topic")
    assert (before["num_of_obstacle"], after["num_of_obstacle"]) == (2, 3)
    added = after["obstacle_list"][-1]
    assert (added["name"], added["heading"], added["position"]) == (
        "Traffic_Cone",
        90.0,
        {"x": 1.0, "y": 2.0, "z": 3.0},
    )
    assert added["unique_id"] == 11
    client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=11, frame=0)
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Bus", frame=0)
    client.tick()
    last = client.messages("/Object_topic")[-1]
    assert (last["num_of_obstacle"], last["num_of_npcs"]) == (2, 3)
    assert last["npc_list"][-1]["unique_id"] == 12
    assert client.told == []
    assert len(harness.world) == 7


def test_adding_objects_is_refused_without_synchronous_mode() -> None:
    harness = SimHarness()
    client = harness.client()
    with pytest.raises(GraphError, match="/SyncModeAddObj: synchronous mode is off"):
        client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Bus", frame=1)
    with pytest.raises(GraphError, match="/SyncModeRemoveObj: synchronous mode is off"):
        client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=7)


@pytest.mark.parametrize("number", NOT_NUMBERS)
def test_invalid_objects_are_refused(number: float) -> None:
    harness, client = in_sync()
    with pytest.raises(FieldError, match="the catalogue has no model 'dragon'"):
        client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="dragon")
    with pytest.raises(FieldError, match="expected"):
        client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Bus", heading=number)
    with pytest.raises(FieldError, match="expected"):
        client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Bus", position={"x": number})
    with pytest.raises(FieldError, match="position: expected numbers within"):
        client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Bus", position={"x": 1e300})
    with pytest.raises(FieldError, match="heading: expected a number within"):
        client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Bus", heading=1e300)
    for unique_id in (FIRST_EGO, -1, 4711):
        client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=unique_id)
    client.tick()
    assert client.told == [
        ("error", "/SyncModeRemoveObj: unique_id 0: the ego cannot be removed"),
        ("error", "/SyncModeRemoveObj: unique_id -1: the ego cannot be removed"),
        ("error", "/SyncModeRemoveObj: unique_id 4711: there is no such object"),
    ]
    assert len(harness.world) == 6


# Scenarios


def test_immediate_load_keeps_the_frame_and_the_mode() -> None:
    harness, client = in_sync()
    client.control(0, longlCmdType=1, accel=1.0)
    for _ in range(5):
        client.tick()
    assert client.ask("/Service_MoraiSL", file_name="parked", **ALL) == {"result": True}
    assert len(harness.world) == 1
    answer = client.tick()
    assert answer["frame"] == 6
    assert answer["vehicle_status"]["position"]["x"] == -5.0
    assert client.ask("/Service_MoraiEventCmd", option=0)["gear"] == 1


def test_load_shows_in_the_answer_before_the_next_frame() -> None:
    _, client = in_sync()
    client.tick()
    client.ask("/Service_MoraiSL", file_name="parked", **ALL)
    refused = client.tick("somebody")
    assert refused["frame"] == 1
    assert refused["vehicle_status"]["position"]["x"] == -5.0


def test_load_takes_effect_at_its_frame() -> None:
    harness, client = in_sync()
    assert client.ask("/SyncModeScenarioLoad", file_name="parked", frame=3, **ALL) == {"result": True}
    sizes = []
    for _ in range(4):
        client.tick()
        sizes.append(len(harness.world))
    assert sizes == [6, 6, 1, 1]


@pytest.mark.parametrize("name", ["nothing", "torn", "lost", "", "../../etc/passwd"])
def test_impossible_load_is_refused_with_a_reason(name: str) -> None:
    harness, client = in_sync()
    before = harness.world.digest()
    assert client.ask("/Service_MoraiSL", file_name=name, **ALL) == {"result": False}
    assert client.ask("/SyncModeScenarioLoad", file_name=name, frame=1, **ALL) == {"result": False}
    assert [level for level, _ in client.told] == ["error", "error"]
    assert client.told[0][1].startswith("/Service_MoraiSL: ")
    assert harness.world.digest() == before


LOAD = ("/ScenarioLoad", "morai_msgs/ScenarioLoad")


def test_load_by_topic_equals_load_by_service_in_both_modes() -> None:
    harness = SimHarness()
    client = harness.client()
    client.send(*LOAD, file_name="parked", **ALL)
    assert len(harness.world) == 1
    client.start()
    client.send(*LOAD, file_name="crowd", set_pause=True, load_object_data=True, load_surrounding_vehicle_data=True)
    assert len(harness.world) == 5, "two vehicles and, by the manual's name of the option, two obstacles"
    assert client.tick()["pause_status"] is True
    assert client.told == [("warning", "/SyncModeWaitForTick: the simulation is paused")]


@pytest.mark.parametrize("name", ["nothing", "torn", "lost", "", "../../etc/passwd"])
def test_impossible_load_by_topic_is_reported_to_its_sender(name: str) -> None:
    harness = SimHarness()
    client = harness.client()
    before = harness.world.digest()
    with pytest.raises(GraphError, match=r"^/ScenarioLoad: "):
        client.send(*LOAD, file_name=name, **ALL)
    assert harness.world.digest() == before


def test_load_may_pause_the_simulation() -> None:
    harness, client = in_sync()
    assert client.ask("/Service_MoraiSL", file_name="crowd", set_pause=True, **ALL) == {"result": True}
    answer = client.tick()
    assert (answer["tick_status"], answer["pause_status"]) == (False, True)
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    client.ask("/SyncModeScenarioLoad", file_name="crowd", frame=1, set_pause=True, **ALL)
    answer = client.tick()
    assert (answer["tick_status"], answer["frame"]) == (True, 1), "the tick in which it comes is carried out"
    assert client.tick()["pause_status"] is True
    assert harness.world.frame == 1


def test_documented_option_names_are_accepted() -> None:
    harness = SimHarness("empty")
    client = harness.client()
    options = {"load_object_data": True, "load_network_connection": True}
    assert client.ask("/Service_MoraiSL", file_name="crowd", **options) == {"result": True}
    assert len(harness.world) == 1 + 2


def test_load_without_options_is_reported() -> None:
    harness = SimHarness()
    client = harness.client()
    assert client.ask("/Service_MoraiSL", file_name="crowd") == {"result": True}
    assert len(harness.world) == 6
    assert client.told == [("warning", "nothing to load: delete_all and all load_... are false")]


def test_new_ego_has_its_lamps_off_and_keeps_the_control_mode() -> None:
    harness = SimHarness()
    client = harness.client()
    lamps = {"turnSignal": 1, "emergencySignal": 1}
    client.ask("/Service_MoraiEventCmd", option=5, ctrl_mode=2, lamps=lamps)
    client.ask("/Service_MoraiSL", file_name="crowd", **ALL)
    state = client.ask("/Service_MoraiEventCmd", option=0)
    assert (state["ctrl_mode"], state["lamps"]["turnSignal"], state["lamps"]["emergencySignal"]) == (2, 0, 0)


# /Service_MoraiEventCmd


def state_of(answer: dict[str, Any]) -> tuple[int, int, int, int, bool]:
    lamps = answer["lamps"]
    return answer["ctrl_mode"], answer["gear"], lamps["turnSignal"], lamps["emergencySignal"], answer["set_pause"]


@pytest.mark.parametrize(
    ("option", "state"),
    [
        (0, (3, 4, 0, 0, False)),
        (1, (2, 4, 0, 0, False)),
        (2, (3, 2, 0, 0, False)),
        (16, (3, 2, 0, 0, False)),
        (4, (3, 4, 2, 1, False)),
        (8, (3, 4, 0, 0, True)),
        (15, (2, 2, 2, 1, True)),
    ],
)
def test_each_event_bit_applies_its_fields_and_the_answer_is_the_new_state(
    option: int, state: tuple[int, int, int, int, bool]
) -> None:
    client = SimHarness().client()
    lamps = {"turnSignal": 2, "emergencySignal": 1}
    answer = client.ask("/Service_MoraiEventCmd", option=option, ctrl_mode=2, gear=2, lamps=lamps, set_pause=True)
    assert state_of(answer) == state
    assert state_of(client.ask("/Service_MoraiEventCmd", option=0, gear=-1)) == state
    assert client.told == []


def test_gear_change_at_speed_is_refused_and_the_answer_shows_the_old_gear() -> None:
    harness = SimHarness()
    client = harness.client()
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    harness.run(1.0)
    assert client.ask("/Service_MoraiEventCmd", option=2, gear=1)["gear"] == 4
    assert "gear PARK refused" in client.told[0][1]
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, brake=1.0)
    harness.run(2.0)
    assert client.ask("/Service_MoraiEventCmd", option=2, gear=1)["gear"] == 1


@pytest.mark.parametrize(
    ("option", "fields", "complaint"),
    [
        (1, {"ctrl_mode": 16}, "ctrl_mode: expected"),
        (2, {"gear": 5}, "gear: expected"),
        (4, {"lamps": {"turnSignal": 3}}, "turnSignal: expected"),
        (4, {"lamps": {"emergencySignal": 2}}, "emergencySignal: expected"),
        (32, {}, "option: expected a sum of 1 (mode), 2 (gear), 4 (lamps) and 8 (pause), got 47"),
        (64, {}, "got 79"),
        (-128, {}, "got -113"),
    ],
)
def test_invalid_event_is_refused_and_changes_nothing(option: int, fields: dict[str, object], complaint: str) -> None:
    client = SimHarness().client()
    sound: dict[str, object] = {"ctrl_mode": 1, "gear": 1, "lamps": {"turnSignal": 1}, "set_pause": True}
    assert complaint in client.refused("/Service_MoraiEventCmd", option=15 | option, **{**sound, **fields})
    assert state_of(client.ask("/Service_MoraiEventCmd", option=0)) == (3, 4, 0, 0, False)


def test_gear_zero_of_an_event_is_told_once_and_the_rest_takes_effect() -> None:
    client = SimHarness().client()
    for _ in range(2):
        answer = client.ask("/Service_MoraiEventCmd", option=3, ctrl_mode=1, gear=0)
        assert (answer["ctrl_mode"], answer["gear"]) == (1, 4)
    text = "gear 0 leaves the gear as it is; expected 1 (P), 2 (R), 3 (N), 4 (D), or -1 to leave it"
    assert client.told == [("warning", f"/Service_MoraiEventCmd: {text}")]


# Figures


@pytest.mark.parametrize("unique_id", [-1, 0])
def test_the_first_ego_has_two_names(unique_id: int) -> None:
    spec = SimHarness().client().ask("/Service_MoraiVehicleSpec", unique_id=unique_id)
    assert spec["size"] == {"x": 4.47, "y": 1.82, "z": 1.45}
    assert spec["max_steering"] == pytest.approx(36.25)


@pytest.mark.parametrize("unique_id", [99, 9, -2])
def test_unknown_id_gives_zeros_and_a_status_with_known_ids(unique_id: int) -> None:
    client = SimHarness().client()
    spec = client.ask("/Service_MoraiVehicleSpec", unique_id=unique_id)
    assert spec["size"] == {"x": 0.0, "y": 0.0, "z": 0.0}
    assert spec["wheel_base"] == 0.0
    assert client.told == [
        (
            "error",
            (
                "/Service_MoraiVehicleSpec: unique_id: expected a vehicle's, one of 0, 7, 10;"
                f" got {unique_id}; all figures are 0"
            ),
        )
    ]


def test_list_of_known_ids_is_shortened() -> None:
    harness = SimHarness()
    client = harness.client()
    client.start()
    for _ in range(25):
        client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", frame=0, name="Van", position={"x": 9, "y": 90})
    client.tick()
    client.ask("/Service_MoraiVehicleSpec", unique_id=999)
    ((_, text),) = client.told
    assert ", ... and 8 more; got 999" in text


def test_map_specification_follows_the_scenario() -> None:
    client = SimHarness().client()
    spec = client.ask("/Service_MoraiMapSpec", load_map_data=True)
    assert (spec["plane_coordinate_system"], spec["utm_num"]) == (0, 52)
    assert spec["utm_offset"] == {"x": 300.0, "y": 400.0, "z": 5.0}
    client.ask("/Service_MoraiSL", file_name="crossing", **ALL)
    spec = client.ask("/Service_MoraiMapSpec")
    assert (spec["utm_num"], spec["central_latitude"], spec["central_meridian"]) == (52, 0.0, 129.0)
    assert (spec["scale_factor"], spec["false_easting"], spec["false_northing"]) == (0.9996, 500_000.0, 0.0)
    client.ask("/Service_MoraiSL", file_name="elsewhere", **ALL)
    spec = client.ask("/Service_MoraiMapSpec")
    assert (spec["plane_coordinate_system"], spec["central_meridian"]) == (1, 127.0)


# Peers that go


def test_warnings_are_repeated_for_a_new_client() -> None:
    harness, _ = in_sync()
    for _ in range(3):
        client = harness.client()
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd")
        assert len(client.told) == 1
        client.leave()
    assert len(harness.node.context.warnings) == 0


def test_command_outlives_its_client() -> None:
    harness, client = in_sync()
    other = harness.client()
    other.control(2, longlCmdType=1, accel=0.5)
    other.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=7, frame=2)
    other.leave()
    client.tick()
    assert client.tick()["vehicle_status"]["accel"] == 0.5
    assert 7 not in harness.world
