"""What differs from release to release of MORAI SIM, and from its manual to the programs in the field.

A release is a folder of definitions in `schemas/` and what stands here, and nowhere is there an `if` for one.
`Profile` holds the choices of units and orders that differ. `LENIENCY` holds the names and shapes that the manual pages
(or another release) use in place of the wire's; they are accepted on the way in and never sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from rosbridge_sim.schema.dialect import Leniency

__all__ = [
    "FIELD",
    "LENIENCY",
    "MANUAL",
    "RELEASES",
    "SPEED_LIMITS",
    "Profile",
    "SpeedLimits",
    "choose_profile",
]

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
"""The types of the manual pages, and those that newer releases have in place of one."""

_SCENARIO_LOAD: Final = {
    "load_object_data": "load_obstacle_data",
    "load_network_connection": "load_network_connection_data",
}

_LISTS: Final = frozenset({"npc_list", "pedestrian_list", "obstacle_list"})

LENIENCY: Final = Leniency(
    types={
        # The page on ROS writes the package without its s.
        **{f"morai_msg/{name}": f"morai_msgs/{name}" for name in _DOCUMENTED},
        # The page on synchronous mode drops a prefix.
        "morai_msgs/SyncModeSLSrv": "morai_msgs/MoraiSyncModeSLSrv",
        "morai_msg/SyncModeSLSrv": "morai_msgs/MoraiSyncModeSLSrv",
        # What /tf was before tf2; the same fields, and old programs still say so.
        "tf/tfMessage": "tf2_msgs/TFMessage",
    },
    fields={
        # 26.R1 renamed the steering; whichever of the two a release lacks is taken for the other.
        "morai_msgs/CtrlCmd": {
            "longCmdType": "longlCmdType",
            "front_steer": "steering",
            "steering": "front_steer",
        },
        "morai_msgs/ScenarioLoad": _SCENARIO_LOAD,
        "morai_msgs/SyncModeScenarioLoad": _SCENARIO_LOAD,
    },
    scalars={
        "morai_msgs/SensorPosControl": frozenset(
            {"sensor_index", "pose_x", "pose_y", "pose_z", "roll", "pitch", "yaw"}
        ),
        # The pages print the brackets of some lists and forget those of others.
        "morai_msgs/ObjectStatusList": _LISTS,
        "morai_msgs/ReplayInfo": _LISTS,
    },
    numerals={
        "morai_msgs/IntersectionControl": frozenset({"intersection_index"}),
        "morai_msgs/IntersectionStatus": frozenset({"intersection_index"}),
    },
)
"""What is accepted beside the wire's own names and shapes."""


# Units


@dataclass(frozen=True, slots=True)
class Profile:
    """What goes out where the manual pages and clients in the field disagree.

    Attributes:
        wheel_angle_unit: of EgoVehicleStatus.wheel_angle.
        object_size_order: what x, y, z of ObjectStatus.size are.
        object_limit: how many objects are listed at most, those nearest to the ego whose list it is; 0 lists all.
        object_velocity_unit: of ObjectStatus.velocity.
    """

    wheel_angle_unit: Literal["rad", "deg"] = "rad"
    object_size_order: Literal["width-length-height", "length-width-height"] = "width-length-height"
    object_limit: int = 0
    object_velocity_unit: Literal["km/h", "m/s"] = "km/h"


MANUAL: Final = Profile()
"""As the manual pages say."""

FIELD: Final = Profile("deg", "length-width-height", 20, "km/h")
"""As most published clients read."""

RELEASES: Final[Mapping[str, Profile]] = {"22.R2": MANUAL, "26.R1": replace(MANUAL, object_limit=20)}
"""What releases say differently, beside the fields and names that stand in `schemas/`."""

SpeedLimits = tuple[float, float]
"""What the speed mode, `longlCmdType` 2, asks for at most: to go faster, and to go slower [m/s^2]."""

SPEED_LIMITS: Final[Mapping[str, SpeedLimits]] = {"26.R1": (1.0, 2.0)}
"""Of the releases that hold it back, as MORAI SIM does since 23.R1.0. In the others it does what the car can."""


def choose_profile(
    name: Literal["manual", "field"],
    release: str = "22.R2",
    *,
    wheel_angle_unit: Literal["rad", "deg"] | None = None,
    object_size_order: Literal["width-length-height", "length-width-height"] | None = None,
    object_limit: int | None = None,
    object_velocity_unit: Literal["km/h", "m/s"] | None = None,
) -> Profile:
    """A named profile with single choices of one's own; None leaves a choice to the profile.

    Args:
        name: `manual` means what the manual of the release says.
        release: of MORAI SIM.
        wheel_angle_unit: see `Profile`, as for the others.
        object_size_order: the same.
        object_limit: the same.
        object_velocity_unit: the same.
    """
    own = {
        "wheel_angle_unit": wheel_angle_unit,
        "object_size_order": object_size_order,
        "object_limit": object_limit,
        "object_velocity_unit": object_velocity_unit,
    }
    chosen: dict[str, Any] = {key: value for key, value in own.items() if value is not None}  # checked by their types
    return replace({"manual": RELEASES[release], "field": FIELD}[name], **chosen)
