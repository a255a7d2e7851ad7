"""The table of OpenSCENARIO's elements: which are read, with which attributes and parts, and which are refused.

A row is `Names: attributes parts`: elements that have the same share it. An attribute is `name:type` or
`name=word|word`, with `?` behind its name if it may be missing. A part is the name of an element: once, or with `?`
(may be missing), `*` (any number), or `(A|B)` (one of them). A catalogue reference may stand wherever its entry may.
The elements behind `!` are refused, those behind `~` are kept without effect and without looking into them. The names
are those of ASAM OpenSCENARIO XML 1.3; the versions before it have a part of them. Additions of MORAI are LinkPosition,
Evaluation with its groups, and SimulatorInfo.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from rosbridge_sim.records import Record

_RULE: Final = "rule=greaterThan|lessThan|equalTo|greaterOrEqual|lessOrEqual|notEqualTo"
_DIRECTED: Final = f"value:number {_RULE} direction?=longitudinal|lateral|vertical"
_DISTANCE: Final = (
    f"value:number {_RULE} freespace:bool alongRoute?:bool coordinateSystem?=entity|lane|road|trajectory|world"
    " relativeDistanceType?=longitudinal|lateral|cartesianDistance|euclidianDistance routingAlgorithm?:text"
)
_LIMITS: Final = (
    "maxSpeed?:number maxAcceleration?:number maxDeceleration?:number maxAccelerationRate?:number"
    " maxDecelerationRate?:number"
)
_PEDAL: Final = "active=false|0 value?:number maxRate?:number"  # one that a story sets is refused, not ignored

_TABLE: Final = f"""
OpenSCENARIO: FileHeader ParameterDeclarations? VariableDeclarations? MonitorDeclarations? CatalogLocations?
    RoadNetwork? Entities Storyboard Evaluation? SimulatorInfo?
FileHeader: revMajor:count revMinor:count date?:text description?:text author?:text License? Properties?
ParameterDeclarations: ParameterDeclaration*
ParameterDeclaration: name:text parameterType?:text value?:text ConstraintGroup*
VariableDeclarations: VariableDeclaration*
VariableDeclaration: name:text variableType?:text value:text
RoadNetwork: LogicFile? SceneGraphFile? TrafficSignals? UsedArea?
LogicFile: filepath:text
TrafficSignals: TrafficSignalController*
TrafficSignalController: name:text delay?:number reference?:text Phase*
Phase: name:text duration:number TrafficSignalState* TrafficSignalGroupState?
TrafficSignalState: trafficSignalId:text state:text
Entities: ScenarioObject* EntitySelection*
ScenarioObject: name:text (Vehicle|Pedestrian|MiscObject|ExternalObjectReference) ObjectController*
ObjectController: name?:text (Controller)
Controller: name:text controllerType?:text ParameterDeclarations? Properties?
Vehicle: name:text vehicleCategory:text model3d?:text mass?:number role?:text ParameterDeclarations? BoundingBox
    Performance Axles? Properties? TrailerHitch? TrailerCoupler? Trailer?
Pedestrian: name:text pedestrianCategory?:text model?:text model3d?:text mass?:number role?:text
    ParameterDeclarations? BoundingBox Properties?
MiscObject: name:text miscObjectCategory?:text model3d?:text mass?:number ParameterDeclarations? BoundingBox Properties?
BoundingBox: Center Dimensions
Center: x:number y:number z:number
Dimensions: length:number width:number height:number
Performance DynamicConstraints: {_LIMITS}
Axles: FrontAxle? RearAxle? AdditionalAxle*
FrontAxle RearAxle AdditionalAxle: maxSteering:number wheelDiameter:number trackWidth:number positionX:number
    positionZ:number wheelWidth?:number
Properties: Property* File* CustomContent*
Property: name:text value:text
Storyboard: Init Story* StopTrigger?
Init: Actions
Actions: GlobalAction* UserDefinedAction* Private*
Private: entityRef:entity PrivateAction*
Story: name?:text ParameterDeclarations? Act*
Act: name:text ManeuverGroup* StartTrigger? StopTrigger?
ManeuverGroup: name:text maximumExecutionCount?:count Actors Maneuver*
Actors: selectTriggeringEntities?=false EntityRef*
EntityRef FromCurrentEntity: entityRef:entity
Maneuver: name:text ParameterDeclarations? Event*
Event: name:text priority?=overwrite|override|skip|parallel maximumExecutionCount?:count Action* StartTrigger?
Action: name:text (PrivateAction|GlobalAction|UserDefinedAction)
StartTrigger StopTrigger: ConditionGroup*
ConditionGroup SuccessConditionGroup FailureConditionGroup: Condition*
Condition: name:label delay?:number conditionEdge?=rising|falling|risingOrFalling|none
    (ByEntityCondition|ByValueCondition)
