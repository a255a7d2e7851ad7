from __future__ import annotations

import math
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.mgeo_lights import colour_of, light_type
from rosbridge_sim.world.roads.signal_plan import UNSET, Lamp, SignalPlan
from rosbridge_sim.world.roads.signals import Signals
from tests.simulator.small_maps import KOREAN, ROADRUNNER, Files, light, read

R, Y, G, L = Lamp.RED, Lamp.YELLOW, Lamp.GREEN, Lamp.LEFT


def plan_of(files: Files) -> SignalPlan:
    plan = read(files).plan
    assert plan is not None
    return plan


def shown(plan: SignalPlan, *seconds: float) -> list[list[int]]:
    signals = Signals(plan)
    out = []
    for second in seconds:
        signals.show(round(second * 50))
        out.append(signals.shown.tolist())
    return out


def test_complete_light_files_are_read() -> None:
    tiny = read(ROADRUNNER)
    plan = tiny.plan
    assert plan is not None
    assert tiny.notes == ()
    assert [entry.name for entry in plan.lights] == ["C1", "C2", "L1", "P1"]
    assert [light_type(entry) for entry in plan.lights] == [0, 100, 1, 0]
    assert [entry.is_pedestrian for entry in plan.lights] == [False, False, False, True]
    assert (plan.lights[0].x, plan.lights[0].y, plan.lights[0].z) == (120.0, 3.0, 5.0)
    assert [plan.lights[0].yaw, plan.lights[3].yaw] == pytest.approx([math.pi, math.pi / 2])
    assert [(c.name, c.number) for c in plan.controllers] == [("IntTL13", 13)]
    assert plan.light_of_lane.tolist() == [-1, -1, 0, 0, 2]
    assert plan.controller_of_lane.tolist() == [-1, -1, 0, 0, 0]


def test_schedule_is_in_seconds_with_yellow_after_the_phase() -> None:
    plan = plan_of(ROADRUNNER)
    assert plan.cycle.tolist() == [50 * (10 + 3) + 275 + 100]
    # C1, C2 (three yellows), the arrow, the people's light
    assert shown(plan, 0.0, 9.98, 10.0, 12.98) == [[G, Y, R, R], [G, Y, R, R], [Y, Y, R, R], [Y, Y, R, R]]
    assert shown(plan, 13.0, 14.0, 16.98, 17.0) == [[R, Y, L, R], [R, Y, L, G], [R, Y, L, G], [R, Y, L, 0]]
    assert shown(plan, 18.5, 20.48, 20.5, 21.0) == [[R, Y, Y, R], [R, Y, Y, R], [G, Y, R, R], [G, Y, R, R]]


EMPTY = "the set of intersection controllers is empty; lights are run by their groups and schedules"
NO_CONTROLLER = "schedule 'IntTL13': the map has no such intersection controller"


def test_lights_without_groups_have_no_schedule() -> None:
    tiny = read(KOREAN)
    assert shown(tiny.plan, 0.0, 100.0) == [[UNSET, Y, UNSET, UNSET]] * 2
    assert tiny.notes == (
        "the set of intersection controllers is empty; no group and schedule runs a light instead",
        f"{NO_CONTROLLER} and no group of lights that the schedule names; it runs nothing",
    )


def without_controllers(state: dict[str, Any], **group_keys: object) -> Files:
    """A map whose set of controllers is empty, as one published copy of a real one has it."""
    schedule = {**ROADRUNNER["intersection_controller_state.json"][0], **state}
    return {
        **ROADRUNNER,
        "intersection_controller_set.json": [],
        "intersection_controller_state.json": [schedule],
        "synced_traffic_light_set.json": [
            {**group, "intersection_controller_id": None, **group_keys}
            for group in ROADRUNNER["synced_traffic_light_set.json"]
        ],
    }


GROUPS = ("SSN000000", "SSN000001", "SSN000002")
THEY_ARE_NAMED = f"{NO_CONTROLLER}; it runs the groups that it names, SSN000000, SSN000001, SSN000002"


