"""Helpers for tests of replays: commands, a drive, and values of recordings and topics."""

from __future__ import annotations

import math
from typing import Any

from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.sim_harness import Client

STATUS = "/sim/process/state/msg/MoraiSimProcStatus"
INFO = "/ReplayInfo_topic"
PLAY, PAUSE, STOP = 1, 2, 32
FILE, TARGETS, START, SPEED = 1, 2, 4, 8
EGO, VEHICLES, PEDESTRIANS = 1, 2, 4
NUM_FRAMES = 60


def replay(client: Client, status: int = PLAY, option: int = 0, name: str = "", **fields: int) -> bool:
    """Send a command to `/Morai_SimProc`, and return its result."""
    result: bool = client.ask(
        "/Morai_SimProc", sim_process_status=status, replay_option=option, rosbag_file_name=name, **fields
    )["result"]
    return result


def steer_frames(client: Client, num: int) -> None:
    """A lively drive: throttle, brake, both sides, and an object that comes and goes."""
    for i in range(num):
        client.control(0, longlCmdType=1, accel=0.3 + 0.4 * (i % 3), brake=0.1 * (i > 40), steering=0.5 * math.sin(i))
        if i == 20:
            place = {"name": "Box", "position": {"x": 3.0, "y": 21.0, "z": 0.5}, "heading": 77.7, "frame": 0}
            client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", **place)
        client.tick()


def bodies(messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Messages without their headers: time and number differ in a replay."""
    return [{key: value for key, value in message.items() if key != "header"} for message in messages]


def ego_values(recordings: MemoryRecordings) -> list[Any]:
    return [value for topic, value, _ in recordings.messages["drive"] if topic == "/Ego_topic"]


def shown_x(client: Client) -> list[float]:
    return [message["position"]["x"] for message in client.messages("/Ego_topic")]


def last_status(client: Client) -> tuple[int, int, int]:
    last = client.messages(STATUS)[-1]
    return last["command_result"], last["current_mode"], last["current_status"]


def replay_info_messages(recordings: MemoryRecordings) -> list[dict[str, Any]]:
    """Messages of a client that plays the recorded ReplayInfo itself."""
    infos = []
    for topic, value, _ in recordings.messages["info"]:
        assert topic == INFO
        npcs = [
            {
                "unique_id": one.unique_id,
                "name": one.name,
                "heading": one.heading,
                "velocity": {"x": one.velocity.x},
                "size": {"x": one.size.x, "y": one.size.y, "z": one.size.z},
                "position": {"x": one.position.x, "y": one.position.y},
            }
            for one in value.npc_list
        ]
        infos.append({"ego_acc": value.ego_acc, "ego_steer": value.ego_steer, "npc_list": npcs})
    return infos