PrivateAction: (LongitudinalAction|LateralAction|SynchronizeAction|ControllerAction|ActivateControllerAction
    |TeleportAction|RoutingAction|VisibilityAction|AppearanceAction|TrailerAction)
LongitudinalAction: (SpeedAction|LongitudinalDistanceAction|SpeedProfileAction)
LateralAction: (LaneChangeAction|LaneOffsetAction|LateralDistanceAction)
SpeedAction: SpeedActionDynamics SpeedActionTarget
SpeedActionDynamics LaneChangeActionDynamics: dynamicsShape=linear|cubic|sinusoidal|step
    dynamicsDimension=rate|time|distance value:number followingMode?:text
SpeedActionTarget: (AbsoluteTargetSpeed|RelativeTargetSpeed)
AbsoluteTargetSpeed AbsoluteTargetLaneOffset AddValue MultiplyByValue TraveledDistanceCondition: value:number
RelativeTargetSpeed: entityRef:entity value:number speedTargetValueType=delta|factor continuous:bool
LongitudinalDistanceAction: entityRef:entity continuous:bool freespace:bool distance?:number timeGap?:number
    coordinateSystem?=entity|road|lane displacement?=any|leadingReferencedEntity|trailingReferencedEntity
    DynamicConstraints?
SpeedProfileAction: followingMode=position|follow entityRef?:entity DynamicConstraints? SpeedProfileEntry*
SpeedProfileEntry: speed:number time?:number
LaneChangeAction: targetLaneOffset?:number LaneChangeActionDynamics LaneChangeTarget
LaneChangeTarget: (AbsoluteTargetLane|RelativeTargetLane)
AbsoluteTargetLane SetAction: value:text
RelativeTargetLane: entityRef:entity value:whole
LaneOffsetAction: continuous:bool LaneOffsetActionDynamics LaneOffsetTarget
LaneOffsetActionDynamics: dynamicsShape=linear|cubic|sinusoidal|step maxLateralAcc?:number
LaneOffsetTarget: (AbsoluteTargetLaneOffset|RelativeTargetLaneOffset)
RelativeTargetLaneOffset: entityRef:entity value:number
LateralDistanceAction: entityRef:entity continuous:bool freespace:bool distance?:number
    coordinateSystem?=entity|road|lane displacement?=any|leftToReferencedEntity|rightToReferencedEntity
    DynamicConstraints?
SynchronizeAction: masterEntityRef:entity targetToleranceMaster?:number targetTolerance?:number TargetPositionMaster
    TargetPosition FinalSpeed?
FinalSpeed: (AbsoluteSpeed|RelativeSpeedToMaster)
AbsoluteSpeed: value:number TargetDistanceSteadyState? TargetTimeSteadyState?
RelativeSpeedToMaster: value:number speedTargetValueType=delta|factor
    TargetDistanceSteadyState? TargetTimeSteadyState?
TargetDistanceSteadyState: distance:number
TargetTimeSteadyState: time:number
ControllerAction: AssignControllerAction? OverrideControllerValueAction? ActivateControllerAction?
AssignControllerAction: activateLateral?:bool activateLongitudinal?:bool activateLighting?:bool
    activateAnimation?:bool Controller?
ActivateControllerAction: lateral?:bool longitudinal?:bool lighting?:bool animation?:bool objectControllerRef?:text
    controllerRef?:text
