"""Content of MORAI's two manual pages on ROS: every topic, service and table of fields, as spelt there.

Where the pages and the messages on the wire disagree, `SLIPS` and `RENAMED` say so; nothing else may.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

__all__ = ["INTERFACES", "RELEASES", "RENAMED", "REPLACED", "SLIPS", "TABLES", "Interface", "Way"]

RELEASES: Final = ("22.R2", "26.R1")

Way = Literal["to the simulator", "from the simulator", "service"]


@dataclass(frozen=True, slots=True)
class Interface:
    """A topic or service of the pages: default name, type as spelt there, and which way it goes."""

    name: str
    type: str
    way: Way


_TO: Final = "to the simulator"
_FROM: Final = "from the simulator"
_SERVICE: Final = "service"

INTERFACES: Final[tuple[Interface, ...]] = (
    # Setting up a ROS network
    Interface("/ctrl_cmd", "morai_msg/CtrlCmd", _TO),
    Interface("/Ego_topic", "morai_msgs/EgoVehicleStatus", _FROM),
    Interface("/Object_topic", "morai_msgs/ObjectStatusList", _FROM),
    Interface("/ego_setting", "morai_msgs/MultiEgoSetting", _TO),
    Interface("/CollisionData", "morai_msgs/CollisionData", _FROM),
    Interface("/VehicleCollisionData", "morai_msgs/VehicleCollisionData", _FROM),
    Interface("/GetTrafficLightStatus", "morai_msgs/GetTrafficLightStatus", _FROM),
    Interface("/SetTrafficLight", "morai_msgs/SetTrafficLight", _TO),
    Interface("/InsnStatus", "morai_msgs/IntersectionStatus", _FROM),
    Interface("/InsnControl", "morai_msgs/IntersectionControl", _TO),
    Interface("/ScenarioLoad", "morai_msgs/ScenarioLoad", _TO),
    Interface("/SaveSensorData", "morai_msgs/SaveSensorData", _TO),
    Interface("/lamps", "morai_msgs/Lamps", _TO),
    Interface("/ReplayInfo_topic", "morai_msgs/ReplayInfo", _FROM),
    Interface("/sim/process/state/msg/MoraiSimProcStatus", "morai_msgs/MoraiSimProcStatus", _FROM),
    Interface("/SensorPosControl", "morai_msgs/SensorPosControl", _TO),
    Interface("/Morai_SimProc", "morai_msgs/srv/MoraiSimProcSrv", _SERVICE),
    Interface("/Service_MoraiSL", "morai_msgs/srv/MoraiScenarioLoadSrv", _SERVICE),
    Interface("/Morai_TLSrv", "morai_msgs/srv/MoraiTLInfoSrv", _SERVICE),
    Interface("/Service_MoraiEventCmd", "morai_msgs/srv/MoraiEventCmdSrv", _SERVICE),
    Interface("/Service_MoraiVehicleSpec", "morai_msgs/srv/MoraiVehicleSpecSrv", _SERVICE),
    Interface("/Service_MoraiMapSpec", "morai_msgs/srv/MoraiMapSpecSrv", _SERVICE),
    # Synchronous mode
    Interface("/SyncModeCmd", "morai_msgs/srv/MoraiSyncModeCmdSrv", _SERVICE),
    Interface("/SyncModeWaitForTick", "morai_msgs/srv/MoraiWaitForTickSrv", _SERVICE),
    Interface("/SyncModeCtrlCmd", "morai_msgs/srv/MoraiSyncModeCtrlCmdSrv", _SERVICE),
    Interface("/SyncModeSetGear", "morai_msgs/srv/MoraiSyncModeSetGearSrv", _SERVICE),
    Interface("/SyncModeScenarioLoad", "morai_msgs/srv/SyncModeSLSrv", _SERVICE),
    Interface("/SyncModeInfo", "morai_msgs/msg/SyncModeInfo", _FROM),
    Interface("/SyncModeAddObj", "morai_msgs/msg/SyncModeAddObj", _TO),
    Interface("/SyncModeRemoveObj", "morai_msgs/msg/SyncModeRemoveObj", _TO),
)

REPLACED: Final = {
    "/SyncModeAddObj": Interface("/SyncModeAddObject", "morai_msgs/srv/MoraiSyncModeAddObjectSrv", _SERVICE),
    "/SyncModeRemoveObj": Interface("/SyncModeRemoveObject", "morai_msgs/srv/MoraiSyncModeRemoveObjectSrv", _SERVICE),
}
"""What 26.R1 has in place of two topics: services of the same fields."""


def _fields(*names: str) -> tuple[tuple[str, str], ...]:
    """`int32 gear` -> (`int32`, `gear`)."""
    pairs = (name.split() for name in names)
    return tuple((kind, name) for kind, name in pairs)


_POSE_LISTS = ("float32[] global_roll", "float32[] global_pitch", "float32[] global_yaw", "float32[] velocity")
_OBJECT_LISTS = (
    *("int32 num_of_npcs", "int32 num_of_pedestrian", "int32 num_of_obstacle"),
    *("ObjectStatus npc_list", "ObjectStatus pedestrian_list", "ObjectStatus obstacle_list"),
)

TABLES: Final[dict[str, tuple[tuple[str, str], ...]]] = {
    # Setting up a ROS network
    "morai_msg/CtrlCmd": _fields(
        *("int32 longCmdType", "float64 accel", "float64 brake", "float64 steering"),
        *("float64 velocity", "float64 acceleration"),
    ),
    "morai_msgs/EgoVehicleStatus": _fields(
        *("Header header", "int32 unique_id", "Vector3 acceleration", "Vector3 position", "Vector3 velocity"),
        *("float64 heading", "float32 accel", "float32 brake", "float32 wheel_angle"),
    ),
    "morai_msgs/ObjectStatusList": _fields("Header header", *_OBJECT_LISTS),
    "morai_msgs/ObjectStatus": _fields(
        *("int32 unique_id", "int32 type", "string name", "float64 heading"),
        *("Vector3 velocity", "Vector3 acceleration", "Vector3 size", "Vector3 position"),
    ),
    "morai_msgs/MultiEgoSetting": _fields(
        *("int32 number_of_ego_vehicle", "int32 camera_index", "int32[] ego_index"),
        *("float64[] global_position_x", "float64[] global_position_y", "float64[] global_position_z"),
        *_POSE_LISTS,
        *("int8[] gear", "int8[] ctrl_mode"),
    ),
    "morai_msgs/CollisionData": _fields(
        *("Header header", "float32 global_offset_x", "float32 global_offset_y", "float32 global_offset_z"),
        "ObjectStatus[] collision_object",
    ),
    "morai_msgs/VehicleCollisionData": _fields("Header header", "VehicleCollision[] collisions"),
    "morai_msgs/VehicleCollision": _fields("ObjectStatus[] crashed_vehicles"),
    "morai_msgs/GetTrafficLightStatus": _fields(
        *("Header header", "string trafficLightIndex", "int16 trafficLightType", "int16 trafficLightStatus"),
    ),
    "morai_msgs/SetTrafficLight": _fields("string trafficLightIndex", "int16 trafficLightStatus"),
    "morai_msgs/IntersectionStatus": _fields(
        *("Header header", "string intersection_index", "int16 intersection_status"),
        "float32 intersection_status_time",
    ),
    "morai_msgs/IntersectionControl": _fields(
        *("Header header", "string intersection_index", "int16 intersection_status"),
        "float32 intersection_status_time",
    ),
    "morai_msgs/ScenarioLoad": _fields(
        *("string file_name", "bool delete_all", "bool load_network_connection_data", "bool load_ego_vehicle_data"),
        *("bool load_surrounding_vehicle_data", "bool load_pedestrian_data", "bool load_object_data"),
        "bool set_pause",
    ),
    "morai_msgs/SaveSensorData": _fields("bool is_custom_file_name", "string custom_file_name", "string file_dir"),
    "morai_msgs/Lamps": _fields("Header header", "int8 turnSignal", "int8 emergencySignal"),
    "morai_msgs/ReplayInfo": _fields(
        *("Header header", "float64 ego_acc", "float64 ego_brake", "float64 ego_steer", "Quaternion orientation"),
        *("Vector3 linear_acceleration", "Vector3 angular_velocity"),
        *_OBJECT_LISTS,
    ),
    "morai_msgs/MoraiSimProcStatus": _fields(
        *("Header header", "Time latest_command_time", "int8 command_result", "int8 current_mode"),
        "int8 current_status",
    ),
    "morai_msgs/SensorPosControl": _fields(
        *("int16 sensor_index", "float32 pose_x", "float32 pose_y", "float32 pose_z"),
        *("float32 roll", "float32 pitch", "float32 yaw"),
    ),
    "morai_msgs/MoraiSrvResponse": _fields("bool result"),
    "morai_msgs/srv/MoraiSimProcSrv": _fields("MoraiSimProcHandle request", "MoraiSrvResponse response"),
    "morai_msgs/srv/MoraiScenarioLoadSrv": _fields("ScenarioLoad request", "MoraiSrvResponse response"),
    "morai_msgs/srv/MoraiTLInfoSrv": _fields("MoraiTLIndex request", "MoraiTLInfo response"),
    "morai_msgs/srv/MoraiEventCmdSrv": _fields("EventInfo request", "MoraiEventCmdSrv response"),
    "morai_msgs/srv/MoraiVehicleSpecSrv": _fields("VehicleSpecIndex request", "VehicleSpec response"),
    "morai_msgs/srv/MoraiMapSpecSrv": _fields("MapSpecIndex request", "MapSpec response"),
    # Synchronous mode
    "morai_msgs/msg/SyncModeCmd": _fields("string user_id", "bool start_sync_mode", "uint32 time_step"),
    "morai_msgs/msg/SyncModeCmdResponse": _fields("string user_id", "uint64 frame", "bool result", "unit32 time_step"),
    "morai_msgs/msg/WaitForTick": _fields("string user_id", "uint64 frame"),
    "morai_msgs/msg/WaitForTickResponse": _fields(
        *("bool tick_status", "bool pause_status", "uint64 frame", "EgoVehicleStatus vehicle_status"),
        "string time",
    ),
    "morai_msgs/msg/SyncModeCtrlCmd": _fields("uint64 frame", "CtrlCmd command", "bool sensor_capture"),
    "morai_msgs/msg/SyncModeResultResponse": _fields("bool result"),
    "morai_msgs/msg/SyncModeSetGear": _fields("int32 gear", "uint64 frame"),
    "morai_msgs/msg/SyncModeScenarioLoad": _fields(
        *("uint64 frame", "string file_name", "bool delete_all", "bool load_network_connection"),
        *("bool load_ego_vehicle_data", "bool load_surrounding_vehicle_data", "bool load_pedestrian_data"),
        *("bool load_obstacle_data", "bool set_pause"),
    ),
    "morai_msgs/msg/SyncModeInfo": _fields("string master_id", "bool status", "uint64 frame", "bool can_send_tick"),
    "morai_msgs/msg/SyncModeAddObj": _fields("string name", "Vector3 position", "float64 heading", "uint64 frame"),
    "morai_msgs/msg/SyncModeRemoveObj": _fields("int32 unique_id", "uint64 frame"),
    # Its services, whose requests and responses it names in a line each.
    "morai_msgs/srv/MoraiSyncModeCmdSrv": _fields("SyncModeCmd request", "SyncModeCmdResponse response"),
    "morai_msgs/srv/MoraiWaitForTickSrv": _fields("WaitForTick request", "WaitForTickResponse response"),
    "morai_msgs/srv/MoraiSyncModeCtrlCmdSrv": _fields("SyncModeCtrlCmd request", "SyncModeResultResponse response"),
    "morai_msgs/srv/MoraiSyncModeSetGearSrv": _fields("SyncModeSetGear request", "SyncModeResultResponse response"),
    "morai_msgs/srv/SyncModeSLSrv": _fields("SyncModeScenarioLoad request", "SyncModeResultResponse response"),
}
"""Type -> (type, name) of each field. A service's are its request and its response."""

