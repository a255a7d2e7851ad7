"""Differences between releases of MORAI SIM, and between its manual and published client code.

A release is a folder of definitions in `schemas/` and its entries here; there is no `if` for a release anywhere else.
`Profile` holds the choices of units and orders. `LENIENCY` holds the names and shapes that the manual, or another
release, uses instead of the wire's. They are accepted from clients and never sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

from rosbridge_sim.records import Record, replace
from rosbridge_sim.schema.definitions.dialect import Leniency

# Names

_DOCUMENTED = (
    *("CollisionData", "CtrlCmd", "EgoVehicleStatus", "EventInfo", "GetTrafficLightStatus", "IntersectionControl"),
    *("IntersectionStatus", "Lamps", "MapSpec", "MapSpecIndex", "MoraiSimProcHandle", "MoraiSimProcStatus"),
    *("MoraiSrvResponse", "MoraiTLIndex", "MoraiTLInfo", "MultiEgoSetting", "ObjectStatus", "ObjectStatusList"),
    *("ReplayInfo", "SaveSensorData", "ScenarioLoad", "SensorPosControl", "SetTrafficLight", "SyncModeAddObj"),
    *("SyncModeCmd", "SyncModeCmdResponse", "SyncModeCtrlCmd", "SyncModeInfo", "SyncModeRemoveObj"),
    *("SyncModeResultResponse", "SyncModeScenarioLoad", "SyncModeSetGear", "VehicleCollision", "VehicleCollisionData"),
    *("VehicleSpec", "VehicleSpecIndex", "WaitForTick", "WaitForTickResponse"),
    *("SyncModeAddObject", "SyncModeRemoveObject", "MoraiSyncModeAddObjectSrv", "MoraiSyncModeRemoveObjectSrv"),
    *("MoraiEventCmdSrv", "MoraiMapSpecSrv", "MoraiScenarioLoadSrv", "MoraiSimProcSrv", "MoraiSyncModeCmdSrv"),
    *("MoraiSyncModeCtrlCmdSrv", "MoraiSyncModeSLSrv", "MoraiSyncModeSetGearSrv", "MoraiTLInfoSrv"),
    *("MoraiVehicleSpecSrv", "MoraiWaitForTickSrv"),
)
"""The types of the manual pages, and the types that replace one of them in newer releases."""

_SCENARIO_LOAD: Final = {
    "load_object_data": "load_obstacle_data",
    "load_network_connection": "load_network_connection_data",
}

_LISTS: Final = frozenset({"npc_list", "pedestrian_list", "obstacle_list"})

_FIELDS_ONLY_IN: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "22.R2": {"EgoVehicleStatus": ("wheel_angle",)},
    "26.R1": {
        "CollisionData": ("collision_objecta",),
        "CtrlCmd": ("rear_steer",),
        "EgoVehicleStatus": (
            *("front_steer_angle", "rear_steer_angle", "lateral_offset", "cross_track_error"),
            *(f"tire_lateral_force_{wheel}" for wheel in ("fl", "fr", "rl", "rr")),
            *(f"side_slip_angle_{wheel}" for wheel in ("fl", "fr", "rl", "rr")),
            *(f"tire_cornering_stiffness_{wheel}" for wheel in ("fl", "fr", "rl", "rr")),
            *("distance_left_lane_boundary", "distance_right_lane_boundary"),
        ),
        "MultiEgoSetting": ("steering_angle", "vehicle_speed", "turn_signal", "brake_light"),
        "NpcGhostInfo": ("steering_angle", "vehicle_speed", "turn_signal", "brake_light"),
    },
}
"""Fields of types of `morai_msgs` in several releases that only one of them has, under any name."""


def _only(release: str) -> str:
    return f"; only release {release} has it (serve --release {release})"


LENIENCY: Final = Leniency(
    types={
        # The manual's page on ROS writes the package name without its s.
        **{f"morai_msg/{name}": f"morai_msgs/{name}" for name in _DOCUMENTED},
        # The manual's page on synchronous mode omits a prefix.
        "morai_msgs/SyncModeSLSrv": "morai_msgs/MoraiSyncModeSLSrv",
        "morai_msg/SyncModeSLSrv": "morai_msgs/MoraiSyncModeSLSrv",
        # The type of /tf before tf2; it has the same fields, and old programs still use it.
        "tf/tfMessage": "tf2_msgs/TFMessage",
    },
    fields={
        # 26.R1 renamed the steering. The name that a release lacks is read as the other one.
        "morai_msgs/CtrlCmd": {"longCmdType": "longlCmdType", "front_steer": "steering", "steering": "front_steer"},
        "morai_msgs/ScenarioLoad": _SCENARIO_LOAD,
        "morai_msgs/SyncModeScenarioLoad": _SCENARIO_LOAD,
    },
    scalars={
        "morai_msgs/SensorPosControl": frozenset(
            {"sensor_index", "pose_x", "pose_y", "pose_z", "roll", "pitch", "yaw"}
        ),
        # The manual omits the brackets of some lists.
        "morai_msgs/ObjectStatusList": _LISTS,
        "morai_msgs/ReplayInfo": _LISTS,
    },
    numerals={
        "morai_msgs/IntersectionControl": frozenset({"intersection_index"}),
        "morai_msgs/IntersectionStatus": frozenset({"intersection_index"}),
    },
    elsewhere={
        f"morai_msgs/{kind}": {
            name: _only(release) for release, kinds in _FIELDS_ONLY_IN.items() for name in kinds.get(kind, ())
        }
        for kind in sorted({kind for kinds in _FIELDS_ONLY_IN.values() for kind in kinds})
    },
)
"""Names and shapes that are accepted in addition to the wire's own."""


