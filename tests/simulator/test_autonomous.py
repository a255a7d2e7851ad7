"""The control mode in which the ego drives itself."""

from __future__ import annotations

from rosbridge_sim.records import replace
from rosbridge_sim.simulator.egos.ego import CtrlMode
from rosbridge_sim.world.state.world import Gear
from tests.simulator.sim_harness import ALL, SimHarness
from tests.simulator.town import Crossroads

ITSELF = {"option": 1, "ctrl_mode": CtrlMode.AUTONOMOUS.value}


def test_command_in_synchronous_mode_ends_self_driving() -> None:
    town = Crossroads.built_in("town")
    town.client.start()
    town.client.ask("/Service_MoraiEventCmd", **ITSELF)
    town.run(1.5)
    assert town.client.control(0, longlCmdType=1, brake=1.0)
    town.run(2.0)
    assert town.client.tick()["vehicle_status"]["velocity"]["x"] == 0.0
    assert town.client.ask("/Service_MoraiEventCmd", option=0)["ctrl_mode"] == 3


def test_control_topic_is_ignored_while_the_ego_drives_itself() -> None:
    harness = SimHarness("elsewhere")
    client = harness.client()
    assert client.ask("/Service_MoraiEventCmd", **ITSELF)["gear"] == 4
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, brake=1.0)
    assert client.told == [
        ("warning", "/ctrl_cmd is ignored: ctrl_mode is AUTONOMOUS; set 3 by /Service_MoraiEventCmd")
    ]
    harness.run(2.0)
    assert harness.world.speed[0] > 1.0


def test_self_driving_mode_is_refused_off_the_road() -> None:
    harness = SimHarness()  # on a map without roads
    client = harness.client()
    assert client.ask("/Service_MoraiEventCmd", **ITSELF)["ctrl_mode"] == 3
    assert client.told == [
        ("warning", "/Service_MoraiEventCmd: ctrl_mode AUTONOMOUS refused: ego 0 stands on no lane, or across it")
    ]


def test_scenario_that_moves_the_ego_off_the_road_ends_self_driving() -> None:
    harness = SimHarness("elsewhere")
    client = harness.client()
    client.ask("/Service_MoraiEventCmd", **ITSELF)
    assert client.ask("/Service_MoraiSL", file_name="elsewhere", **ALL)["result"]
    assert client.ask("/Service_MoraiEventCmd", option=0)["ctrl_mode"] == 6
    assert client.ask("/Service_MoraiSL", file_name="crowd", **ALL)["result"]
    assert client.ask("/Service_MoraiEventCmd", option=0)["ctrl_mode"] == 1


def test_scenario_with_a_parked_ego_keeps_self_driving() -> None:
    harness = SimHarness("elsewhere")
    client = harness.client()
    client.ask("/Service_MoraiEventCmd", **ITSELF)
    harness.node.scene.loaded = replace(
        harness.node.scene.loaded, egos=tuple([replace(ego, gear=Gear.PARK) for ego in harness.node.scene.loaded.egos])
    )
    client.ask("/Morai_SimProc", sim_process_status=32)  # the scenario anew
    harness.run(2.0)
    assert harness.world.speed[0] > 1.0
    assert client.ask("/Service_MoraiEventCmd", option=0)["gear"] == 4


def test_teleported_self_driving_ego_drives_on_from_there() -> None:
    harness = SimHarness("elsewhere")
    client = harness.client()
    lists = ("global_position_x", "global_position_y", "global_position_z", "global_roll", "global_pitch", "global_yaw")
    there = {name: [0.0] for name in (*lists, "velocity")} | {"global_position_y": [40.0], "global_yaw": [90.0]}
    setting = {"number_of_ego_vehicle": 1, "camera_index": 0, "ego_index": [0], "gear": [4], "ctrl_mode": [6], **there}
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **setting)
    harness.run(2.0)
    assert harness.world.y[0] > 41.0
    assert client.told == []
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **setting | {"global_position_x": [80.0]})
    harness.run(2.0)
    assert (harness.world.speed[0], harness.world.has_lane[0]) == (0.0, False)
    assert client.told[0][1].startswith("/ego_setting: ctrl_mode AUTONOMOUS refused")


def test_reset_ends_self_driving() -> None:
    harness = SimHarness("elsewhere")
    client = harness.client()
    client.ask("/Service_MoraiEventCmd", **ITSELF)
    client.call("/sim/reset", {"seed": -1})
    assert client.ask("/Service_MoraiEventCmd", option=0)["ctrl_mode"] == 3
    assert not harness.world.has_lane[0]
