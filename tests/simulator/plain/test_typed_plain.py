"""Plain data as values of types: what is none is refused in a line."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.plain.typed_plain import read_as
from rosbridge_sim.world.vehicle.sensor_readings import Mounting


@pytest.mark.parametrize("data", [np.zeros(3), np.zeros((0, 2), dtype=np.int64), "x", 5, None, []])
def test_array_or_another_value_in_the_place_of_a_record_is_refused(data: object) -> None:
    with pytest.raises(DocumentError, match=r"^here: "):
        read_as(Mounting, data, "here")
