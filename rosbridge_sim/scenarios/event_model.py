"""The shape of the blocks `rosbridge_sim` in MORAI's scenario JSON: triggers, and what happens then.

MORAI SIM ignores these blocks, and its own keys keep their meaning. Unlike MORAI's objects a block has no unknown keys.
`events` makes a story of the blocks.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

from msgspec import Meta

from rosbridge_sim.documents.document_model import (
    MAX_DOCUMENT_COORDINATE,
    Coordinate,
    Table,
    about,
    number_within,
    text_within,
)

MAX_EVENTS: Final = 100
"""Most events of one block."""

Name = Annotated[str, text_within(200)]
Metres = Annotated[float, number_within(0.01, MAX_DOCUMENT_COORDINATE)]
Duration = Annotated[float, number_within(0.0, 1e6)]


def _need(block: Table, *names: str) -> None:
    """Check that one of these keys is there.

    Raises:
        ValueError: none is.
    """
    if all(getattr(block, name) is None for name in names):
        raise ValueError(f"expected {' or '.join(names)}")


class PlaceToPass(Table, frozen=True, kw_only=True):
    """A place on a link, or on the map, and how near is there."""

    link: Annotated[Name | None, about("id of a link of the map")] = None
    s: Annotated[Coordinate, about("distance from the start of the link [m]")] = 0.0
    x: Annotated[Coordinate | None, about("east, instead of a link [m]")] = None
    y: Annotated[Coordinate | None, about("north [m]")] = None
    within: Annotated[Metres, about("distance at which it is reached [m]")] = 3.0

    def __post_init__(self) -> None:
        """Check that it is one place."""
        if (self.link is None) == (self.x is None) or (self.x is None) != (self.y is None):
            raise ValueError("expected link and s, or x and y")


class When(Table, frozen=True, kw_only=True):
    """A trigger: all that is given must hold at the same time."""

    time: Annotated[Duration | None, about("so long after the start, and later [s]")] = None
    ego_passes: Annotated[PlaceToPass | None, about("the first ego is at this place")] = None

    def __post_init__(self) -> None:
        """Check that it is a trigger."""
        _need(self, *self.__struct_fields__)


class VehicleWhen(When, frozen=True, kw_only=True):
    """A trigger of a vehicle's event: all that is given must hold at the same time."""

    ego_within: Annotated[Metres | None, about("the first ego is this near [m]")] = None
    passes: Annotated[PlaceToPass | None, about("the vehicle itself is at this place")] = None


class VehicleEvent(Table, frozen=True, kw_only=True):
    """One change of lane or speed. After it the vehicle drives on as before; with the new speed, if it got one."""

    when: VehicleWhen
    change_lane: Annotated[Literal["left", "right"] | None, about("to the lane beside its own")] = None
    speed_kmh: Annotated[Annotated[float, number_within(0.0, 1_000.0)] | None, about("its new speed [km/h]")] = None
    seconds: Annotated[Duration, about("time that the change takes [s]")] = 3.0

    def __post_init__(self) -> None:
        """Check that something happens."""
        _need(self, "change_lane", "speed_kmh")


class LightEvent(Table, frozen=True, kw_only=True):
    """A traffic light that shows a colour from then on, whatever its plan is."""

    when: When
    light: Annotated[Name, about("id of the light")]
    state: Literal["red", "yellow", "green", "off"]


class ItemBlock(Table, frozen=True, kw_only=True):
    """The block of a pedestrian or an obstacle: when it starts."""

    start_within: Annotated[
        Metres | None, about("it stands until an ego is this near [m]; used instead of activeDistance")
    ] = None
    start_when: Annotated[When | None, about("it stands until then")] = None

    def __post_init__(self) -> None:
        """Check that it starts at one moment."""
        if self.start_within is not None and self.start_when is not None:
            raise ValueError("expected start_within or start_when; got both")


class VehicleBlock(ItemBlock, frozen=True, kw_only=True):
    """The block of a vehicle: when it starts, and what it does later."""

    events: Annotated[list[VehicleEvent], Meta(max_length=MAX_EVENTS)] | None = None


class ScenarioBlock(Table, frozen=True, kw_only=True):
    """The block of the scenario as a whole."""

    events: Annotated[list[LightEvent], Meta(max_length=MAX_EVENTS)] | None = None


class EventBlocks(Table, frozen=True, kw_only=True):
    """All blocks of a scenario that hold events, by the places of their items: what a snapshot has of them."""

    vehicles: dict[str, VehicleBlock]
    items: dict[str, ItemBlock]
    scenario: ScenarioBlock
