"""`--signal-plan`: the user's phases in place of a junction's."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.maps.signal_plan_file import set_signal_plan
from rosbridge_sim.world.roads.signal_plan import Lamp
from rosbridge_sim.world.state.world import DT
from tests.maps.opendrive.test_signals import ALL_ARMS, crossing


def with_plan(document: Any, road_map: RoadMap | None = None) -> RoadMap:  # noqa: ANN401 - any JSON
    return set_signal_plan(road_map or crossing(ALL_ARMS), json.dumps(document).encode(), "plan.json")


def test_phases_of_the_file_run_the_junction() -> None:
    phases = [{"green": ["TW", "TE"], "seconds": 15}, {"green": ["TS"], "seconds": 4.5}, {"seconds": 8}]
    before = crossing(ALL_ARMS)
    road_map = with_plan({"junctions": {"9": {"phases": phases, "yellow": 4, "all_red": 1}}}, before)
    plan = road_map.plan
    assert plan is not None
    (controller,) = plan.controllers
    green = [
        (
            phase.duration * DT,
            "".join(
                plan.lights[group[0]].name
                for group, colour in zip(controller.groups, phase.colours, strict=True)
                if colour == Lamp.GREEN
            ),
        )
        for phase in controller.phases
    ]
    assert green == [(15.0, "TWTE"), (1.0, ""), (4.5, "TS"), (1.0, ""), (8.0, ""), (1.0, "")]
    assert plan.cycle[0] * DT == pytest.approx(15 + 4 + 1 + 4.5 + 4 + 1 + 8 + 1)
    assert (road_map.digest != before.digest, np.array_equal(plan.light_of_lane, before.plan.light_of_lane)) == (
        True,
        True,
    )
    assert road_map.notes[-1] == "plan.json has the plan of 1 junctions"


@pytest.mark.parametrize(
    ("document", "told"),
    [
        ({"junctions": {"8": {"phases": [{"seconds": 3}]}}}, "junctions.8: expected a junction with lights, one of 9"),
        (
            {"junctions": {"9": {"phases": [{"green": ["TX"], "seconds": 3}]}}},
            r"junctions.9.phases\[0\].green: expected one of its lights \(TW, TE, TS, TN\), got 'TX'",
        ),
        ({"junctions": {"9": {"phases": []}}}, "phases"),
        ({"junctions": {"9": {"phases": [{"seconds": 0}]}}}, "seconds"),
        ([], "plan.json"),
    ],
)
def test_plan_that_does_not_fit_is_told(document: Any, told: str) -> None:  # noqa: ANN401 - any JSON
    with pytest.raises(DocumentError, match=told):
        with_plan(document)


def test_map_without_lights_takes_no_plan() -> None:
    with pytest.raises(DocumentError, match="none: the map has no traffic lights"):
        with_plan({"junctions": {"9": {"phases": [{"seconds": 3}]}}}, crossing())
    assert not with_plan({"junctions": {}}, crossing()).plan.lights
