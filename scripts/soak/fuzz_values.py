"""Values for the fuzzer: plausible names, types and values, and some that fit nowhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

OWN_TOPICS: Final = ("/f0", "/f1", "f2", "/f3/deep/er", "/tf", "/odom", "/image")
OWN_SERVICES: Final = ("/s0", "/s1", "s2", "/f0")
OWN_ACTIONS: Final = ("/a0", "a1", "/fibonacci")
"""Names that all fuzzing clients share, so that they affect each other."""

ODD_NAMES: Final = (
    *("", " ", "/", "//", "~", "~x", "/a//b", "/a/", "a b", "/\x00", "/\u00e9", "/\ud55c\uad6d\uc5b4", "/\U0001f697"),
    *("/" + "n" * 300, "/" + "d/" * 400, "../../etc/passwd", "/%s%n", "/{}", "/*", "/Ego-2/ctrl_cmd"),
    "/Ego-99/Ego_topic",
    *("/rosapi", "/rosapi/", "/rosapi/nothing", "/sim/nothing", "Ego_topic", "/ego_topic", "/ctrl_cmd#7", "\ud800"),
)  # fmt: skip

ODD_TYPES: Final = (
    *("my_package/Own", "my_package/msg/Own", "std_msgs/Nothing", "std_msgs", "/", "", "a/b/c", "std_msgs/msg/", "*"),
    *("std_msgs/String[]", "std_msgs/srv/String", "morai_msg/CtrlCmd", "\u00fc/\u00fc", "x" * 500, "rosgraph_msgs/Log"),
)

ODD: Final[tuple[Any, ...]] = (
    *(None, True, False, 0, -1, 1, 2, 20, 2**31 - 1, 2**31, -(2**31), 2**32, 2**53 + 1, 2**63, 2**64, -(2**63) - 1),
    *(10**400, 0.5, -0.0, 1e308, -1e308, 1e-320, float("nan"), float("inf"), -float("inf")),
    *("", " ", "/", "\x00", "\ud800", "x" * 5000, "now", "NaN", "1e5", "Infinity", "AAAA", "A", "0x10"),
    *([], [[]], [None], [0] * 300, [1e308] * 3, ["x"] * 9, {}, {"request": None}, {"": {"": {}}}),
    {"x": {}, "secs": -1},
)  # fmt: skip
"""Values that fit nowhere, or that are too large."""

ODD_TEXTS: Final = (
    *("", " ", "{", "}", "{}", "[]", "null", "NaN", '"op"', "{{}}", '{"op":}', '{"op":"publish"', '{"receiver":"/x"}'),
    *("[" * 3000, '{"a":' * 3000, '{"op":"publish","op":"subscribe","topic":"/f0"}', "\ufeff{}", '{"op":"unheard_of"}'),
    *('{"op":"subscribe","topic":"/f0\\ud800"}', '{"op":"call_service","service":"/rosapi/topics"}' * 20),
    '{"op":"publish","topic":"/f0","msg":{"data":"' + "y" * 20_000 + '"}}',
    '{"op":"publish","topic":"/f0","msg":' + "[" * 900 + "]" * 900 + "}",
    '{"op":"call_service","service":"/s0","id":' + "9" * 5000 + "}",
)

PLAUSIBLE: Final[Mapping[str, tuple[Any, ...]]] = {
    "user_id": ("fuzz", "fuzz", "other", ""),
    "frame": (0, 1, 2, 3, 10, 50, 200, 1000, 9000, 10**6, -1),
    "time_step": (20, 20, 20, 40, 100, 0, 1000, 30),
    "start_sync_mode": (True, True, False),
    "file_name": (
        "demo",
        "town",
        "loop",
        "busy",
        "saved",
        "junction",
        "torn",
        "deep",
        "no_link",
        "nowhere",
        "../x",
        "",
    ),
    "rosbag_file_name": (
        "drive",
        "drive.bag",
        "other.mcap",
        "broken0",
        "broken1.bag",
        "broken2",
        "nowhere",
        "../x",
        "",
    ),
    "unique_id": (0, 1, 2, 3, 4, 5, 7, 10, 20, -1, 100_000),
    "name": ("Box", "Man", "Bus", "2016_Hyundai_Ioniq", "WoodBox", "Nobody", ""),
    "option": (0, 1, 2, 3, 4, 8, 15, 16, -1),
    "ctrl_mode": (1, 3, 4, 6, 16, 0, 2),
    "gear": (1, 2, 3, 4, 4, 0, -1, 9),
    "set_pause": (False, False, True),
    "longlCmdType": (0, 1, 1, 2, 3, 4, -1),
    "velocity": (0.0, 10.0, 50.0, 300.0, -20.0),
    "accel": (0.0, 0.3, 1.0, -1.0, 5.0),
    "brake": (0.0, 0.0, 1.0, -1.0),
    "steering": (0.0, 0.1, -0.3, 3.0),
    "ego_index": (0, 2, 3, -1, 1, 4),
    "number_of_ego_vehicle": (1, 2, 3, 0, -1),
    "sim_process_status": (1, 1, 2, 32, 0, 16),
    "replay_option": (0, 1, 3, 5, 7, 15, 8, 2, 4, 16),
    "replay_target_option": (1, 2, 4, 7, 0, 8),
    "replay_speed": (1, 2, 10, 0, -1, 100),
    "start_time": (0, 10, 500, 5000, -1, 2**31 - 1),
    "sensor_index": (0, 1, 2, -1),
    "trafficLightIndex": ("C1", "L1", "SN000000", "TL0", "", "C11", "IntTL0"),
    "traffic_light_index": ("C1", "L1", "", "C11"),
    "trafficLightStatus": (1, 4, 16, 32, 48, -1, 0, 7),
    "intersection_index": (0, 1, 2, 13, -1, 99),
    "intersection_status": (0, 1, 2, 3, -1, 99),
    "intersection_status_time": (0.0, 1.0, 100.0, -1.0),
    "turnSignal": (0, 1, 2, 3),
    "emergencySignal": (0, 1, 2),
    "seed": (-1, 0, 1, 5),
    "topic": ("/Ego_topic", "/f0", "/tf", "/nothing"),
    "service": ("/SyncModeCmd", "/s0", "/rosapi/topics", "/nothing"),
    "action": ("/a0", "/nothing"),
    "node": ("/rosapi", "/morai_sim", "/rosbridge_websocket", "/nobody"),
    "type": ("std_msgs/String", "morai_msgs/EgoVehicleStatus", "sensor_msgs/msg/Image", "my/Own", "rosapi/Topics"),
    "value": ("1", '"x"', "{}", '{"a": {"b": [1, 2]}}', "nonsense", "NaN", "1e400", ""),
    "default_value": ("", "1", "{}", "x"),
    "frame_id": ("map", "base_link", "", "/odom"),
    "child_frame_id": ("base_link", "gps_link", "own", "map"),
    "source_frames": ("base_link", "gps_link", "own"),
    "target_frame": ("map", "base_link", "nothing"),
    "angular_thres": (0.0, 0.1),
    "rate": (0.0, 5.0, 1e9),
    "custom_file_name": ("a", "run/1", "../x", "", "/etc/x"),
    "file_dir": ("a", "", "../x", "SaveFile/b"),
}
"""Values by the names of fields: mostly values that have an effect on the simulator."""

ENCODINGS: Final = ("none", "none", "cbor", "cbor-raw", "png", "zip", "")
