"""Models that can be placed, by the names and numbers of MORAI's clients and files.

`CATALOGUE` is our list. `SyncModeAddObj.name`, `modelName` and `DataID` of scenarios are looked up in it. Sizes are
those of the real vehicles and things. Vehicle names are MORAI's own where they are known. The model of a `DataID` is
published for a few only. An unknown number gets the ordinary size of its class, and a name that contains the number
(`model_by_class`); the scenario reader reports it. The user's own models (`Catalogue.own`) are looked up first.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Final

from rosbridge_sim.records import Record
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.state.entity_types import CG_SHARE
from rosbridge_sim.world.state.world import Body, Kind

_AIR: Final = 1.2
"""Density of air at 20 degrees [kg/m^3]."""


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


_VEHICLES: Final = """
name               length width height front  rear accel decel  mass load drive launch power top drag grip along
2016_Hyundai_Ioniq  4.470 1.820  1.450 0.880 0.890   3.5   8.5  1450 0.59     1    3.5  49.8 185 0.53    1   1.3
2016_Kia_Niro(HEV)  4.355 1.805  1.545 0.870 0.785   3.5   8.5  1500 0.59     1    3.5    46 162 0.66    1   1.3
Hyundai_Ioniq_5     4.635 1.900  1.605 0.845 0.790   3.5   8.5  1980  0.5     0    4.5  78.7 185 0.74    1   1.3
2015_Kia_K5         4.845 1.835  1.475 0.965 1.085   3.5   8.5  1545  0.6     1    3.8  53.4 205 0.62    1   1.3
2014_Kia_K7         5.010 1.885  1.475 1.000 1.120   3.5   8.5  1635  0.6     1      4    61 215 0.65    1   1.3
2016_Genesis_DH     4.996 1.920  1.480 0.846 1.140   4.5   8.5  1975 0.52     0      5  92.8 240 0.62    1   1.3
2021_VW_Golf_GTI    4.380 1.780  1.478 0.860 0.889   4.5   8.5  1505 0.61     1    4.8   106 250  0.6  1.2   1.4
2020_Kia_Stinger    4.830 1.870  1.400 0.830 1.095     5   8.5  1765 0.53     0    5.4   101 240 0.66  1.1  1.35
Van                 5.150 1.920  1.925 0.880 1.070   2.5   8.5  2275 0.55     0    2.8    38 170 1.15    1  1.15
Truck               5.120 1.740  1.965 1.205 1.275   2.2     7  1850 0.58     0    2.5  32.4 140  1.4    1     1
Bus                10.955 2.490  3.220 2.565 2.990   1.5     6 11500 0.35     0    1.5  12.5 100  4.8    1     1
Motorcycle          2.100 0.800  1.650 0.350 0.350     5   8.5   275  0.5     0      7   125 170  0.4    1     1
Bicycle             1.800 0.600  1.750 0.380 0.370     1     4    90 0.45     0    1.2   3.3  32 0.45    1     1
"""
"""Vehicles: length, width, height, front and rear overhang [m], the rest is the wheelbase; largest acceleration and
deceleration [m/s^2]; mass [kg], load and drive of the front axle as shares; acceleration at the start [m/s^2], power
for each kg [W], top speed [km/h], drag area [m^2]; grip of the tyres across and along. See `Body`.

Lengths, widths and overhangs down to the Stinger are those of MORAI's models, heights those of the real cars; all
figures of the Niro are those of the real car, wheelbase 2.7 m. The names from the van on are ours, with values of
common examples: a Starex, a Porter, a city bus of 11 m; two-wheelers have their riders.

Masses are kerb weights of the makers and 75 kg for the driver. Loads of the front axle are those usual for the layout:
0.59 to 0.61 with front-wheel drive, 0.5 to 0.55 with rear-wheel drive.

The power is what gives the time to 100 km/h in our model with the start that is written there, a guess; so it is less
than that of the engine that the maker states. Seconds to 100 km/h and top speed, of the makers for Europe: Ioniq hybrid
10.8 s and 185 km/h, Niro hybrid 11.5 s and 162 km/h, Ioniq 5 with 160 kW 7.4 s and 185 km/h, Golf GTI 6.4 s and 250
km/h, Stinger 2.0 6.0 s and 240 km/h. The tyres of the last two grip better. All others are estimates of their class: K5
10 s and 205 km/h, K7 9 s and 215 km/h, Genesis 6.8 s and 240 km/h, van 14.5 s and 170 km/h, light truck 18 s and 140
km/h, bus 12 s to 50 km/h and 100 km/h, motorcycle 5 s and 170 km/h, bicycle 7.5 s to 20 km/h and 32 km/h. All drag
areas are estimates. The grip along gives stops from 100 km/h that are usual in tests of magazines: within 36 to 38 m
the cars, 35 m the Golf GTI, 36 m the Stinger, 41 m the van. Tyres of trucks have less of it; those of two-wheelers are
an estimate.
"""

_USUAL: Final = {"max_steer": math.radians(36.25), "engine_drag": 0.3}
"""Of cars. The steering angle of the Ioniq and the Niro is published; similar cars have about the same."""

_UPRIGHT: Final = {"roll_gain": 0.0, "pitch_gain": 0.0}
"""Two-wheelers lean into bends, which is not simulated."""

_UNUSUAL: Final = {
    "Bus": {"max_steer": math.radians(45.0)},
    "Motorcycle": _UPRIGHT,
    "Bicycle": {**_UPRIGHT, "engine_drag": 0.0},
}

_DATA_IDS: Final = {"Hyundai_Ioniq_5": (20200012,)}


def _read_vehicles(table: str) -> Iterator[Model]:
    header, *rows = (line.split() for line in table.strip().splitlines())
    for name, *figures in rows:
        row = dict(zip(header[1:], map(float, figures), strict=True))
        body = Body(
            *(row["length"], row["width"], row["height"]),
            wheelbase=round(row["length"] - row["front"] - row["rear"], 6),
            front_overhang=row["front"],
            rear_overhang=row["rear"],
            max_accel=row["accel"],
            max_decel=row["decel"],
            mass=row["mass"],
            front_load=row["load"],
            cg_height=round(CG_SHARE * row["height"], 3),
            front_drive=row["drive"],
            grip=row["grip"],
            grip_along=row["along"],
            launch_accel=row["launch"],
            power=row["power"],
            top_speed=row["top"] / 3.6,
            air_drag=round(0.5 * _AIR * row["drag"] / row["mass"], 6),
            **{**_USUAL, **_UNUSUAL.get(name, {})},
        )
        yield Model(name, Kind.VEHICLE, body, _DATA_IDS.get(name, ()))


def _thing(kind: Kind, name: str, length: float, width: float, height: float, *data_ids: int) -> Model:
    return Model(name, kind, Body.box(length, width, height), data_ids)


def _plain_car(data_id: int) -> Model:
    """Return a vehicle of which only the number is known: the values of `Body` are those of a mid-size car."""
    return Model(f"Vehicle_{data_id}", Kind.VEHICLE, Body(), (data_id,))


CATALOGUE: Final[tuple[Model, ...]] = (
    *_read_vehicles(_VEHICLES),
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