_ONLY_IN: Final[Mapping[str, frozenset[str]]] = {
    "22.R2": frozenset({"SyncModeAddObj", "SyncModeRemoveObj"}),
    "26.R1": frozenset(
        {
            *("CMDConveyor", "Conveyor", "DillyCmd", "DillyCmdResponse", "EgoVehicleStatusExtended"),
            *("ExternalForce", "FaultInjectionCtrlSrv", "FaultInjectionSensorSrv", "FaultInjectionTireSrv"),
            *("FaultInjection_Controller", "FaultInjection_Response", "FaultInjection_Sensor"),
            *("FaultInjection_Tire", "FaultStatusInfo", "FaultStatusInfo_Overall", "FaultStatusInfo_Sensor"),
            *("FaultStatusInfo_Vehicle", "GVDirectCmd", "GVStateCmd", "GeoVector3Message", "ManipulatorControl"),
            *("MoraiSyncModeAddObjectSrv", "MoraiSyncModeRemoveObjectSrv", "MultiPlayEventRequest"),
            *("MultiPlayEventResponse", "MultiPlayEventSrv", "ObjectStatusExtended", "ObjectStatusListExtended"),
            *("Obstacle", "Obstacles", "RobotOutput", "RobotState", "SVADC", "ShipCtrlCmd", "ShipState"),
            *("SkateboardCtrlCmd", "SkateboardStatus", "SkidSteer6wUGVCtrlCmd", "SkidSteer6wUGVStatus"),
            *("SyncModeAddObject", "SyncModeRemoveObject", "TOF", "Transforms", "UGVServeSkidCtrlCmd"),
            *("VelocityCmd", "WheelControl", "WoowaDillyEventCmdSrv", "WoowaDillyStatus"),
        }
    ),
}
"""Types of `morai_msgs` that only one release has."""

_RENAMED: Final[Mapping[str, tuple[str, str]]] = {
    "/SyncModeAddObj": ("22.R2", "the service /SyncModeAddObject"),
    "/SyncModeRemoveObj": ("22.R2", "the service /SyncModeRemoveObject"),
    "/SyncModeAddObject": ("26.R1", "the topic /SyncModeAddObj"),
    "/SyncModeRemoveObject": ("26.R1", "the topic /SyncModeRemoveObj"),
}
"""Topic or service that only one release has -> that release, and what the others have instead."""


def advise_release(name: str) -> str:
    """Return which release has a name that the chosen release lacks, for the end of an error.

    Args:
        name: a topic or a service, such as `/SyncModeAddObject`, or a type, such as `morai_msgs/SyncModeAddObject`.

    Returns:
        The end of a sentence; empty for a name that no release has.
    """
    if name in _RENAMED:
        release, instead = _RENAMED[name]
        return f"{_only(release)}, here it is {instead}"
    package, _, kind = name.partition("/")
    kind = kind.removeprefix("msg/").removeprefix("srv/")
    release = next((each for each, kinds in _ONLY_IN.items() if package == "morai_msgs" and kind in kinds), "")
    return _only(release) if release else ""


# Units


class Profile(Record):
    """Choices for outgoing values where the manual and published client code disagree.

    Attributes:
        wheel_angle_unit: of EgoVehicleStatus.wheel_angle.
        object_size_order: order of x, y, z in ObjectStatus.size.
        object_limit: largest number of listed objects, those nearest to the ego of the list; 0 lists all.
        object_velocity_unit: of ObjectStatus.velocity.
        object_range: only objects within this distance of the ego are listed, between the reference points and in the
            plane; 0 lists all [m].
    """

    wheel_angle_unit: Literal["rad", "deg"] = "rad"
    object_size_order: Literal["width-length-height", "length-width-height"] = "width-length-height"
    object_limit: int = 0
    object_velocity_unit: Literal["km/h", "m/s"] = "km/h"
    object_range: float = 0.0


MANUAL: Final = Profile()
"""The choices of the manual pages."""

FIELD: Final = Profile("deg", "length-width-height", 20, "km/h")
"""The choices that most published clients expect."""

RELEASES: Final[Mapping[str, Profile]] = {"22.R2": MANUAL, "26.R1": replace(MANUAL, object_limit=20)}
"""Choices of each release; the fields and names of a release are in `schemas/`."""

SpeedLimits = tuple[float, float]
"""Largest acceleration and deceleration of the speed mode, `longlCmdType` 2 [m/s^2]."""

SPEED_LIMITS: Final[Mapping[str, SpeedLimits]] = {"26.R1": (1.0, 2.0)}
"""Limits of the releases that have any, as MORAI SIM has since 23.R1.0. In others the mode uses all that the car can
do."""


def choose_profile(name: Literal["manual", "field"], release: str = "22.R2", **own: object) -> Profile:
    """Return a named profile with some choices replaced.

    Args:
        name: `manual` for the manual of the release, `field` for published client code.
        release: of MORAI SIM.
        own: fields of `Profile`; None leaves a choice to the profile.
    """
    chosen = {key: value for key, value in own.items() if value is not None}
    return replace({"manual": RELEASES[release], "field": FIELD}[name], **chosen)