_LIST = dict.fromkeys(("npc_list", "pedestrian_list", "obstacle_list"), "ObjectStatus[]")

SLIPS: Final[dict[str, dict[str, str]]] = {
    "morai_msgs/ObjectStatusList": _LIST,
    "morai_msgs/ReplayInfo": _LIST,
    "morai_msgs/CollisionData": dict.fromkeys(("global_offset_x", "global_offset_y", "global_offset_z"), "float64"),
    "morai_msgs/IntersectionStatus": {"intersection_index": "int32"},
    "morai_msgs/IntersectionControl": {"intersection_index": "int32"},
    "morai_msgs/MoraiSimProcStatus": dict.fromkeys(("command_result", "current_mode", "current_status"), "uint8"),
    "morai_msgs/SensorPosControl": {
        "sensor_index": "int16[]",
        **dict.fromkeys(("pose_x", "pose_y", "pose_z", "roll", "pitch", "yaw"), "float32[]"),
    },
    "morai_msgs/srv/MoraiEventCmdSrv": {"response": "EventInfo"},
    "morai_msgs/msg/SyncModeCmdResponse": {"time_step": "uint32"},
}
"""Type -> field -> the type that it has on the wire, where the pages say another."""

RENAMED: Final[dict[tuple[str, str], dict[str, str]]] = {
    ("morai_msgs/CtrlCmd", "longCmdType"): {"22.R2": "longlCmdType", "26.R1": "longlCmdType"},
    ("morai_msgs/CtrlCmd", "steering"): {"26.R1": "front_steer"},
    ("morai_msgs/EgoVehicleStatus", "wheel_angle"): {"26.R1": "front_steer_angle"},
    ("morai_msgs/ScenarioLoad", "load_object_data"): {"22.R2": "load_obstacle_data", "26.R1": "load_obstacle_data"},
    ("morai_msgs/SyncModeScenarioLoad", "load_network_connection"): {
        "22.R2": "load_network_connection_data",
        "26.R1": "load_network_connection_data",
    },
}
"""(type, field of the pages) -> release -> what the wire calls it."""
