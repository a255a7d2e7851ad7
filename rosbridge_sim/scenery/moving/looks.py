"""Colours of entities: seeded ones of real cars and clothes, and lamps that shine."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.mesh import Lit
from rosbridge_sim.scenery.moving.template import Tint
from rosbridge_sim.scenery.scene_frame import SceneFrame, SceneLayout, Shape
from rosbridge_sim.world.followers.lamps import BRAKE, LEFT, REVERSE, RIGHT
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.state.chance import mix
from rosbridge_sim.world.state.world import DT


def _colours(text: str) -> NDArray[np.uint8]:
    """Return the colours of a text as CSS writes them, without `#`, (k, 3)."""
    return np.frombuffer(bytes.fromhex(text), dtype=np.uint8).reshape(-1, 3)


# White is about a third of all cars (Axalta's report on colours, Asia, 2023).
_CARS: Final = _colours(
    "e2e4e4" * 8 + "1a1b1e" * 5 + "606468" * 4 + "a8acb0" * 3 + "263e70" * 2 + "961c1e 705c46 344e3c"
)
_BUSES: Final = _colours("2c6e3e 265ca8 c43c2c")
_SHIRTS: Final = _colours("96282c 2c4278 3c3e42 cec8be 466246 78583c 563e68 1e2026")
_TROUSERS: Final = _colours("28304a 222226 5c5446 3a3c40")
_SKINS: Final = _colours("e2b89a cc9e7e 966c52")
_HAIRS: Final = _colours("181412 34261c 605242")
EGO_PAINT: Final = (24, 78, 160)
"""Paint of egos: a blue that no other vehicle has."""

_FIXED: Final = {
    Tint.DARK: (32, 33, 35),
    Tint.GLASS: (46, 56, 64),
    Tint.TYRE: (28, 28, 29),
    Tint.RIM: (152, 155, 158),
    Tint.PLATE: (222, 222, 216),
    Tint.HEAD_LAMP: (214, 220, 224),
    Tint.BRAKE_LAMP: (112, 18, 18),
    Tint.LEFT_LAMP: (158, 92, 24),
    Tint.RIGHT_LAMP: (158, 92, 24),
    Tint.REVERSE_LAMP: (190, 192, 194),
}

_LIT: Final = {
    Tint.BRAKE_LAMP: (BRAKE, (255, 36, 26)),
    Tint.LEFT_LAMP: (LEFT, (255, 160, 20)),
    Tint.RIGHT_LAMP: (RIGHT, (255, 160, 20)),
    Tint.REVERSE_LAMP: (REVERSE, (255, 255, 246)),
}
"""Bit of the lamp, and its colour while it shines."""

_THINGS: Final = {
    Shape.BOX: ((164, 124, 78), (124, 92, 58)),
    Shape.CONE: ((226, 84, 24), (232, 232, 228)),
    Shape.BARREL: ((40, 84, 150), (30, 64, 116)),
    Shape.BARRIER: ((168, 166, 160), (196, 60, 44)),
}
"""Main and second colour of obstacles."""

BLINKS: Final = 1.5
"""Blinks of a turn signal [1/s]: 60 to 120 a minute in UN Regulation 6."""

_NUM: Final = len(Tint)


def tint_table(frame: SceneFrame, rows: IntArray, shape: Shape) -> NDArray[np.uint8]:
    """Return the colours of the parts of entities, (k, tints, 3).

    Args:
        rows: (k,) of entities of one shape.
    """
    table = _paint_table(frame, rows, shape)
    lit = lit_table(frame, rows)
    for tint, (_, colour) in _LIT.items():
        table[lit[:, tint] == Lit.NOW, tint] = colour
    return table


def _paint_table(frame: SceneFrame | SceneLayout, rows: IntArray, shape: Shape) -> NDArray[np.uint8]:
    """Return the colours of the parts of entities while no lamp is lit, (k, tints, 3); see `tint_table`."""
    table = np.zeros((len(rows), _NUM, 3), dtype=np.uint8)
    for tint, colour in _FIXED.items():
        table[:, tint] = colour
    bits = mix(frame.looks[rows])

    def pick(colours: NDArray[np.uint8], shift: int) -> NDArray[np.uint8]:
        return colours[((bits >> np.uint64(shift)) % np.uint64(len(colours))).astype(np.int64)]

    if shape in _THINGS:
        table[:, Tint.PAINT], table[:, Tint.SECOND] = _THINGS[shape]
        return table
    if shape in {Shape.PERSON, Shape.BICYCLE, Shape.MOTORCYCLE}:
        table[:, Tint.PAINT], table[:, Tint.SECOND] = pick(_SHIRTS, 0), pick(_TROUSERS, 8)
        table[:, Tint.SKIN], table[:, Tint.HAIR] = pick(_SKINS, 16), pick(_HAIRS, 24)
    else:
        table[:, Tint.PAINT] = pick(_BUSES if shape == Shape.BUS else _CARS, 0)
    table[frame.is_ego[rows], Tint.PAINT] = EGO_PAINT
    return table


def paints(entities: SceneFrame | SceneLayout) -> NDArray[np.uint32]:
    """Return the main colour of each entity as 65,536 red + 256 green + blue, (n,): that of `tint_table`."""
    found = np.zeros((len(entities.shapes), 3), dtype=np.uint32)
    for shape in Shape:
        rows = np.flatnonzero(entities.shapes == shape)
        if len(rows):
            found[rows] = _paint_table(entities, rows, shape)[:, Tint.PAINT]
    return np.asarray(found[:, 0] << 16 | found[:, 1] << 8 | found[:, 2], dtype=np.uint32)


def lit_table(frame: SceneFrame, rows: IntArray) -> NDArray[np.uint8]:
    """Return which parts of entities shine by themselves, (k, tints), see `Lit`.

    Args:
        rows: (k,) of entities.
    """
    lit = np.zeros((len(rows), _NUM), dtype=np.uint8)
    lit[:, Tint.HEAD_LAMP] = Lit.IN_THE_DARK
    is_on = (frame.frame * DT * BLINKS) % 1.0 < 0.5  # noqa: PLR2004 - lit and dark for as long
    lamps = frame.lamps[rows] if is_on else frame.lamps[rows] & ~np.uint8(LEFT | RIGHT)
    for tint, (bit, _) in _LIT.items():
        lit[:, tint] = lamps & bit != 0  # `Lit.NOW`
    return lit
