"""Values of a CtrlCmd in a wrong unit, which would be clipped without a word: steering in degrees, pedals in percent.

A controller that saturates a little is no mistake: the world clips its steering at the vehicle's limit, as MORAI does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.morai.messages.control import Control
from rosbridge_sim.simulator.bus.warn_once import WarnOnce
from rosbridge_sim.world.state.world import Mode

MOST_STEERING: Final = 0.5 * math.pi
"""No front wheel turns farther [rad], so a greater number has another unit. Vehicles' limits are near 0.6 rad."""

ROUNDING: Final = 1e-3
"""Pedals beyond 0..1 by less are no mistake: sums of rounded numbers."""

MOST_PERCENT: Final = 100.0
LEAST_PERCENT: Final = 2.0
"""Pedals between these look like percent; a controller that saturates is below."""


def warn_of_units(control: Control, steering: str, topic: str, sender: Participant, warnings: WarnOnce) -> None:
    """Warn a client of values that are clipped because of their unit: once for each of its fields.

    Args:
        steering: name of the field for the front wheels.
        topic: topic or service that it came by.
        warnings: remembers who was warned.
    """
    if (
        abs(control.steer) <= MOST_STEERING
        and abs(control.rear_steer) <= MOST_STEERING
        and (control.mode is not Mode.PEDALS or (_is_pedal(control.throttle) and _is_pedal(control.brake)))
    ):
        return
    for field, text in _clipped(control, steering):
        warnings.warn(sender, f"{topic}: {field}: {text}", about=f"unit of {field}", reason=Reason.WRONG_VALUE)


def _is_pedal(value: float) -> bool:
    return -ROUNDING <= value <= 1.0 + ROUNDING


def _clipped(control: Control, steering: str) -> Iterator[tuple[str, str]]:
    """Yield field and text for each value that has another unit."""
    for field, angle in ((steering, control.steer), ("rear_steer", control.rear_steer)):
        if abs(angle) > MOST_STEERING:
            right = f" ({angle:g} degrees are {math.radians(angle):.3g} rad)" if abs(angle) <= _TURN else ""
            yield field, f"expected rad; {angle:g} looks like degrees and is clipped to the vehicle's limit{right}"
    if control.mode is Mode.PEDALS:
        for field, value in (("accel", control.throttle), ("brake", control.brake)):
            if not _is_pedal(value):
                looks = " looks like percent and" if LEAST_PERCENT <= value <= MOST_PERCENT else ""
                yield field, f"expected 0..1; {value:g}{looks} is clipped to {min(max(value, 0.0), 1.0):g}"


_TURN: Final = 360.0
"""Degrees beyond a whole turn are no angle of a wheel."""
