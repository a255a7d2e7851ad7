"""Message bodies for the benchmarks: complete, with fields in the types' order, and with realistic digits."""

from __future__ import annotations

import base64
import random

Json = dict[str, object]

_rng = random.Random(7)  # noqa: S311 - nothing to guess here


def _number() -> float:
    return _rng.uniform(-100, 100)


def _vector() -> Json:
    return {"x": _number(), "y": _number(), "z": _number()}


def _header(frame_id: str) -> Json:
    return {"seq": 4711, "stamp": {"secs": 1_700_000_000, "nsecs": 123_456_789}, "frame_id": frame_id}


def text() -> Json:
    """Return a std_msgs/String that makes a publish frame of 94 bytes on the topic `/bench`.

    Returns:
        The body.
    """
    return {"data": "The quick brown fox jumps over the lazy dog"}


def control() -> Json:
    """Return a morai_msgs/CtrlCmd.

    Returns:
        The body.
    """
    return {
        "longlCmdType": 1,
        "accel": 0.4251,
        "brake": 0.0,
        "steering": -0.034907,
        "velocity": 0.0,
        "acceleration": 0.0,
    }


def ego() -> Json:
    """Return a morai_msgs/EgoVehicleStatus of 22.R2.

    Returns:
        The body.
    """
    return {
        "header": _header("Ego"),
        "unique_id": 1,
        "acceleration": _vector(),
        "position": _vector(),
        "velocity": _vector(),
        "heading": _number(),
        "accel": 0.25,
        "brake": 0.0,
        "wheel_angle": -0.125,
    }


def objects(num: int) -> Json:
    """Return a morai_msgs/ObjectStatusList; two vehicles make 0.9 kB, as long as an EgoVehicleStatus of 26.R1.

    Args:
        num: number of vehicles.

    Returns:
        The body.
    """
    return {
        "header": _header("map"),
        "num_of_npcs": num,
        "num_of_pedestrian": 0,
        "num_of_obstacle": 0,
        "npc_list": [
            {
                "unique_id": 10 + i,
                "type": 1,
                "name": "2016_Hyundai_Ioniq",
                "heading": _number(),
                "velocity": _vector(),
                "acceleration": _vector(),
                "size": {"x": 1.82, "y": 4.47, "z": 1.45},
                "position": _vector(),
            }
            for i in range(num)
        ],
        "pedestrian_list": [],
        "obstacle_list": [],
    }


def odometry() -> Json:
    """Return a nav_msgs/Odometry with both covariances.

    Returns:
        The body.
    """
    diagonal = [0.01 if i % 7 == 0 else 0.0 for i in range(36)]
    return {
        "header": _header("odom"),
        "child_frame_id": "base_link",
        "pose": {
            "pose": {"position": _vector(), "orientation": {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}},
            "covariance": diagonal,
        },
        "twist": {
            "twist": {"linear": {"x": _number(), "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": _number()}},
            "covariance": diagonal,
        },
    }


def image() -> Json:
    """Return a sensor_msgs/CompressedImage; its frame is 100 kB long.

    Returns:
        The body.
    """
    return {"header": _header("camera"), "format": "jpeg", "data": base64.b64encode(_rng.randbytes(74_880)).decode()}