OverrideControllerValueAction: Throttle? Brake? Clutch? ParkingBrake? SteeringWheel? Gear?
Throttle Clutch: {_PEDAL}
Brake: {_PEDAL} BrakePercent? BrakeForce?
ParkingBrake: active=false|0 value?:number BrakePercent? BrakeForce?
SteeringWheel: {_PEDAL} maxTorque?:number
Gear: active=false|0 number?:number ManualGear? AutomaticGear?
TeleportAction AcquirePositionAction AddEntityAction: Position
RoutingAction: (AssignRouteAction|FollowTrajectoryAction|AcquirePositionAction|RandomRouteAction)
AssignRouteAction RouteRef: (Route)
Route: name:text closed?:bool ParameterDeclarations? Waypoint*
Waypoint: routeStrategy?:text Position
FollowTrajectoryAction: initialDistanceOffset?:number Trajectory? TrajectoryRef? TimeReference TrajectoryFollowingMode?
TrajectoryRef: (Trajectory)
Trajectory: name:text closed?:bool ParameterDeclarations? Shape
Shape: (Polyline|Clothoid|ClothoidSpline|Nurbs)
Polyline: Vertex*
Vertex: time?:number Position
TimeReference: (None|Timing)
None DeleteEntityAction:
Timing: domainAbsoluteRelative=absolute|relative scale:number offset:number
TrajectoryFollowingMode: followingMode=position|follow
GlobalAction: (EnvironmentAction|EntityAction|InfrastructureAction|ParameterAction|VariableAction|SetMonitorAction
    |TrafficAction)
EnvironmentAction: (Environment)
Environment: name?:text ParameterDeclarations? TimeOfDay? Weather? RoadCondition?
Weather: cloudState?:text fractionalCloudCover?:text temperature?:number atmosphericPressure?:number
    Sun? Fog? Precipitation? Wind? DomeImage?
Sun: elevation:number azimuth?:number intensity?:number illuminance?:number
Fog: visualRange:number BoundingBox?
Precipitation: precipitationType=dry|rain|snow intensity?:number precipitationIntensity?:number
RoadCondition: frictionScaleFactor:number wetness?:text Properties?
EntityAction: entityRef:entity (AddEntityAction|DeleteEntityAction)
InfrastructureAction: (TrafficSignalAction)
TrafficSignalAction: (TrafficSignalStateAction|TrafficSignalControllerAction)
TrafficSignalStateAction TrafficSignalCondition: name:text state:text
TrafficSignalControllerAction TrafficSignalControllerCondition: trafficSignalControllerRef:text phase:text
ParameterAction: parameterRef:text (SetAction|ModifyAction)
VariableAction: variableRef:text (SetAction|ModifyAction)
ModifyAction: Rule
Rule: (AddValue|MultiplyByValue)
Position TargetPosition TargetPositionMaster: (POSITIONS)
Orientation: type?=absolute|relative h?:number p?:number r?:number
WorldPosition: x:number y:number z?:number h?:number p?:number r?:number
RelativeWorldPosition RelativeObjectPosition: entityRef:entity dx:number dy:number dz?:number Orientation?
RoadPosition: roadId:text s:number t:number Orientation?
RelativeRoadPosition: entityRef:entity ds:number dt:number Orientation?
LanePosition: roadId:text laneId:text s:number offset?:number Orientation?
RelativeLanePosition: entityRef:entity dLane:whole ds?:number dsLane?:number offset?:number Orientation?
RoutePosition: RouteRef InRoutePosition Orientation?
InRoutePosition: (FromCurrentEntity|FromRoadCoordinates|FromLaneCoordinates)
FromRoadCoordinates: pathS:number t:number
FromLaneCoordinates: pathS:number laneId:text laneOffset?:number
GeoPosition: latitude?:number longitude?:number height?:number latitudeDeg?:number longitudeDeg?:number
    altitude?:number verticalRoadSelection?:text Orientation?
TrajectoryPosition: s:number t?:number TrajectoryRef Orientation?
LinkPosition: linkId:text s?:number offset?:number Orientation?
ByEntityCondition: TriggeringEntities EntityCondition
TriggeringEntities: triggeringEntitiesRule=any|all EntityRef*
EntityCondition: (EndOfRoadCondition|CollisionCondition|OffroadCondition|TimeHeadwayCondition|TimeToCollisionCondition
    |AccelerationCondition|StandStillCondition|SpeedCondition|RelativeSpeedCondition|TraveledDistanceCondition
    |ReachPositionCondition|DistanceCondition|RelativeDistanceCondition|RelativeClearanceCondition|AngleCondition
    |RelativeAngleCondition)
EndOfRoadCondition OffroadCondition StandStillCondition: duration:number
CollisionCondition: EntityRef? ByType?
ByType: type=pedestrian|vehicle|miscellaneous|external
TimeHeadwayCondition RelativeDistanceCondition: entityRef:entity {_DISTANCE}
TimeToCollisionCondition: {_DISTANCE} TimeToCollisionConditionTarget
TimeToCollisionConditionTarget: (EntityRef|Position)
SpeedCondition AccelerationCondition: {_DIRECTED}
RelativeSpeedCondition: entityRef:entity {_DIRECTED}
ReachPositionCondition: tolerance:number Position
DistanceCondition: {_DISTANCE} Position
ByValueCondition: (ParameterCondition|VariableCondition|TimeOfDayCondition|SimulationTimeCondition
    |StoryboardElementStateCondition|UserDefinedValueCondition|TrafficSignalCondition
    |TrafficSignalControllerCondition)
