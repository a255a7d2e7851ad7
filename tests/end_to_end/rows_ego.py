"""Rows: control of the egos, and their state topics."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from tests.end_to_end.table_rows import Message, SceneClient, Table

__all__ = ["TABLE"]

TABLE = Table()


@TABLE.row(
    "/ctrl_cmd",
    done="in real time: pedal down with the wheels to the left, then a speed of 10 km/h, then -3 m/s2",
    seen="/Ego_topic: it speeds up to the left with the pedal as sent, holds 10 km/h, comes to a stand",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Ego_topic")
    await play.let_go()
    await play.send("/ctrl_cmd", longlCmdType=1, accel=1.0, **{play.steering: 0.2})
    status = await play.client.message_where("/Ego_topic", lambda status: _speed(status) > 2.0)
    assert (status["accel"], status["heading"] > 0.1, status["position"]["x"] > -86.0) == (1.0, True, True)
    assert _wheel_rad(play, status) == pytest.approx(0.2, abs=1e-3)
    await play.send("/ctrl_cmd", longlCmdType=2, velocity=10.0, **{play.steering: 0.0})
    status = await play.client.message_where("/Ego_topic", lambda status: abs(_speed(status) * 3.6 - 10.0) < 0.05)
    await play.send("/ctrl_cmd", longCmdType=3, acceleration=-3.0)
    status = await play.client.message_where("/Ego_topic", lambda status: _speed(status) == 0.0)
    await play.lead()


def _speed(status: Message) -> float:
    """Forward [m/s]."""
    speed: float = status["velocity"]["x"]
    return speed


def _wheel_rad(play: SceneClient, status: Message) -> float:
    """The front wheels' angle of an EgoVehicleStatus, by the manual's profile."""
    angle: float = status["wheel_angle"] if play.release == "22.R2" else math.radians(status["front_steer_angle"])
    return angle


@TABLE.row(
    "/Ego_topic",
    done="a drive of three seconds, pedal down, the wheels turning to the left; then the brake",
    seen="place, velocity (m/s, forward), acceleration, heading, pedals and wheel agree frame by frame",
)
async def _(play: SceneClient) -> None:
    await play.lead(500)
    await play.listen("/Ego_topic")
    await play.control(longlCmdType=1, accel=0.75, steering=0.1)
    await play.tick(3.0)
    drive = play.heard("/Ego_topic")
    assert [status["header"]["seq"] for status in drive] == list(range(1, 151))
    assert {status["unique_id"] for status in drive} == {0}
    for before, after in pairwise(drive[50:]):
        dx, dy = (after["position"][axis] - before["position"][axis] for axis in "xy")
        mean = 0.5 * (before["velocity"]["x"] + after["velocity"]["x"])
        assert math.hypot(dx, dy) == pytest.approx(mean * 0.02, abs=1e-4)
        between = math.radians(0.5 * (before["heading"] + after["heading"]))
        sideways = 0.5 * (before["velocity"]["y"] + after["velocity"]["y"])
        assert math.atan2(dy, dx) == pytest.approx(between + sideways / mean, abs=1e-3)
        gain = (after["velocity"]["x"] - before["velocity"]["x"]) / 0.02
        turn_rate = math.radians(after["heading"] - before["heading"]) / 0.02
        assert after["acceleration"]["x"] == pytest.approx(gain - turn_rate * sideways, abs=1e-3), "in a turning frame"
    last = drive[-1]
    turned = (last["heading"] - drive[-2]["heading"]) / 0.02
    without_slip = last["velocity"]["x"] * math.tan(0.1) / 2.7
    assert 0.9 * without_slip < math.radians(turned) < without_slip, "it understeers"
    assert (last["accel"], last["brake"], last["header"]["frame_id"]) == (0.75, 0.0, "base_link")
    assert _wheel_rad(play, last) == pytest.approx(0.1, abs=1e-3)
    await play.control(longlCmdType=1, brake=1.0)
    status = await play.tick(0.2)
    assert (status["brake"], status["acceleration"]["x"] < -5.0) == (1.0, True)


@TABLE.row(
    "/ego_setting",
    done="ego 0 is put to another place at 36 km/h, and a second ego comes: number 2, in R, under keyboard control",
    seen="/Ego_topic and /Ego-2/Ego_topic are there, /Ego-2/Service_MoraiEventCmd tells gear and mode; 0 rolls on",
)
async def _(play: SceneClient) -> None:
    await play.send(
        "/ego_setting",
        number_of_ego_vehicle=2,
        camera_index=2,
        ego_index=[0, 2],
        global_position_x=[200.0, 100.0],
        global_position_y=[400.0, 450.0],
        global_position_z=[0.0, 1.5],
        global_roll=[0.0, 0.0],
        global_pitch=[0.0, 0.0],
        global_yaw=[90.0, -135.0],
        velocity=[36.0, 0.0],
        gear=[4, 2],
        ctrl_mode=[16, 1],
    )
    await play.listen("/Ego_topic", "/Ego-2/Ego_topic")
    await play.tick()
    first, second = play.last("/Ego_topic"), play.last("/Ego-2/Ego_topic")
    assert (first["position"]["x"], first["heading"]) == pytest.approx((200.0, 90.0))
    assert first["velocity"]["x"] == pytest.approx(10.0, abs=0.1)
    assert first["position"]["y"] == pytest.approx(400.2, abs=0.01)
    assert second["position"] == {"x": 100.0, "y": 450.0, "z": 1.5}
    assert (second["unique_id"], second["heading"]) == (2, pytest.approx(-135.0))
    event = await play.ask("/Ego-2/Service_MoraiEventCmd", option=0)
    assert (event["gear"], event["ctrl_mode"]) == (2, 1)


@TABLE.row(
    "/CollisionData",
    done="the ego is driven into a barrier at 36 km/h, and put back",
    seen="the list is empty before, holds the barrier and its place while they touch, and is empty again",
)
async def _(play: SceneClient) -> None:
    await play.lead(500)
    await play.listen("/CollisionData")
    await play.put(285.0, 300.0, velocity_kmh=36.0)
    await play.tick(0.5)
    assert [len(data["collision_object"]) for data in play.heard("/CollisionData")] == [0] * 25
    await play.tick(1.0)
    hit = next(data for data in play.heard("/CollisionData") if data["collision_object"])
    (barrier,) = hit["collision_object"]
    assert (barrier["unique_id"], barrier["type"], barrier["name"]) == (15, 2, "Road_Barrier")
    assert [hit[f"global_offset_{axis}"] for axis in "xyz"] == [300.0, 300.0, 0.0]
    assert play.last("/CollisionData")["collision_object"], "they touch still"
    await play.put(-86.0, -5.25)
    await play.tick()
    assert play.last("/CollisionData")["collision_object"] == []


@TABLE.row(
    "/lamps",
    done="right turn signal, then the hazard lights alone",
    seen="/Service_MoraiEventCmd tells the lamps that are lit",
)
async def _(play: SceneClient) -> None:
    for turn, emergency in ((2, 0), (0, 1)):
        await play.send("/lamps", turnSignal=turn, emergencySignal=emergency)
        lamps = (await play.ask("/Service_MoraiEventCmd", option=0))["lamps"]
        assert (lamps["turnSignal"], lamps["emergencySignal"]) == (turn, emergency)
    await play.send_badly("/lamps", "turnSignal", turnSignal=9)
    assert (await play.ask("/Service_MoraiEventCmd", option=0))["lamps"] == lamps


@TABLE.row(
    "/Service_MoraiEventCmd",
    done="mode 1, gear R, the left signal and a pause, each by its bit; then all of it back",
    seen="in mode 1 /ctrl_cmd moves nothing, in R it goes backwards, while paused no tick is carried out",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Ego_topic")
    event = await play.ask("/Service_MoraiEventCmd", option=2, gear=2, ctrl_mode=1, lamps={"turnSignal": 2})
    assert (event["gear"], event["ctrl_mode"], event["lamps"]["turnSignal"]) == (2, 3, 0), "of one bit, one thing"
    await play.lead(500)
    await play.control(longlCmdType=1, accel=0.5)
    status = await play.tick(1.0)
    assert (status["velocity"]["x"] < -0.5, status["position"]["x"] < -86.0) == (True, True)
    event = await play.ask("/Service_MoraiEventCmd", option=6, gear=4, lamps={"turnSignal": 1})
    assert (event["gear"], event["lamps"]["turnSignal"]) == (2, 1), "no gear at speed"

    event = await play.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    assert event["set_pause"] is True
    tick = await play.ask("/SyncModeWaitForTick", user_id="reader", frame=0)
    assert (tick["tick_status"], tick["pause_status"], tick["frame"]) == (False, True, play.frame)
    assert (await play.ask("/Service_MoraiEventCmd", option=8, set_pause=False))["set_pause"] is False
    await play.control(longlCmdType=1, brake=1.0)
    assert (await play.tick(2.0))["velocity"]["x"] == 0.0
    event = await play.ask("/Service_MoraiEventCmd", option=3, ctrl_mode=1, gear=4)
    assert (event["gear"], event["ctrl_mode"]) == (4, 1)

    await play.let_go()
    play.client.inbox.clear()  # of the ticks before
    await play.client.send("publish", topic="/ctrl_cmd", msg={"accel": 1.0})
    start = await play.client.message("/Ego_topic")
    later = await play.client.message_where("/Ego_topic", lambda s: s["header"]["seq"] > start["header"]["seq"] + 20)
    assert later["velocity"]["x"] == 0.0
    await play.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=3)
    await play.send("/ctrl_cmd", accel=1.0)
    await play.client.message_where("/Ego_topic", lambda status: status["velocity"]["x"] > 0.5)
    await play.lead()


@TABLE.row(
    "/Service_MoraiVehicleSpec",
    done="a full circle is driven with the wheels as far round as they go",
    seen="its radius is what the wheelbase and the greatest steering angle of the answer make; no such car: zeros",
)
async def _(play: SceneClient) -> None:
    spec = await play.ask("/Service_MoraiVehicleSpec", unique_id=0)
    assert (spec["size"], spec["wheel_base"]) == ({"x": 4.47, "y": 1.82, "z": 1.45}, pytest.approx(2.7))
    assert spec["overhang"] + spec["wheel_base"] + spec["rear_overhang"] == pytest.approx(spec["size"]["x"], abs=1e-6)
    await play.put(500.0, 500.0)
    await play.control(longlCmdType=2, velocity=10.0, steering=2.0)
    await play.lead(1000)
    await play.tick(3.0)
    await play.listen("/Ego_topic")
    await play.tick(8.0)
    heard = play.heard("/Ego_topic")
    xs, ys = ([status["position"][axis] for status in heard] for axis in "xy")
    radius = spec["wheel_base"] / math.tan(math.radians(spec["max_steering"]))
    for span in (max(xs) - min(xs), max(ys) - min(ys)):
        assert 1.0 < span / (2.0 * radius) < 1.03, "a little wider, because the tyres slip"
    nobody = await play.ask("/Service_MoraiVehicleSpec", unique_id=99)
    assert (nobody["wheel_base"], nobody["max_steering"], nobody["size"]["x"]) == (0.0, 0.0, 0.0)