@pytest.mark.parametrize(
    "state",
    [
        {"PSState": [[1, name, 1, 3, 1.5] for name in reversed(GROUPS)]},
        {
            "TLState": [
                {"duration": 10, "lightcolor": {"SSN000000": "SG", "SSN000001": "R", "SSN000002": "R"}},
                {"duration": 5.5, "lightcolor": {"SSN000001": "GLeft", "SSN999999": "SG"}},
            ]
        },
    ],
    ids=["people", "colours"],
)
def test_schedule_without_a_controller_runs_its_named_groups(state: dict[str, Any]) -> None:
    tiny = read(without_controllers(state))
    assert tiny.notes == (EMPTY, THEY_ARE_NAMED)
    plan = tiny.plan
    assert plan is not None
    assert [(one.name, one.number) for one in plan.controllers] == [("IntTL13", 13)]
    assert [line[:3] for line in shown(plan, 0.0, 10.0, 13.0)] == [[G, Y, R], [Y, Y, R], [R, Y, L]]
    assert plan.controller_of_lane.tolist() == [-1, -1, 0, 0, 0]


def test_schedule_may_belong_to_one_group() -> None:
    phases = [{"duration": 10, "lightcolor": ["SG"]}, {"duration": 5, "lightcolor": ["R"]}]
    plan = plan_of(without_controllers({"idx": "SSN000000", "TLState": phases, "PSState": None}))
    assert shown(plan, 0.0, 9.98, 13.0) == [[G, Y, UNSET, UNSET], [G, Y, UNSET, UNSET], [R, Y, UNSET, UNSET]]


def test_missing_controller_is_derived_from_the_groups() -> None:
    files = dict(ROADRUNNER)
    files["intersection_controller_set.json"] = [{"idx": "IntTL99", "TL": []}]
    tiny = read(files)
    assert shown(tiny.plan, 13.0) == [[R, Y, L, R]]
    assert THEY_ARE_NAMED in tiny.notes


def test_too_few_pedestrian_names_are_ignored() -> None:
    tiny = read(without_controllers({"PSState": [[1, "SSN000002", 1, 3, 1.5]]}))
    assert tiny.notes[1] == f"{NO_CONTROLLER} and no group of lights that the schedule names; it runs nothing"
    assert shown(tiny.plan, 13.0) == [[UNSET, Y, UNSET, UNSET]]


def test_schedule_without_lights_is_read() -> None:
    tiny = read({**ROADRUNNER, "traffic_light_set.json": []})
    assert not tiny.plan.lights


def test_group_file_may_contain_the_schedule() -> None:
    controllers = ROADRUNNER["intersection_controller_set.json"]
    files = {**KOREAN, "intersection_controller_set.json": controllers}
    del files["intersection_controller_data.json"]
    assert shown(plan_of(files), 13.0) == [[R, Y, L, R]]


@pytest.mark.parametrize("name", ["intersection_controller_data.json", "synced_traffic_light_state.json"])
def test_schedule_file_may_have_three_names(name: str) -> None:
    files = {key: value for key, value in ROADRUNNER.items() if key != "intersection_controller_state.json"}
    assert shown(plan_of({**files, name: ROADRUNNER["intersection_controller_state.json"]}), 13.0) == [[R, Y, L, R]]


def test_full_file_takes_precedence_over_an_empty_one() -> None:
    files = {**ROADRUNNER, "intersection_controller_state.json": []}
    files["intersection_controller_data.json"] = ROADRUNNER["intersection_controller_state.json"]
    assert shown(plan_of(files), 13.0) == [[R, Y, L, R]]


def test_groups_may_name_their_controller() -> None:
    files = {key: value for key, value in ROADRUNNER.items() if key != "intersection_controller_set.json"}
    assert shown(plan_of(files), 13.0) == [[R, Y, L, R]]


