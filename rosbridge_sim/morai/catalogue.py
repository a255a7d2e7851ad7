"""The models that can be placed, by the names and numbers that MORAI's clients and files use.

`CATALOGUE` is our list: what `SyncModeAddObj.name` accepts and what a scenario's `modelName` and `DataID` are looked
up in. Sizes are those of the real thing. Vehicle names are MORAI's own where they are known; which `DataID` belongs to
which model is published for a few only. A number that no table describes gets the ordinary size of its class and a
name with the number in it (`model_by_class`), which the scenario reader says. The user's own table (`Catalogue.own`)
is asked first.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.state import Body, Kind

__all__ = [
    "BUILT_IN",
    "CATALOGUE",
    "DEFAULT_EGO",
    "Catalogue",
    "Model",
    "class_of_data_id",
    "default_model",
    "find_model",
    "key_of_name",
    "model_by_class",
    "model_of_data_id",
]


@dataclass(frozen=True, slots=True)
class Model:
    """Something that can be placed.

    Attributes:
        name: as MORAI spells it.
        kind: VEHICLE, PEDESTRIAN or OBSTACLE; every VEHICLE with an engine can also be an ego.
        body: its figures.
        data_ids: the numbers that scenario files use for it; empty where they are not known.
        mass: kept; the kinematic world has no use for it [kg].
    """

    name: str
    kind: Kind
    body: Body
    data_ids: tuple[int, ...] = ()
    mass: float | None = None


# The steering of the Ioniq and the Niro is published (36.25 degrees); other cars of their size turn much the same.
_CAR_STEER: Final = math.radians(36.25)


def _car(
    name: str,
    size: tuple[float, float, float],
    front: float,
    rear: float,
    *data_ids: int,
    max_steer: float = _CAR_STEER,
    max_accel: float = 3.5,
    max_decel: float = 8.5,
) -> Model:
    """A vehicle from length, width, height and the two overhangs [m]; the wheelbase is what they leave."""
    length, width, height = size
    body = Body(
        length,
        width,
        height,
        wheelbase=round(length - front - rear, 6),
        front_overhang=front,
        rear_overhang=rear,
        max_steer=max_steer,
        max_accel=max_accel,
        max_decel=max_decel,
    )
    return Model(name, Kind.VEHICLE, body, data_ids)


def _thing(kind: Kind, name: str, length: float, width: float, height: float, *data_ids: int) -> Model:
    return Model(name, kind, Body.box(length, width, height), data_ids)


def _plain_car(data_id: int) -> Model:
    """A vehicle of which nothing but the number is known: the figures of `Body` are those of a mid-size car."""
    return Model(f"Vehicle_{data_id}", Kind.VEHICLE, Body(), (data_id,))


CATALOGUE: Final[tuple[Model, ...]] = (
    # Lengths, widths and overhangs as MORAI's models have them; heights of the road cars.
    _car("2016_Hyundai_Ioniq", (4.470, 1.820, 1.450), 0.880, 0.890),
    _car("2016_Kia_Niro(HEV)", (4.355, 1.805, 1.545), 0.870, 0.785),  # all of the road car, wheelbase 2.7
    _car("Hyundai_Ioniq_5", (4.635, 1.900, 1.605), 0.845, 0.790, 20200012),
    _car("2015_Kia_K5", (4.845, 1.835, 1.475), 0.965, 1.085),
    _car("2014_Kia_K7", (5.010, 1.885, 1.475), 1.000, 1.120),
    _car("2016_Genesis_DH", (4.996, 1.920, 1.480), 0.846, 1.140, max_accel=4.5),
    _car("2021_VW_Golf_GTI", (4.380, 1.780, 1.478), 0.860, 0.889, max_accel=4.5),
    _car("2020_Kia_Stinger", (4.830, 1.870, 1.400), 0.830, 1.095, max_accel=5.0),
    # Our own names from here on, with figures of common examples: a Starex, a Porter, a city bus of 11 m.
    _car("Van", (5.150, 1.920, 1.925), 0.880, 1.070, max_accel=2.5),
    _car("Truck", (5.120, 1.740, 1.965), 1.205, 1.275, max_accel=2.2, max_decel=7.0),
    _car("Bus", (10.955, 2.490, 3.220), 2.565, 2.990, max_steer=math.radians(45.0), max_accel=1.5, max_decel=6.0),
    # Two wheels, height with the rider.
    _car("Motorcycle", (2.100, 0.800, 1.650), 0.350, 0.350, max_accel=5.0),
    _car("Bicycle", (1.800, 0.600, 1.750), 0.380, 0.370, max_accel=1.0, max_decel=4.0),
    # People: depth with the stride, breadth with the arms, mean height of Korean adults and of a child of seven.
    _thing(Kind.PEDESTRIAN, "Pedestrian", 0.45, 0.55, 1.70),
    _thing(Kind.PEDESTRIAN, "Man", 0.45, 0.55, 1.74),
    _thing(Kind.PEDESTRIAN, "Woman", 0.42, 0.50, 1.61),
    _thing(Kind.PEDESTRIAN, "Child", 0.35, 0.40, 1.22),
    # Obstacles: a freight crate, a crate on a Euro pallet, a moving box, a 200 l drum, a 70 cm cone, a concrete wall.
    _thing(Kind.OBSTACLE, "Cargo_Box", 1.20, 1.00, 1.00, 40100001),
    _thing(Kind.OBSTACLE, "Wooden_Box", 1.20, 0.80, 0.80, 40100002),
    _thing(Kind.OBSTACLE, "Box", 0.60, 0.40, 0.40, 40100003),
    _thing(Kind.OBSTACLE, "Barrel", 0.585, 0.585, 0.88, 40100004),
    _thing(Kind.OBSTACLE, "Traffic_Cone", 0.38, 0.38, 0.70, 40100005),
    _thing(Kind.OBSTACLE, "Road_Barrier", 2.00, 0.60, 0.81),
    # Seen in files that MORAI has saved; what they are is not published. The size is the ordinary one of their class.
    *(_plain_car(data_id) for data_id in (20100012, 20100014, 20200003, 30200005, 30200006, 30200007)),
    _thing(Kind.OBSTACLE, "Obstacle_40100019", 0.60, 0.40, 0.40, 40100019),
)

DEFAULT_EGO: Final = CATALOGUE[0]

_IGNORED = re.compile(r"[\W_]+")  # blanks, `_`, `-`, brackets
_LEADING_YEAR = re.compile(r"(19|20)\d\d_")
_YEAR = re.compile(r"(19|20)\d\d(?=[a-z])")


def key_of_name(name: str) -> str:
    """Return the part of a name that counts: without case, blanks, `_`, `-` and brackets."""
    return _IGNORED.sub("", name).casefold()


_DEFAULTS: Final = {
    Kind.EGO: DEFAULT_EGO,
    Kind.VEHICLE: DEFAULT_EGO,
    Kind.PEDESTRIAN: next(model for model in CATALOGUE if model.kind is Kind.PEDESTRIAN),
    Kind.OBSTACLE: next(model for model in CATALOGUE if model.name == "Box"),
}

_CLASSES: Final = {
    201: Kind.VEHICLE,
    202: Kind.VEHICLE,
    302: Kind.VEHICLE,
    401: Kind.OBSTACLE,
    501: Kind.PEDESTRIAN,
    502: Kind.PEDESTRIAN,
}
"""The first digits of a `DataID` are its class: 201 and 202 are cars that are driven from outside, 302 NPC vehicles."""

_DIGITS: Final = 8
"""Of a `DataID`."""

MAX_MODEL_NAME: Final = 200
"""Longest name that is looked up: names come from clients, and may be megabytes."""


class Catalogue:
    """The user's models and ours, by name and by number; the user's win.

    Attributes:
        own: the user's, in the order of the file.
    """

    def __init__(self, own: Sequence[Model] = ()) -> None:
        """A catalogue of these models, then ours.

        Args:
            own: the user's. No two have one name, and none of a kind one number.
        """
        self.own = tuple(own)
        # What comes later wins; a full name beats one whose year was left out.
        models = (*CATALOGUE, *self.own)
        self._by_key = {_YEAR.sub("", key_of_name(model.name), count=1): model for model in models}
        self._by_key |= {key_of_name(model.name): model for model in models}
        self._by_data_id = {(model.kind, data_id): model for model in models for data_id in model.data_ids}

    @property
    def models(self) -> tuple[Model, ...]:
        """All models that can be named: the user's, then those of ours that the user's do not replace."""
        return (*self.own, *(model for model in CATALOGUE if self.find(model.name) is model))

    def find(self, name: str) -> Model | None:
        """Return the model of this name, or None.

        Case, blanks, `_`, `-` and brackets make no difference, and the model year may be left out: `kia k5` is
        `2015_Kia_K5`. Another year is another car.
        """
        return self._by_key.get(key_of_name(name)) if len(name) <= MAX_MODEL_NAME else None

    def suggest(self, name: str) -> str:
        """Return the nearest model for the end of an error; an empty text where none comes near."""
        names = [model.name for model in (*self.own, *CATALOGUE)]
        return hint(name, [*names, *(_LEADING_YEAR.sub("", each) for each in names)], cutoff=0.6)

    def of_data_id(self, data_id: int, kind: Kind) -> Model | None:
        """Return the model that scenario files call by this number, or None; an ego is looked up among the vehicles."""
        return self._by_data_id.get((Kind.VEHICLE if kind is Kind.EGO else kind, data_id))


BUILT_IN: Final = Catalogue()
"""Our models alone."""

find_model: Final = BUILT_IN.find
model_of_data_id: Final = BUILT_IN.of_data_id


def default_model(kind: Kind) -> Model:
    """Return what stands for a model of this kind that is not known."""
    return _DEFAULTS[kind]


def class_of_data_id(data_id: int) -> Kind | None:
    """Return the class that the first digits of a number name; None where they name none."""
    text = str(data_id)
    return _CLASSES.get(int(text[:3])) if len(text) == _DIGITS and text.isdecimal() else None


def model_by_class(data_id: int, kind: Kind) -> Model:
    """Return the ordinary model of a kind, under a name that keeps a number which is in no catalogue."""
    like = default_model(kind)
    return Model(f"{like.kind.name.capitalize()}_{data_id}", like.kind, like.body, (data_id,))
