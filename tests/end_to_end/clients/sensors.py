"""Roles: `save FOLDER`: move the antenna, drive under synchronous mode, and save what the sensors saw at the end."""

from __future__ import annotations

from typing import Any

import roslibpy

from tests.end_to_end.clients.program import PATIENCE, run, say

FRAMES = 50


def save(ros: roslibpy.Ros, folder: str) -> None:
    """The last GPS, IMU and ego message, and how many there were of each."""
    seen: dict[str, list[dict[str, Any]]] = {"gps": [], "imu": [], "Ego_topic": []}
    for name, type_name in (
        ("gps", "morai_msgs/GPSMessage"),
        ("imu", "sensor_msgs/Imu"),
        ("Ego_topic", "morai_msgs/EgoVehicleStatus"),
    ):
        roslibpy.Topic(ros, f"/{name}", type_name).subscribe(seen[name].append)
    mount = roslibpy.Topic(ros, "/SensorPosControl", "morai_msgs/SensorPosControl")
    place = {"pose_x": [1.5], "pose_y": [0.0], "pose_z": [1.75], "roll": [0.0], "pitch": [0.0], "yaw": [0.0]}
    mount.publish(roslibpy.Message({"sensor_index": [0], **place}))

    def ask(service: str, **request: object) -> dict[str, Any]:
        answer: dict[str, Any] = roslibpy.Service(ros, service, "").call({"request": request}, timeout=PATIENCE)
        return answer

    frame = ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)["response"]["frame"]
    for i in range(1, FRAMES + 1):
        command = {"longlCmdType": 2, "velocity": 40.0, "steering": 0.1}
        ask("/SyncModeCtrlCmd", frame=frame + i, command=command, sensor_capture=i == FRAMES)
        ask("/SyncModeWaitForTick", user_id="me", frame=frame + i)
    shot = roslibpy.Topic(ros, "/SaveSensorData", "morai_msgs/SaveSensorData")
    shot.publish(roslibpy.Message({"is_custom_file_name": True, "custom_file_name": "shot", "file_dir": folder}))
    ros.get_nodes()  # answered after all that was sent before
    say(counts={name: len(messages) for name, messages in seen.items()}, **{n: m[-1] for n, m in seen.items()})


run(save=save)