def test_synced_lights_form_a_group_without_a_controller() -> None:
    files = {key: value for key, value in ROADRUNNER.items() if "controller" not in key}
    groups = [{**group, "intersection_controller_id": None} for group in files["synced_traffic_light_set.json"]]
    plan = plan_of({**files, "synced_traffic_light_set.json": groups})
    assert plan.group.tolist() == [0, 0, 1, 2]
    assert plan.controllers == ()


@pytest.mark.parametrize("missing", [name for name in ROADRUNNER if "light" in name or "controller" in name])
def test_every_light_file_is_optional(missing: str) -> None:
    tiny = read({name: value for name, value in ROADRUNNER.items() if name != missing})
    assert (not tiny.plan.lights) == (missing == "traffic_light_set.json")


def test_map_without_lights_has_no_signal_plan() -> None:
    assert read({**ROADRUNNER, "traffic_light_set.json": []}).plan.lights == ()


def schedule(**changes: Any) -> Files:  # noqa: ANN401 - keys of a schedule
    entry = ROADRUNNER["intersection_controller_state.json"][0]
    return {**ROADRUNNER, "intersection_controller_state.json": [{**entry, **changes}]}


def test_incomplete_schedule_is_completed() -> None:
    short = schedule(
        TLState=[{"duration": 10, "lightcolor": ["SG"]}, {"duration": 10, "lightcolor": []}], yelloduration=[]
    )
    assert shown(plan_of(short), 0.0, 10.0, 12.98, 13.0) == [[G, Y, R, R], [Y, Y, R, R], [Y, Y, R, R], [R, Y, R, R]]
    assert read(short).notes[0] == "schedule 'IntTL13', phase 0: 1 colours for 3 groups; the others are red"
    unknown = read(schedule(TLState=[{"duration": 0, "lightcolor": ["SG", "purple", "R"]}]))
    assert unknown.notes[0] == "schedule 'IntTL13', phase 0: 'purple' is no colour that is known; it is read as red"
    nothing = read(schedule(TLState=[]))
    assert nothing.notes == ("intersection controller 'IntTL13' has no schedule; its lights are not lit",)


def test_pedestrian_lights_are_found_by_group_number_or_name() -> None:
    for target in (2, "2", 2.0, "SSN000002"):
        assert shown(plan_of(schedule(PSState=[[1, target, 1, 3, 1.5]])), 14.0) == [[R, Y, L, G]]
    lost = read(schedule(PSState=[[1, 9, 1, 3, 1], [7, 2, 1, 3, 1], [1, "SSN9", 1, 3, 1]]))
    assert len(lost.notes) == 3
    assert lost.notes[0] == "schedule 'IntTL13': PSState of phase 1 and group '9', which are not there"


def test_number_of_notes_is_bounded() -> None:
    notes = read(schedule(PSState=[[1, 9, 1, 3, 1]] * 50)).notes
    assert (len(notes), notes[-1]) == (21, "... and 30 more of that kind")


def test_duplicate_light_counts_once() -> None:
    tiny = read({**ROADRUNNER, "traffic_light_set.json": [*ROADRUNNER["traffic_light_set.json"], light("C1", ["B2D"])]})
    assert len(tiny.plan.lights) == 4
    assert tiny.notes == ("traffic light 'C1' is listed twice; the first one is used",)


@pytest.mark.parametrize(
    ("sub_type", "number"),
    [
        (["red", "yellow", "straight"], 0),
        (["red", "yellow", "left"], 1),
        (["red", "yellow", "left", "straight"], 2),
        (["yellow", "yellow", "yellow"], 100),
        ("red_yellow_left_straight", 2),
        (None, 0),
        ([], 0),
        (["blue"], 0),
    ],
)
def test_light_type_follows_from_its_lamps(sub_type: object, number: int) -> None:
    plan = plan_of({**ROADRUNNER, "traffic_light_set.json": [light("X", [], sub_type=sub_type)]})
    assert light_type(plan.lights[0]) == number


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("R", 1), ("Y", 4), ("SG", 16), ("R_with_Y", 5), ("Y_with_G", 20), ("Y_with_GLeft", 36)),
        *(("G_with_GLeft", 48), ("R_with_GLeft", 33), (" r ", 1), ("", 0), ("off", 0), ("48", 48), ("0", 0)),
        *(("ULG_with_URG", None), ("2", None), ("99999", None), ("-1", None), ("purple", None), ("R_with_", 1)),
    ],
)
def test_colours_may_be_names_or_numbers(name: str, value: int | None) -> None:
    assert colour_of(name) == value