ParameterCondition: parameterRef:text value:text {_RULE}
VariableCondition: variableRef:text value:text {_RULE}
SimulationTimeCondition: value:number {_RULE}
StoryboardElementStateCondition: storyboardElementType=story|act|maneuverGroup|maneuver|event|action
    storyboardElementRef:text
    state=standbyState|runningState|completeState|startTransition|endTransition|stopTransition|skipTransition
Evaluation: SuccessConditionGroup* FailureConditionGroup*
SimulatorInfo: Map?
Map: name:text
! EntitySelection ExternalObjectReference TrafficSignalGroupState UserDefinedAction RandomRouteAction TrailerAction
    TrafficAction Clothoid ClothoidSpline Nurbs RelativeClearanceCondition AngleCondition RelativeAngleCondition
    TimeOfDayCondition UserDefinedValueCondition
~ License ConstraintGroup MonitorDeclarations CatalogLocations SceneGraphFile UsedArea TrailerHitch TrailerCoupler
    Trailer File CustomContent BrakePercent BrakeForce ManualGear AutomaticGear VisibilityAction AppearanceAction
    TimeOfDay Wind DomeImage SetMonitorAction
"""

POSITIONS: Final = (
    *("WorldPosition", "RelativeWorldPosition", "RelativeObjectPosition", "RoadPosition", "RelativeRoadPosition"),
    *("LanePosition", "RelativeLanePosition", "RoutePosition", "GeoPosition", "TrajectoryPosition", "LinkPosition"),
)

LEFT_OUT: Final = frozenset(
    {"Event", "Act", "Private", "PrivateAction", "GlobalAction", "UserDefinedAction", "ConditionGroup"}
    | {"SuccessConditionGroup", "FailureConditionGroup"}
)
"""Elements that `--lenient` leaves out when something in them is refused, where others of their kind may stand beside
them."""


class AttributeRow(Record):
    """An attribute: its type, the words that it may be, and whether it must be there."""

    kind: str
    words: tuple[str, ...]
    is_needed: bool


class PartRow(Record):
    """A part of an element: the tags that it may have, whether there must be one, and whether there may be many."""

    tags: tuple[str, ...]
    is_needed: bool
    is_many: bool


class Row(Record):
    """A kind of element.

    Attributes:
        is_refused: it is known, and nothing reads it.
        is_idle: it is kept without effect, whatever is in it.
    """

    attributes: Mapping[str, AttributeRow]
    parts: tuple[PartRow, ...]
    is_refused: bool = False
    is_idle: bool = False

    def part_of(self, tag: str) -> PartRow | None:
        """Return the part that an element with this tag is."""
        return next((part for part in self.parts if tag in part.tags), None)


def read_table(table: str) -> dict[str, Row]:
    """Return the rows of a table in the form that the head of this module describes, by tag."""
    rows: dict[str, Row] = {}
    for line in re.sub(r"\n {4}", " ", table).strip().splitlines():
        names, _, rest = line.partition(":")
        if names[0] in "!~":
            row = Row({}, (), is_refused=names[0] == "!", is_idle=names[0] == "~")
            rows |= dict.fromkeys(names[1:].split(), row)
            continue
        rest = re.sub(r" *\|", "|", rest).replace("(POSITIONS)", f"({'|'.join(POSITIONS)})")
        attributes, parts = {}, []
        for word in rest.split():
            if word[0].islower():
                key, sign, kind = re.split(r"([:=])", word, maxsplit=1)
                words = tuple(kind.split("|")) if sign == "=" else ()
                attributes[key.rstrip("?")] = AttributeRow("text" if words else kind, words, key[-1] != "?")
            else:
                parts.append(PartRow(tuple(word.strip("?*()").split("|")), word[-1] not in "?*", word[-1] == "*"))
        rows |= dict.fromkeys(names.split(), Row(attributes, tuple(parts)))
    return rows


GRAMMAR: Final[Mapping[str, Row]] = read_table(_TABLE)
"""Kinds of elements by tag."""
