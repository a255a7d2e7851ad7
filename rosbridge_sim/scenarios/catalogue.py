"""Models that can be placed, by the names and numbers of MORAI's clients and files.

`CATALOGUE` is our list. `SyncModeAddObj.name`, and a scenario's `modelName` and `DataID`, are looked up in it. Sizes
are
those of the real vehicles and things. Vehicle names are MORAI's own where they are known. The model of a `DataID` is
published for a few only. An unknown number gets the ordinary size of its class, and a name that contains the number
(`model_by_class`); the scenario reader reports it. The user's own models (`Catalogue.own`) are looked up first.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Final, NamedTuple

from rosbridge_sim.records import Record
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.state.entity_types import CG_SHARE
from rosbridge_sim.world.state.world import Body, Kind


class _Engine(NamedTuple):
    """Longitudinal figures of a model, for the single track model; see `Body` for those without a text here.

    `power` is what gives the time to 100 km/h of the list below, in our model with the launch that is written there, a
    guess. So it is less than the power of the engine that the maker states.
    """

    launch_accel: float = 3.5
    power: float = 49.8
    top_kmh: float = 185.0
    drag_area: float = 0.53  # cd A [m^2]
    grip: float = 1.0
    grip_along: float = 1.3
    engine_drag: float = 0.3


_AIR: Final = 1.2
"""Density of air at 20 degrees [kg/m^3]."""

# Seconds to 100 km/h and top speed, of the makers for Europe: Ioniq hybrid 10.8 s and 185 km/h, Niro hybrid 11.5 s and
# 162 km/h, Ioniq 5 with 160 kW 7.4 s and 185 km/h, Golf GTI 6.4 s and 250 km/h, Stinger 2.0 6.0 s and 240 km/h. The
# tyres of the last two grip better. All others are estimates of their class: K5 10 s and 205 km/h,
# K7 9 s and 215 km/h, Genesis 6.8 s and 240 km/h, van 14.5 s and 170 km/h, light truck 18 s and 140 km/h, bus 12 s to
# 50 km/h and 100 km/h, motorcycle 5 s and 170 km/h, bicycle 7.5 s to 20 km/h and 32 km/h. All drag areas are estimates.
# `grip_along` gives stops from 100 km/h that are usual in tests of magazines: within 36 to 38 m the cars, 35 m the Golf
# GTI, 36 m the Stinger, 41 m the van. Tyres of trucks have less of it; those of two-wheelers are an estimate.
_ENGINES: Final = {
    "2016_Kia_Niro(HEV)": _Engine(3.5, 46.0, 162.0, 0.66),
    "Hyundai_Ioniq_5": _Engine(4.5, 78.7, 185.0, 0.74),
    "2015_Kia_K5": _Engine(3.8, 53.4, 205.0, 0.62),
    "2014_Kia_K7": _Engine(4.0, 61.0, 215.0, 0.65),
    "2016_Genesis_DH": _Engine(5.0, 92.8, 240.0, 0.62),
    "2021_VW_Golf_GTI": _Engine(4.8, 106.0, 250.0, 0.60, grip=1.2, grip_along=1.4),
    "2020_Kia_Stinger": _Engine(5.4, 101.0, 240.0, 0.66, grip=1.1, grip_along=1.35),
    "Van": _Engine(2.8, 38.0, 170.0, 1.15, grip_along=1.15),
    "Truck": _Engine(2.5, 32.4, 140.0, 1.4, grip_along=1.0),
    "Bus": _Engine(1.5, 12.5, 100.0, 4.8, grip_along=1.0),
    "Motorcycle": _Engine(7.0, 125.0, 170.0, 0.4, grip_along=1.0),
    "Bicycle": _Engine(1.2, 3.3, 32.0, 0.45, grip_along=1.0, engine_drag=0.0),
}


class Model(Record):
    """A model that can be placed.

    Attributes:
        name: as MORAI spells it.
        kind: VEHICLE, PEDESTRIAN or OBSTACLE; every VEHICLE with an engine can also be an ego.
        body: its size and limits.
        data_ids: its numbers in scenario files; empty if they are unknown.
        mass: of the user's models [kg]; None if it is not given. The dynamics use that of the body.
    """

    name: str
    kind: Kind
    body: Body
    data_ids: tuple[int, ...] = ()
    mass: float | None = None


# The largest steering angle of the Ioniq and the Niro is published (36.25 degrees); similar cars have about the same.
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
    mass: float = 1450.0,
    front_load: float = 0.59,
    front_drive: float = 1.0,
    leans: bool = True,
) -> Model:
    """Return a vehicle with this length, width, height, front and rear overhang [m]; the rest is the wheelbase.

    Masses are kerb weights of the makers and 75 kg for the driver. Loads of the front axle are those usual for the
    layout: 0.59 to 0.61 with front-wheel drive, 0.5 to 0.55 with rear-wheel drive.
    """
    length, width, height = size
    engine = _ENGINES.get(name, _Engine())
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
        mass=mass,
        front_load=front_load,
        cg_height=round(CG_SHARE * height, 3),
        front_drive=front_drive,
        grip=engine.grip,
        grip_along=engine.grip_along,
        launch_accel=engine.launch_accel,
        power=engine.power,
        top_speed=engine.top_kmh / 3.6,
        air_drag=round(0.5 * _AIR * engine.drag_area / mass, 6),
        engine_drag=engine.engine_drag,
        **({} if leans else {"roll_gain": 0.0, "pitch_gain": 0.0}),
    )
    return Model(name, Kind.VEHICLE, body, data_ids)


def _thing(kind: Kind, name: str, length: float, width: float, height: float, *data_ids: int) -> Model:
    return Model(name, kind, Body.box(length, width, height), data_ids)


def _plain_car(data_id: int) -> Model:
    """Return a vehicle of which only the number is known: the values of `Body` are those of a mid-size car."""
    return Model(f"Vehicle_{data_id}", Kind.VEHICLE, Body(), (data_id,))


CATALOGUE: Final[tuple[Model, ...]] = (
    # Lengths, widths and overhangs are those of MORAI's models; heights are those of the real cars.
    _car("2016_Hyundai_Ioniq", (4.470, 1.820, 1.450), 0.880, 0.890, mass=1450.0),
    _car(
        "2016_Kia_Niro(HEV)", (4.355, 1.805, 1.545), 0.870, 0.785, mass=1500.0
    ),  # all values of the real car, wheelbase 2.7
    _car(
        "Hyundai_Ioniq_5", (4.635, 1.900, 1.605), 0.845, 0.790, 20200012, mass=1980.0, front_load=0.5, front_drive=0.0
    ),
    _car("2015_Kia_K5", (4.845, 1.835, 1.475), 0.965, 1.085, mass=1545.0, front_load=0.6),
    _car("2014_Kia_K7", (5.010, 1.885, 1.475), 1.000, 1.120, mass=1635.0, front_load=0.6),
    _car(
        "2016_Genesis_DH",
        (4.996, 1.920, 1.480),
        0.846,
        1.140,
        max_accel=4.5,
        mass=1975.0,
        front_load=0.52,
        front_drive=0.0,
    ),
    _car("2021_VW_Golf_GTI", (4.380, 1.780, 1.478), 0.860, 0.889, max_accel=4.5, mass=1505.0, front_load=0.61),
    _car(
        "2020_Kia_Stinger",
        (4.830, 1.870, 1.400),
        0.830,
        1.095,
        max_accel=5.0,
        mass=1765.0,
        front_load=0.53,
        front_drive=0.0,
    ),
    # The names from here on are ours, with values of common examples: a Starex, a Porter, a city bus of 11 m.
    _car("Van", (5.150, 1.920, 1.925), 0.880, 1.070, max_accel=2.5, mass=2275.0, front_load=0.55, front_drive=0.0),
    _car(
        "Truck",
        (5.120, 1.740, 1.965),
        1.205,
        1.275,
        max_accel=2.2,
        max_decel=7.0,
        mass=1850.0,
        front_load=0.58,
        front_drive=0.0,
    ),
    _car(
        "Bus",
        (10.955, 2.490, 3.220),
        2.565,
        2.990,
        max_steer=math.radians(45.0),
        max_accel=1.5,
        max_decel=6.0,
        mass=11_500.0,
        front_load=0.35,
        front_drive=0.0,
    ),
    # Two-wheelers; their height and mass include the rider. They lean into bends, which is not simulated.
    _car(
        "Motorcycle",
        (2.100, 0.800, 1.650),
        0.350,
        0.350,
        max_accel=5.0,
        mass=275.0,
        front_load=0.5,
        front_drive=0.0,
        leans=False,
    ),
    _car(
        "Bicycle",
        (1.800, 0.600, 1.750),
        0.380,
        0.370,
        max_accel=1.0,
        max_decel=4.0,
        mass=90.0,
        front_load=0.45,
        front_drive=0.0,
        leans=False,
    ),
    # Pedestrians: length of a stride, width with the arms, mean height of Korean adults and of a child of seven.
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
    # Numbers found in files that MORAI saved; their models are not published, so each has its class's ordinary size.
    *(_plain_car(data_id) for data_id in (20100012, 20100014, 20200003, 30200005, 30200006, 30200007)),
    _thing(Kind.OBSTACLE, "Obstacle_40100019", 0.60, 0.40, 0.40, 40100019),
)

DEFAULT_EGO: Final = CATALOGUE[0]

_IGNORED = re.compile(r"[\W_]+")  # blanks, `_`, `-`, brackets
_LEADING_YEAR = re.compile(r"(19|20)\d\d_")
_YEAR = re.compile(r"(19|20)\d\d(?=[a-z])")


def key_of_name(name: str) -> str:
    """Return the significant part of a name: without case, blanks, `_`, `-` and brackets.

    Returns:
        The key; names with one key mean one model.
    """
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
"""Class of a `DataID` by its first three digits: 201 and 202 are externally driven cars, 302 are NPC vehicles."""

_DIGITS: Final = 8
"""Number of digits of a `DataID`."""

_WORD: Final = re.compile(r"[a-z]{3,}")
"""A word in a name that a user may remember of it, such as its make."""

MAX_EXAMPLES: Final = 3
"""Models that a hint names."""

MAX_MODEL_NAME: Final = 200
"""Longest name that is looked up, because a client may send a name of megabytes."""


class Catalogue:
    """The user's models and ours, by name and by number; the user's models take precedence.

    Attributes:
        own: the user's, in the order of the file.
    """

    def __init__(self, own: Sequence[Model] = ()) -> None:
        """Add the user's models to ours.

        Args:
            own: the user's. No two have one name, and no two of one kind have one number.
        """
        self.own = tuple(own)
        # A later model replaces an earlier one; a full name takes precedence over a name without its year.
        models = (*CATALOGUE, *self.own)
        self._by_key = {_YEAR.sub("", key_of_name(model.name), count=1): model for model in models}
        self._by_key |= {key_of_name(model.name): model for model in models}
        self._by_data_id = {(model.kind, data_id): model for model in models for data_id in model.data_ids}

    @property
    def models(self) -> tuple[Model, ...]:
        """All models that can be named: the user's, then those of ours that the user's do not replace."""
        return (*self.own, *(model for model in CATALOGUE if self.find(model.name) is model))

    def find(self, name: str) -> Model | None:
        """Return the model of this name.

        Case, blanks, `_`, `-` and brackets make no difference. The model year may be omitted: `kia k5` is
        `2015_Kia_K5`. A
        different year is a different car.

        Args:
            name: as a client or a file has it.

        Returns:
            The model, or None.
        """
        return self._by_key.get(key_of_name(name)) if len(name) <= MAX_MODEL_NAME else None

    def suggest(self, name: str, kind: Kind | None = None) -> str:
        """Return the nearest model names and how to list all, for the end of an error text.

        Args:
            kind: of the wanted model; None for any.

        Returns:
            The nearest name; else those that have a word of it; else some models as examples.
        """
        names = [model.name for model in self.models if kind in {None, model.kind}]
        near = hint(name, [*names, *(_LEADING_YEAR.sub("", each) for each in names)], cutoff=0.6)
        if not near:
            words = _WORD.findall(name[:MAX_MODEL_NAME].casefold())
            alike = [each for each in names if any(word in each.casefold() for word in words)][:MAX_EXAMPLES]
            near = (
                f" (did you mean {' or '.join(alike)}?)"
                if alike
                else f"; it has {', '.join(names[:MAX_EXAMPLES])}, ..."
            )
        return f"{near}; /sim/catalogue lists all"

    def of_data_id(self, data_id: int, kind: Kind) -> Model | None:
        """Return the model of a number in a scenario file.

        Args:
            kind: of the item; an ego is looked up among the vehicles.

        Returns:
            The model, or None.
        """
        return self._by_data_id.get((Kind.VEHICLE if kind is Kind.EGO else kind, data_id))


BUILT_IN: Final = Catalogue()
"""The catalogue with our models only."""

find_model: Final = BUILT_IN.find


def default_model(kind: Kind) -> Model:
    """Return the model that replaces an unknown one.

    Returns:
        A model of this kind; a vehicle for an ego.
    """
    return _DEFAULTS[kind]


def class_of_data_id(data_id: int) -> Kind | None:
    """Return the class that the first digits of a number mean.

    Returns:
        The class, or None for an unknown one.
    """
    text = str(data_id)
    return _CLASSES.get(int(text[:3])) if len(text) == _DIGITS and text.isdecimal() else None


def model_by_class(data_id: int, kind: Kind) -> Model:
    """Return a model for a number in no catalogue: the ordinary size of its kind, and a name with the number."""
    like = default_model(kind)
    return Model(f"{like.kind.name.capitalize()}_{data_id}", like.kind, like.body, (data_id,))