def test_protected_left_turns_need_the_arrow() -> None:
    def passes(signal: str | None) -> int:
        links = [
            {**entry, "related_signal": signal} if entry["idx"] == "B2D" else entry
            for entry in ROADRUNNER["link_set.json"]
        ]
        return int(plan_of({**ROADRUNNER, "link_set.json": links}).pass_of_lane[4])

    assert passes("left") == passes(None) == L
    assert passes("left_unprotected") == L | G
    assert passes("right_unprotected") & G
    assert passes("uturn") == Lamp.U_TURN | L
    assert passes("straight") & G


def test_unknown_links_are_skipped() -> None:
    lights = [light("X", ["B1C1", "A1B1-A2B2", "no such link"])]
    assert plan_of({**ROADRUNNER, "traffic_light_set.json": lights}).lights[0].lanes == (2,)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("traffic_light_set.json", {}, "tiny/traffic_light_set.json: expected a list, got an object"),
        (
            "traffic_light_set.json",
            [{"idx": "x", "heading": "n"}],
            "tiny/traffic_light_set.json: [0].heading: expected a",
        ),
        (
            "intersection_controller_set.json",
            [{"idx": "x", "TL": ["C1"]}],
            "tiny/intersection_controller_set.json: [0].TL[0]: expected a list, got 'C1'",
        ),
        (
            "intersection_controller_state.json",
            [{"idx": "x", "TLState": [{"duration": "long", "lightcolor": []}]}],
            "tiny/intersection_controller_state.json: [0].TLState[0].duration: expected a number, got 'long'",
        ),
        (
            "intersection_controller_state.json",
            [{"idx": "x", "TLState": [{"duration": -1, "lightcolor": []}]}],
            "tiny/intersection_controller_state.json: [0].TLState[0].duration: expected at least 0, got -1",
        ),
        (
            "intersection_controller_state.json",
            [{"idx": "x", "TLState": [], "PSState": [[1, 2]]}],
            "tiny/intersection_controller_state.json: [0].PSState[0]: expected a list of 5",
        ),
        ("synced_traffic_light_set.json", 5, "tiny/synced_traffic_light_set.json: expected a list, got 5"),
        ("crosswalk_set.json", [{}], "tiny/crosswalk_set.json: [0].idx: missing"),
    ],
)
def test_errors_name_file_and_path(name: str, content: object, message: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read({**ROADRUNNER, name: content})
    assert str(caught.value).startswith(message)
    assert len(str(caught.value).splitlines()) == 1


# Crosswalks


def test_crosswalks_have_outlines_and_lights() -> None:
    crosswalks = read(ROADRUNNER).crosswalks
    assert [(c.name, len(c.outlines), c.lights) for c in crosswalks] == [("CW1", 1, (3,)), ("SCW2", 1, ())]
    assert crosswalks[0].outlines[0].tolist()[0] == [102.0, -4.0, 0.0]


def test_crosswalk_parts_may_be_linked_from_either_side() -> None:
    files = {**ROADRUNNER, "crosswalk_set.json": [{"idx": "CW1", "single_crosswalk_list": None}]}
    assert [c.name for c in read(files).crosswalks] == ["CW1", "SCW2"]
    files = {**ROADRUNNER, "crosswalk_set.json": [{"idx": "other", "single_crosswalk_list": ["SCW2", "gone"]}]}
    assert [c.name for c in read(files).crosswalks] == ["other", "SCW1"]
    assert read(KOREAN).crosswalks == ()
    flat = [{"idx": "S", "points": [[0, 0, 0], [1, 1, 0]]}]
    assert read({**KOREAN, "singlecrosswalk_set.json": flat}).crosswalks == ()
