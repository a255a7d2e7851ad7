"""The models that can be placed, by the names and numbers that MORAI's clients and files use.

`CATALOGUE` is the whole list: what `SyncModeAddObj.name` accepts and what a scenario's `modelName` and `DataID` are
looked up in. Sizes are those of the real thing. Vehicle names are MORAI's own where they are known; which `DataID`
belongs to which model is published for a few only, and a number that we do not know gets `default_model`: its
size is then a guess, which the scenario reader says.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.state import Body, Kind

__all__ = ["CATALOGUE", "DEFAULT_EGO", "Model", "default_model", "find_model", "model_of_data_id", "suggest_model"]


@dataclass(frozen=True, slots=True)
class Model:
    """Something that can be placed.

    Attributes:
        name: as MORAI spells it.
        kind: VEHICLE, PEDESTRIAN or OBSTACLE; every VEHICLE with an engine can also be an ego.
        body: its figures.
        data_ids: the numbers that scenario files use for it; empty where they are not known.
    """

    name: str
    kind: Kind
    body: Body
    data_ids: tuple[int, ...] = ()


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
)

DEFAULT_EGO: Final = CATALOGUE[0]

_IGNORED = re.compile(r"[\W_]+")  # blanks, `_`, `-`, brackets
_LEADING_YEAR = re.compile(r"(19|20)\d\d_")
_YEAR = re.compile(r"(19|20)\d\d(?=[a-z])")


def _key(name: str) -> str:
    return _IGNORED.sub("", name).casefold()


_BY_KEY: Final = {_YEAR.sub("", _key(model.name), count=1): model for model in CATALOGUE} | {
    _key(model.name): model for model in CATALOGUE
}
_BY_DATA_ID: Final = {(model.kind, data_id): model for model in CATALOGUE for data_id in model.data_ids}
_DEFAULTS: Final = {
    Kind.EGO: DEFAULT_EGO,
    Kind.VEHICLE: DEFAULT_EGO,
    Kind.PEDESTRIAN: _BY_KEY["pedestrian"],
    Kind.OBSTACLE: _BY_KEY["box"],
}


MAX_NAME: Final = 200
"""Longest name that is looked up: names come from clients, and may be megabytes."""


def find_model(name: str) -> Model | None:
    """The model of this name, or None.

    Case, blanks, `_`, `-` and brackets make no difference, and the model year may be left out: `kia k5` is
    `2015_Kia_K5`. Another year is another car.
    """
    return _BY_KEY.get(_key(name)) if len(name) <= MAX_NAME else None


def suggest_model(name: str) -> str:
    """Return the nearest model for the end of an error; an empty text where none comes near."""
    names = [model.name for model in CATALOGUE]
    return hint(name, [*names, *(_LEADING_YEAR.sub("", each) for each in names)], cutoff=0.6)


def model_of_data_id(data_id: int, kind: Kind) -> Model | None:
    """The model that scenario files call by this number, or None; an ego is looked up among the vehicles."""
    return _BY_DATA_ID.get((Kind.VEHICLE if kind is Kind.EGO else kind, data_id))


def default_model(kind: Kind) -> Model:
    """What stands for a model of this kind that is not known."""
    return _DEFAULTS[kind]
