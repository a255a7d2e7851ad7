"""Stories as they are told: triggers, actions and conditions, each on a small map with values worked out by hand."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import Projection
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.openscenario.entities import place_entities
from rosbridge_sim.scenarios.openscenario.places import StoryMap
from rosbridge_sim.scenarios.openscenario.storyboard import StoryVerdict
from rosbridge_sim.simulator.story.motions import shape_at
from rosbridge_sim.world.state.placement import place_ghost
from tests.simulator.story.story_texts import (
    WALKER,
    Telling,
    after,
    at,
    by_entity,
    by_value,
    event,
    group,
    lane_change,
    lanes,
    lateral,
    link,
    longitudinal,
    routing,
    scenario_of,
    speed,
    state_of,
    story,
    teleport,
    trigger,
)

EGO = {"Ego": teleport(link("middle", 20)) + speed(10)}


def with_car(s: float = 60.0, v: float = 10.0, lane: str = "middle") -> dict[str, str]:
    return {**EGO, "Car": teleport(link(lane, s)) + speed(v)}


# Places at the start, and who is the ego


def test_entities_begin_where_init_places_them_with_its_speeds() -> None:
    telling = Telling(story({**EGO, "Car": teleport(at(200.0, 3.5, math.pi)) + speed(5)}))
    assert (telling.x("Ego"), telling.y("Ego"), telling.speed("Ego")) == (20.0, 0.0, 10.0)
    assert (telling.x("Car"), telling.speed("Car")) == (200.0, 5.0)
    telling.run(1.0)
    assert telling.x("Ego") == pytest.approx(30.0)
    assert telling.x("Car") == pytest.approx(195.0)  # it faces west


def test_relative_positions_follow_the_lane_of_their_entity() -> None:
    relative = '<Position><RelativeLanePosition entityRef="Ego" dLane="1" ds="25" offset="0.5"/></Position>'
    ahead = '<Position><RelativeObjectPosition entityRef="Ego" dx="10" dy="-2"/></Position>'
    telling = Telling(story({**EGO, "Car": teleport(relative), "Other": teleport(ahead)}))
    assert (telling.x("Car"), telling.y("Car")) == pytest.approx((45.0, 4.0))
    assert (telling.x("Other"), telling.y("Other")) == pytest.approx((30.0, -2.0))


def trajectory_position(s: float, t: float = 0.0) -> str:
    corners = "".join(f"<Vertex time='0'>{at(x, y)}</Vertex>" for x, y in ((50, 0), (50, 10), (80, 10)))
    shape = f"<Shape><Polyline>{corners}</Polyline></Shape>"
    trajectory = f'<TrajectoryRef><Trajectory name="t" closed="false">{shape}</Trajectory></TrajectoryRef>'
    return f'<Position><TrajectoryPosition s="{s}" t="{t}">{trajectory}</TrajectoryPosition></Position>'


def test_a_position_on_a_trajectory_is_along_and_beside_its_line() -> None:
    places = {"Car": (4.0, 1.0), "Other": (25.0, -2.0), "Last": (40.0, 0.0)}
    telling = Telling(story({**EGO, **{name: teleport(trajectory_position(*at)) for name, at in places.items()}}))
    found = [(telling.x(name), telling.y(name)) for name in places]
    assert found == [pytest.approx(each) for each in ((49.0, 4.0), (65.0, 8.0), (80.0, 10.0))]
    with pytest.raises(DocumentError, match=r"TrajectoryPosition: s: expected 0..40.00 m.*, got 41"):
        Telling(story({**EGO, "Car": teleport(trajectory_position(41.0))}))


def test_trajectories_of_positions_are_bounded_because_each_look_finds_all_vertices() -> None:
    many = trajectory_position(1.0)
    many = many.replace("</Polyline>", f"<Vertex time='0'>{at(1, 1)}</Vertex>" * 1000 + "</Polyline>")
    with pytest.raises(DocumentError, match="expected at most 1,000 conditions"):
        scenario_of(story({**EGO, "Car": teleport(many)}))


def test_names_in_an_evaluation_are_checked() -> None:
    unknown = by_value('<VariableCondition variableRef="m" value="1" rule="equalTo"/>')
    end = f"<Evaluation><SuccessConditionGroup>{unknown}</SuccessConditionGroup></Evaluation>"
    with pytest.raises(DocumentError, match="there is no 'm'"):
        scenario_of(story(EGO, end=end))


GLOBE = Projection(is_tm=True, central_latitude=37.5, central_meridian=127.0)


@pytest.mark.parametrize(
    "angles",
    [
        'latitudeDeg="37.501" longitudeDeg="127.002"',
        f'latitude="{math.radians(37.501)}" longitude="{math.radians(127.002)}"',
    ],
)
def test_a_position_on_the_globe_goes_through_the_projection_of_the_map(angles: str) -> None:
    story_map = StoryMap.of(replace(lanes(), projection=GLOBE, origin=(100.0, 50.0, 0.0)))
    scenario = scenario_of(story({"Ego": teleport(f"<Position><GeoPosition {angles}/></Position>")}))
    ego = place_entities(scenario, story_map).egos[0]
    # An arc of 0.001 and of 0.002 degrees on WGS 84 at 37.5 degrees north.
    assert (ego.x + 100.0, ego.y + 50.0) == pytest.approx((176.8, 111.0), abs=0.3)


@pytest.mark.parametrize("angles", ['latitudeDeg="37.5"', ""])
def test_a_position_on_the_globe_needs_a_projection_and_both_angles(angles: str) -> None:
    scenario = scenario_of(story({"Ego": teleport(f"<Position><GeoPosition {angles}/></Position>")}))
    with pytest.raises(DocumentError, match="the map has no projection; use WorldPosition"):
        place_entities(scenario, StoryMap.of(lanes()))
    with pytest.raises(DocumentError, match="expected latitudeDeg and longitudeDeg"):
        place_entities(scenario, StoryMap.of(replace(lanes(), projection=GLOBE)))


def test_a_place_that_the_map_lacks_is_refused_with_its_line() -> None:
    with pytest.raises(DocumentError, match=r"story.xosc: line 5: LinkPosition: the map has no link 'midle'.*middle"):
        Telling(story({"Ego": teleport(link("midle", 20))}))


def test_the_program_drives_the_ego_by_default_and_the_story_sees_it() -> None:
    reach = by_entity("Ego", f'<ReachPositionCondition tolerance="1">{link("middle", 20)}</ReachPositionCondition>')
    text = story(with_car(), group("Car", event("go", speed(3), reach)))
    telling = Telling(text, drives_ego=False)
    assert telling.speed("Ego") == 10.0
    telling.run(0.1)
    assert telling.world.is_ghost[telling.row("Car")]
    assert not telling.world.is_ghost[telling.row("Ego")]
    assert telling.speed("Car") == 3.0


# Actions


@pytest.mark.parametrize(("shape", "peak"), [("linear", 1.0), ("sinusoidal", math.pi / 2), ("cubic", 1.5)])
def test_a_change_of_speed_by_rate_has_that_rate_at_its_steepest(shape: str, peak: float) -> None:
    telling = Telling(story(with_car(), group("Car", event("faster", speed(13, shape, "rate", 3), after(0)))))
    speeds = [telling.speed("Car")]
    for _ in range(100):
        telling.run(0.02)
        speeds.append(telling.speed("Car"))
    rates = np.diff(speeds) / 0.02
    assert rates.max() == pytest.approx(3.0, rel=2e-3)
    assert speeds[-1] == 13.0
    length = peak * 3.0 / 3.0
    assert np.flatnonzero(np.array(speeds) == 13.0)[0] == pytest.approx(length * 50, abs=1.5)


def test_a_change_of_speed_by_time_takes_the_way_of_its_mean_speed() -> None:
    telling = Telling(story(with_car(v=0.0), group("Car", event("go", speed(8, "sinusoidal", "time", 4), after(0)))))
    telling.run(4.02)
    assert telling.speed("Car") == 8.0
    assert telling.x("Car") - 60.0 == pytest.approx(
        16.0 + 0.02 * 8.0 + 0.025 * 8.0
    )  # speeds are those at ends of steps


def test_a_change_of_speed_is_no_faster_than_the_performance() -> None:
    telling = Telling(story(with_car(v=0.0), group("Car", event("go", speed(20, "linear", "time", 0.5), after(0)))))
    telling.run(1.0)
    assert telling.speed("Car") == pytest.approx(10.0, abs=0.25)  # maxAcceleration is 10


def test_a_relative_speed_that_is_continuous_follows() -> None:
    goal = '<RelativeTargetSpeed entityRef="Ego" value="1.5" speedTargetValueType="factor" continuous="true"/>'
    slower = event("slower", speed(4), after(1), priority="override")
    telling = Telling(story(with_car(), group("Car", event("same", speed(goal), after(0))), group("Ego", slower)))
    telling.run(0.5)
    assert telling.speed("Car") == 15.0
    telling.run(1.0)
    assert telling.speed("Car") == 6.0
    assert not telling.running.is_done(telling.running.state.running[0].number)


@pytest.mark.parametrize("shape", ["linear", "sinusoidal", "cubic"])
def test_a_lane_change_has_its_shape_and_ends_in_the_middle_of_the_lane(shape: str) -> None:
    change = lane_change('<RelativeTargetLane entityRef="Car" value="1"/>', shape, "time", 2.0)
    telling = Telling(story(with_car(), group("Car", event("change", change, after(0)))))
    for tenth in range(1, 20):
        telling.run(0.1)
        assert telling.y("Car") == pytest.approx(3.5 * shape_at(shape, tenth / 20.0), abs=1e-9)
    telling.run(0.1)
    actor = telling.running.state.actors["Car"]
    assert telling.world.roads.ids[actor.lane] == "left"
    assert actor.offset == pytest.approx(0.0, abs=1e-9)
    assert actor.turned == 0.0


def test_its_speed_is_along_its_way_while_it_changes_lanes() -> None:
    change = lane_change('<RelativeTargetLane entityRef="Car" value="-1"/>', "linear", "time", 1.0)
    telling = Telling(story(with_car(), group("Car", event("change", change, after(0)))))
    telling.run(0.5)
    assert telling.x("Car") - 60.0 == pytest.approx(0.5 * math.sqrt(100.0 - 3.5**2), abs=1e-6)
    assert telling.world.yaw[telling.row("Car")] == pytest.approx(-math.asin(0.35))


def test_a_lane_that_is_not_there_ends_the_action_and_nothing_else(caplog: pytest.LogCaptureFixture) -> None:
    change = lane_change('<RelativeTargetLane entityRef="Car" value="2"/>')
    telling = Telling(story(with_car(), group("Car", event("change", change, after(0)))))
    telling.run(1.0)
    assert telling.y("Car") == 0.0
    assert telling.began("Event", "change")
    assert "no lane +1 beside link 'left'" in caplog.text or "no lane +2 beside link 'middle'" in caplog.text


def test_an_offset_is_reached_with_the_given_acceleration() -> None:
    offset = lateral(
        '<LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="sinusoidal" maxLateralAcc="1"/>'
        '<LaneOffsetTarget><AbsoluteTargetLaneOffset value="-1"/></LaneOffsetTarget></LaneOffsetAction>'
    )
    telling = Telling(story(with_car(), group("Car", event("aside", offset, after(0)))))
    ys = []
    for _ in range(30):
        telling.run(0.1)
        ys.append(telling.y("Car"))
    assert ys[-1] == -1.0
    assert np.abs(np.diff(ys, 2)).max() / 0.1**2 == pytest.approx(1.0, abs=0.02)


def test_a_trajectory_with_times_is_where_its_vertices_say() -> None:
    vertices = "".join(f'<Vertex time="{t}">{at(x, y)}</Vertex>' for t, x, y in ((0, 60, 0), (2, 80, 0), (4, 80, 20)))
    follow = routing(
        '<FollowTrajectoryAction><Trajectory name="t" closed="false"><Shape><Polyline>'
        f"{vertices}</Polyline></Shape></Trajectory>"
        '<TimeReference><Timing domainAbsoluteRelative="relative" scale="0.5" offset="0"/></TimeReference>'
        '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>'
    )
    telling = Telling(story(with_car(), group("Car", event("follow", follow, after(1)))))
    telling.run(1.0)
    telling.run(0.5)
    assert (telling.x("Car"), telling.y("Car")) == pytest.approx((70.0, 0.0))
    telling.run(1.0)
    assert (telling.x("Car"), telling.y("Car")) == pytest.approx((80.0, 10.0))
    assert telling.speed("Car") == pytest.approx(20.0)
    assert telling.world.yaw[telling.row("Car")] == pytest.approx(math.pi / 2)


def test_a_trajectory_without_times_goes_with_the_speed() -> None:
    vertices = "".join(f"<Vertex>{at(x, y)}</Vertex>" for x, y in ((60, 0), (63, 4), (63, 20)))
    follow = routing(
        '<FollowTrajectoryAction><Trajectory name="t" closed="false"><Shape><Polyline>'
        f"{vertices}</Polyline></Shape></Trajectory><TimeReference><None/></TimeReference></FollowTrajectoryAction>"
    )
    init = {**EGO, "walker": teleport(at(60, 0)) + speed(2)}
    telling = Telling(story(init, group("walker", event("walk", follow, after(0)))))
    telling.run(1.0)
    assert (telling.x("walker"), telling.y("walker")) == pytest.approx((61.2, 1.6))
    telling.run(2.0)
    assert (telling.x("walker"), telling.y("walker")) == pytest.approx((63.0, 5.0))


def test_a_gap_is_reached_and_kept() -> None:
    keep = longitudinal(
        '<LongitudinalDistanceAction entityRef="Car" continuous="true" freespace="true" distance="15"'
        ' displacement="trailingReferencedEntity"><DynamicConstraints maxAcceleration="3" maxDeceleration="5"'
        ' maxSpeed="30"/></LongitudinalDistanceAction>'
    )
    telling = Telling(story(with_car(50.0), group("Ego", event("keep", keep, after(0)))))
    telling.run(8.0)
    assert telling.x("Car") - telling.x("Ego") == pytest.approx(15.0 + 5.0, abs=0.05)
    assert telling.speed("Ego") == pytest.approx(10.0, abs=0.05)


def test_a_gap_is_reached_within_the_rates_of_acceleration() -> None:
    keep = longitudinal(
        '<LongitudinalDistanceAction entityRef="Car" continuous="true" freespace="false" timeGap="2">'
        '<DynamicConstraints maxAcceleration="3" maxDeceleration="3" maxAccelerationRate="1" maxDecelerationRate="2"/>'
        "</LongitudinalDistanceAction>"
    )
    telling = Telling(story(with_car(), group("Ego", event("keep", keep, after(0)))))
    speeds = [10.0]
    for _ in range(100):
        telling.run(0.1)
        speeds.append(telling.speed("Ego"))
    accels = np.diff(speeds) / 0.1
    rates = np.diff(accels) / 0.1
    assert rates[accels[1:] > 0.05].max() <= 1.0 + 1e-9  # the throttle is opened at this rate
    assert rates[accels[1:] < -0.05].min() >= -2.0 - 1e-9  # and the brakes at this one
    assert accels.min() < -0.2
    assert telling.x("Car") - telling.x("Ego") == pytest.approx(20.0, abs=3.0)


def test_a_gap_without_limits_is_there_at_once() -> None:
    lead = longitudinal(
        '<LongitudinalDistanceAction entityRef="Ego" continuous="false" freespace="true" timeGap="2"'
        ' displacement="leadingReferencedEntity"/>'
    )
    telling = Telling(story({**EGO, "Car": teleport(link("middle", 30)) + speed(10) + lead}))
    assert telling.x("Car") - telling.x("Ego") == pytest.approx(20.0 + 5.0)


def test_a_distance_to_the_side_is_kept_within_the_limits() -> None:
    keep = lateral(
        '<LateralDistanceAction entityRef="Ego" continuous="true" freespace="true" distance="0.5"'
        ' displacement="leftToReferencedEntity"><DynamicConstraints maxSpeed="1" maxAcceleration="2"/>'
        "</LateralDistanceAction>"
    )
    telling = Telling(story(with_car(20.0, lane="left"), group("Car", event("keep", keep, after(0)))))
    ys = [telling.y("Car")]
    for _ in range(70):
        telling.run(0.1)
        ys.append(telling.y("Car"))
    assert ys[-1] == pytest.approx(2.5, abs=0.03)  # two cars of 2 m, and 0.5 m between them
    assert np.abs(np.diff(ys)).max() <= 1.0 * 0.1 + 1e-9


def test_synchronized_cars_arrive_together() -> None:
    target = link("middle", 70).replace("Position>", "TargetPositionMaster>")
    own = link("right", 114).replace("Position>", "TargetPosition>")
    final = '<FinalSpeed><AbsoluteSpeed value="12"/></FinalSpeed>'
    meet = f'<SynchronizeAction masterEntityRef="Ego">{target}{own}{final}</SynchronizeAction>'
    meet = f"<PrivateAction>{meet}</PrivateAction>"
    telling = Telling(story(with_car(lane="right"), group("Car", event("meet", meet, after(0)))))
    telling.run(4.9)  # the ego has 50 m at 10 m/s
    assert telling.x("Ego") == pytest.approx(69.0, abs=0.2)
    assert telling.x("Car") == pytest.approx(114.0 - 0.1 * 12.0, abs=0.3)
    assert telling.speed("Car") == pytest.approx(12.0, abs=0.2)


@pytest.mark.parametrize(("own", "final"), [(70.0, 8.0), (140.0, 10.0), (50.0, None)])
def test_arrival_with_the_master_goes_before_the_performance(own: float, final: float | None) -> None:
    target = link("middle", 70).replace("Position>", "TargetPositionMaster>")
    place = link("right", own).replace("Position>", "TargetPosition>")
    end = "" if final is None else f'<FinalSpeed><AbsoluteSpeed value="{final}"/></FinalSpeed>'
    meet = f'<SynchronizeAction masterEntityRef="Ego">{target}{place}{end}</SynchronizeAction>'
    meet = f"<PrivateAction>{meet}</PrivateAction>"
    telling = Telling(story(with_car(20.0, v=0.0, lane="right"), group("Car", event("meet", meet, after(0)))))
    telling.run(5.0)  # the ego has 50 m at 10 m/s
    assert telling.x("Ego") == pytest.approx(70.0)
    assert telling.x("Car") == pytest.approx(own, abs=0.2)
    telling.run(0.1)
    # Without a final speed the least accelerations fall evenly to 0: 1.5 times the mean speed.
    assert telling.speed("Car") == pytest.approx(1.5 * (own - 20.0) / 5.0 if final is None else final, abs=0.2)


@pytest.mark.parametrize("steady", ['TargetDistanceSteadyState distance="24"', 'TargetTimeSteadyState time="3"'])
def test_the_final_speed_is_steady_before_the_target(steady: str) -> None:
    target = link("middle", 80).replace("Position>", "TargetPositionMaster>")
    own = link("right", 80).replace("Position>", "TargetPosition>")
    end = f'<FinalSpeed><AbsoluteSpeed value="8"><{steady}/></AbsoluteSpeed></FinalSpeed>'
    meet = f'<SynchronizeAction masterEntityRef="Ego">{target}{own}{end}</SynchronizeAction>'
    meet = f"<PrivateAction>{meet}</PrivateAction>"
    telling = Telling(story(with_car(20.0, v=4.0, lane="right"), group("Car", event("meet", meet, after(0)))))
    telling.run(3.0)
    assert telling.x("Car") == pytest.approx(80.0 - 24.0, abs=0.3)
    for _ in range(14):
        telling.run(0.2)
        assert telling.speed("Car") == pytest.approx(8.0, abs=0.05)
    telling.run(0.2)
    assert telling.x("Car") == pytest.approx(80.0, abs=0.3)


def test_shifts_to_the_side_follow_each_other_at_their_times() -> None:
    def shift(value: float) -> str:
        goal = f'<LaneOffsetTarget><AbsoluteTargetLaneOffset value="{value}"/></LaneOffsetTarget>'
        dynamics = '<LaneOffsetActionDynamics dynamicsShape="sinusoidal" maxLateralAcc="8"/>'
        return lateral(f'<LaneOffsetAction continuous="false">{dynamics}{goal}</LaneOffsetAction>')

    def behind(name: str, delay: float) -> str:
        return state_of("action", f"{name} action", "endTransition", delay=delay, edge="rising")

    events = (
        event("a", shift(1.5), after(1)),
        event("b", shift(0), behind("a", 1)),
        event("c", shift(-1), behind("b", 0)),
    )
    telling = Telling(story(with_car(), group("Car", *events)))
    begun: dict[str, float] = {}
    for _ in range(250):
        telling.run(0.02)
        begun |= {name: telling.running.time() for name in "abc" if name not in begun and telling.began("Event", name)}
    long = math.pi * math.sqrt(1.5 / 16.0)  # pi sqrt(d / 2 a)
    assert begun["a"] == pytest.approx(1.0)
    assert begun["b"] == pytest.approx(2.0 + long, abs=0.1)
    assert begun["c"] == pytest.approx(2.0 + 2.0 * long, abs=0.2)
    assert telling.y("Car") == -1.0


def test_a_lead_car_brakes_and_the_story_ends_a_time_later() -> None:
    brake = event("brake", speed(0, "linear", "rate", 5), after(2, edge="rising"))
    stop = trigger(state_of("action", "brake action", "completeState", delay=1, edge="rising"), tag="x")[3:-4]
    telling = Telling(story(with_car(), group("Car", brake), stop=stop))
    telling.run(3.9)
    assert telling.speed("Car") == pytest.approx(0.5)
    telling.run(0.2)
    assert telling.speed("Car") == 0.0
    assert telling.x("Car") == pytest.approx(60.0 + 20.0 + 10.0, abs=0.5 * 10.0 * 0.05)
    telling.run(0.8)
    assert not telling.running.state.board.is_over
    telling.run(0.3)
    assert telling.running.state.board.is_over


def test_a_speed_profile_goes_through_its_entries() -> None:
    entries = "".join(f'<SpeedProfileEntry time="{t}" speed="{v}"/>' for t, v in ((0, 0), (2, 10), (2, 4)))
    profile = longitudinal(f'<SpeedProfileAction followingMode="position">{entries}</SpeedProfileAction>')
    telling = Telling(story(with_car(v=0), group("Car", event("profile", profile, after(0)))))
    telling.run(1.0)
    assert telling.speed("Car") == pytest.approx(5.0)
    telling.run(2.0)
    assert telling.speed("Car") == pytest.approx(7.0)
    telling.run(1.1)
    assert telling.speed("Car") == 4.0
    assert telling.x("Car") - 60.0 == pytest.approx(10.0 + 14.0 + 0.1 * 4.0 + 0.025 * 4.0)


def test_a_speed_profile_that_follows_keeps_the_rates_of_acceleration() -> None:
    limits = '<DynamicConstraints maxAcceleration="5" maxAccelerationRate="4" maxDecelerationRate="2"/>'
    entries = limits + '<SpeedProfileEntry time="4" speed="8"/><SpeedProfileEntry time="4" speed="4"/>'
    profile = longitudinal(f'<SpeedProfileAction followingMode="follow">{entries}</SpeedProfileAction>')
    telling = Telling(story(with_car(v=0), group("Car", event("profile", profile, after(0)))))
    speeds = [0.0]
    for _ in range(90):
        telling.run(0.1)
        speeds.append(telling.speed("Car"))
    assert speeds[5] == pytest.approx(1.0 * 0.5)  # 4 m/s^3 for 0.5 s, to 2 m/s^2
    assert speeds[20] == pytest.approx(2.0 * 2.0 - 0.5)
    assert speeds[60] == pytest.approx(8.0 - 2.0)  # on the line of the second entry, behind a bend of 1.5 s
    assert speeds[-1] == 4.0
    rates = np.diff(speeds, 2) / 0.1**2
    assert (rates.min(), rates.max()) == pytest.approx((-2.0, 4.0), abs=0.05)


def test_a_short_change_within_rates_does_not_overshoot() -> None:
    limits = '<DynamicConstraints maxAccelerationRate="1" maxDecelerationRate="1"/>'
    entries = f'{limits}<SpeedProfileEntry time="0.1" speed="11"/>'
    profile = longitudinal(f'<SpeedProfileAction followingMode="follow">{entries}</SpeedProfileAction>')
    telling = Telling(story(with_car(), group("Car", event("profile", profile, after(0)))))
    speeds = []
    for _ in range(30):
        telling.run(0.1)
        speeds.append(telling.speed("Car"))
    assert speeds[9] == pytest.approx(10.5)  # 1 m/s^3 for 1 s, up and down again
    assert max(speeds) == speeds[-1] == pytest.approx(11.0)


def test_between_steps_of_the_story_frames_show_the_way_evenly() -> None:
    telling = Telling(story({**EGO, "Car": teleport(at(60, 3.5, math.pi)) + speed(5)}))
    xs = []
    for _ in range(20):
        telling.run(0.02)
        xs.append(telling.x("Car"))
    assert np.diff(xs) == pytest.approx(-5.0 * 0.02)


def test_triggers_see_an_ego_of_the_program_where_it_is_at_the_step() -> None:
    there = by_entity("Ego", '<TraveledDistanceCondition value="2.45"/>')
    telling = Telling(story(with_car(), group("Car", event("go", speed(3), there))), drives_ego=False)
    for _ in range(50):
        row = telling.row("Ego")
        place_ghost(telling.world, row, x=telling.x("Ego") + 0.2, y=0.0, z=0.0, yaw=0.0, speed=10.0)
        telling.run(0.02)
        if telling.began("Event", "go"):
            break
    assert telling.running.time() == pytest.approx(0.25)
    assert telling.running.state.actors["Ego"].x == pytest.approx(20.0 + 2.5)


def test_entities_are_added_and_deleted() -> None:
    add, delete = (
        f'<GlobalAction><EntityAction entityRef="Late">{each}</EntityAction></GlobalAction>'
        for each in (f"<AddEntityAction>{link('left', 50)}</AddEntityAction>", "<DeleteEntityAction/>")
    )
    events = event("add", add, after(1)), event("go", speed(2), after(1.5)), event("delete", delete, after(3))
    telling = Telling(story({**EGO, "Late": ""}, group("Late", *events)))
    assert telling.running.state.actors["Late"].uid == -1
    telling.run(2.0)
    assert (telling.x("Late"), telling.y("Late")) == pytest.approx((50.96, 3.5), abs=0.05)
    telling.run(1.1)
    assert telling.running.state.actors["Late"].uid == -1
    assert len(telling.world) == 1


def test_lights_show_what_the_story_sets() -> None:
    red, green = (
        "<GlobalAction><InfrastructureAction><TrafficSignalAction>"
        f'<TrafficSignalStateAction name="light" state="{each}"/>'
        "</TrafficSignalAction></InfrastructureAction></GlobalAction>"
        for each in ("on;off;off", "green")
    )
    seen = by_value('<TrafficSignalCondition name="light" state="green"/>')
    events = event("red", red, after(0)), event("green", green, after(1)), event("go", speed(20), seen)
    telling = Telling(story(with_car(), group("Car", *events)))
    telling.run(0.5)
    assert telling.world.signals.shown[0] == 1
    assert telling.speed("Car") == 10.0
    telling.run(0.6)
    assert telling.world.signals.shown[0] == 16
    assert telling.speed("Car") == 20.0


def test_a_controller_hands_an_actor_to_a_driver_of_the_world_and_an_action_takes_it_back() -> None:
    activate = '<ActivateControllerAction lateral="true" longitudinal="true"/>'
    drive = f"<PrivateAction><ControllerAction>{activate}</ControllerAction></PrivateAction>"
    events = event("drive", drive, after(0)), event("stop", speed(0), after(3))
    telling = Telling(story(with_car(), group("Car", *events)))
    telling.run(2.0)
    assert telling.world.has_lane[telling.row("Car")]
    assert telling.x("Car") > 75.0
    telling.run(1.1)
    assert not telling.world.has_lane[telling.row("Car")]
    assert telling.speed("Car") == 0.0


def test_a_controller_of_the_ego_leaves_it_to_the_story(caplog: pytest.LogCaptureFixture) -> None:
    activate = '<ActivateControllerAction lateral="true" longitudinal="true"/>'
    drive = f"<PrivateAction><ControllerAction>{activate}</ControllerAction></PrivateAction>"
    telling = Telling(story(EGO, group("Ego", event("drive", drive, after(0)))))
    telling.run(1.0)
    assert telling.x("Ego") == pytest.approx(30.0)
    assert "no effect" not in caplog.text


def test_a_route_decides_where_lanes_fork_and_bends_keep_the_speed() -> None:
    telling = Telling(story({"Ego": teleport(link("middle", 990)) + speed(10)}))
    telling.run(5.0)  # 10 m straight, 40 m of the bend of radius 50
    turned = 40.0 / 50.0
    assert telling.x("Ego") == pytest.approx(1000.0 + 50.0 * math.sin(turned), abs=0.05)
    assert telling.y("Ego") == pytest.approx(50.0 - 50.0 * math.cos(turned), abs=0.05)


def test_an_offset_in_a_bend_keeps_the_speed_of_the_actor_not_of_the_line() -> None:
    telling = Telling(story({"Ego": teleport(link("bend", 50, 1.0)) + speed(10)}))
    before = np.array([telling.x("Ego"), telling.y("Ego")])
    telling.run(0.02)
    way = np.hypot(*(np.array([telling.x("Ego"), telling.y("Ego")]) - before))
    assert way == pytest.approx(0.2, rel=5e-3)


def test_at_the_end_of_the_road_an_actor_stays() -> None:
    ends = by_entity("Ego", '<EndOfRoadCondition duration="1"/>', edge="rising")
    back = event("back", teleport(link("left", 10)), ends)
    telling = Telling(story({"Ego": teleport(link("left", 990)) + speed(10)}, group("Ego", back)))
    telling.run(1.9)
    assert telling.x("Ego") == 1000.0
    telling.run(0.4)
    assert telling.x("Ego") == pytest.approx(11.0, abs=1.5)


# Conditions


def first_frame(condition: str, init: dict[str, str], *, most: float = 4.0) -> float:
    """The time of the frame in which an event with this condition begins [s]."""
    telling = Telling(story(init, group("Ego", event("probe", speed(10), condition))))
    for frame in range(round(most * 50)):
        if telling.began("Event", "probe"):
            return frame * 0.02
        telling.run(0.02)
    return math.inf


def gap(value: float, more: str) -> str:
    return f'<RelativeDistanceCondition entityRef="Car" value="{value}" rule="lessThan" {more}/>'


def to_collision(value: float, more: str) -> str:
    target = '<TimeToCollisionConditionTarget><EntityRef entityRef="Car"/></TimeToCollisionConditionTarget>'
    condition = "TimeToCollisionCondition"
    return f'<{condition} value="{value}" rule="lessThan" {more}>{target}</{condition}>'


ALONG = 'relativeDistanceType="longitudinal"'

# The ego is 20 m behind, and 5 m/s faster; cars are 5 m long.
MOMENTS = [
    (gap(10, f'freespace="false" {ALONG}'), 2.0),
    (gap(10, f'freespace="true" coordinateSystem="road" {ALONG}'), 1.0),
    ('<TimeHeadwayCondition entityRef="Car" value="1.5" rule="lessThan" freespace="false" alongRoute="true"/>', 1.0),
    (to_collision(2, 'freespace="false" alongRoute="true"'), 2.0),
    (to_collision(2, f'freespace="true" {ALONG}'), 1.0),
    ('<TraveledDistanceCondition value="15"/>', 1.5),
    (
        f'<DistanceCondition value="30" rule="lessOrEqual" freespace="false">{link("middle", 80)}</DistanceCondition>',
        3.0,
    ),
    (f'<ReachPositionCondition tolerance="2">{link("middle", 40)}</ReachPositionCondition>', 1.8),
    ('<RelativeSpeedCondition entityRef="Car" value="5" rule="equalTo"/>', 0.0),
    ('<SpeedCondition value="9.9" rule="greaterThan"/>', 0.0),
    ('<SpeedCondition value="10" rule="lessThan"/>', math.inf),
    ('<CollisionCondition><EntityRef entityRef="Car"/></CollisionCondition>', 3.0),
]


@pytest.mark.parametrize(("condition", "expected"), MOMENTS)
def test_a_condition_of_an_entity_holds_from_its_moment(condition: str, expected: float) -> None:
    init = with_car(40.0, 5.0)
    assert first_frame(by_entity("Ego", condition), init) == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("ahead", [1.5, 4.5, 7.5, 10.5, 13.5])
def test_a_contact_of_one_frame_between_two_steps_counts(ahead: float) -> None:
    # A walker runs through a car of 2 m, 3 m a frame: a box of 0.5 m meets it in one frame.
    init = {"Car": teleport(at(100.0, 20.0, math.pi / 2)), "walker": teleport(at(100.0 - ahead, 21.0)) + speed(150)}
    hit = '<CollisionCondition><EntityRef entityRef="walker"/></CollisionCondition>'
    telling, met = Telling(story({**EGO, **init}, group("Ego", event("hit", speed(1), by_entity("Car", hit))))), 0
    for _ in range(10):
        telling.run(0.02)
        met += len(telling.world.contacts)
    assert met == 1
    assert telling.began("Event", "hit")


@pytest.mark.parametrize("hit", ['<EntityRef entityRef="walker2"/>', '<ByType type="pedestrian"/>'])
def test_pedestrians_who_meet_have_a_collision(hit: str) -> None:
    # 1.5 m apart, boxes of 0.5 m, 1 m/s: they meet after 1 s.
    init = {"walker1": teleport(at(100.0, 20.0)) + speed(1), "walker2": teleport(at(101.5, 20.0)) + speed(0)}
    condition = by_entity("walker1", f"<CollisionCondition>{hit}</CollisionCondition>")
    assert first_frame(condition, {**EGO, **init}) == pytest.approx(1.0, abs=0.05)


def test_what_is_behind_has_no_headway_and_no_time_to_collision() -> None:
    condition = (
        '<TimeHeadwayCondition entityRef="Car" value="0" rule="greaterThan" freespace="false" alongRoute="true"/>'
    )
    assert first_frame(by_entity("Ego", condition), with_car(5.0, 5.0), most=1.0) == math.inf


def test_all_triggering_entities_must_fulfil_a_condition_of_all() -> None:
    still = '<StandStillCondition duration="1"/>'
    init = {**EGO, "Car": teleport(link("left", 60)) + speed(0)}
    assert first_frame(by_entity("Ego Car", still), init) == pytest.approx(1.0, abs=0.03)
    assert first_frame(by_entity("Ego Car", still, rule="all"), init, most=2.0) == math.inf


def test_variables_are_set_and_compared() -> None:
    more = (
        '<VariableDeclarations><VariableDeclaration name="n" variableType="double" value="1"/></VariableDeclarations>'
    )
    rule = '<ModifyAction><Rule><AddValue value="2"/></Rule></ModifyAction>'
    add = f'<GlobalAction><VariableAction variableRef="n">{rule}</VariableAction></GlobalAction>'
    three = by_value('<VariableCondition variableRef="n" value="3" rule="equalTo"/>')
    events = event("add", add, after(1)), event("go", speed(3), three)
    telling = Telling(story(with_car(), group("Car", *events), more=more))
    telling.run(1.2)
    assert telling.running.state.values["n"] == "3.0"
    assert telling.speed("Car") == 3.0


def test_an_unknown_variable_is_refused() -> None:
    probe = event("go", speed(3), by_value('<VariableCondition variableRef="m" value="3" rule="equalTo"/>'))
    with pytest.raises(DocumentError, match=r"VariableCondition\.variableRef: there is no 'm'"):
        scenario_of(story(EGO, group("Ego", probe)))


def test_lenient_leaves_no_condition_on_a_variable_that_is_not_there() -> None:
    unknown = by_value('<VariableCondition variableRef="m" value="1" rule="equalTo"/>')
    with pytest.raises(DocumentError, match=r"VariableCondition\.variableRef: there is no 'm'"):
        scenario_of(story(EGO, group("Ego", event("go", speed(1), unknown))), is_lenient=True)


def test_events_follow_each_other_by_their_states() -> None:
    events = (
        event("first", speed(20, "linear", "time", 2), after(1)),
        event("second", speed(5), state_of("event", "first", "endTransition", delay=0.5, edge="rising")),
    )
    telling = Telling(story(with_car(), group("Car", *events)))
    telling.run(3.4)
    assert telling.speed("Car") == 20.0
    telling.run(0.3)
    assert telling.speed("Car") == 5.0


def test_the_stop_trigger_ends_the_story_and_its_actions() -> None:
    goal = event("go", speed(30, "linear", "time", 10), after(0))
    stop = trigger(after(2), tag="x").removeprefix("<x>").removesuffix("</x>")
    telling = Telling(story(with_car(), group("Car", goal), stop=stop))
    telling.run(2.1)
    assert telling.running.state.board.is_over
    now = telling.speed("Car")
    telling.run(1.0)
    assert telling.speed("Car") == now


def test_an_evaluation_gives_a_verdict() -> None:
    far = by_entity("Ego", '<TraveledDistanceCondition value="10"/>')
    success, failure = trigger(far, tag="x")[3:-4], trigger(after(2), tag="x")[3:-4]
    success, failure = (
        each.replace("ConditionGroup", f"{name}ConditionGroup")
        for each, name in ((success, "Success"), (failure, "Failure"))
    )
    telling = Telling(story(EGO, end=f"<Evaluation>{success}<FailureConditionGroup/>{failure}</Evaluation>"))
    board = telling.running.board
    telling.run(0.9)
    assert board.verdict() == StoryVerdict("undecided")
    telling.run(0.2)
    verdict = board.verdict()
    telling.run(1.5)
    assert board.verdict() == verdict  # although the group of failure holds now
    assert (verdict.result, verdict.group) == ("success", "SuccessConditionGroup 1")
    assert verdict.time == pytest.approx(1.0, abs=0.03)
    assert re.fullmatch(r"story.xosc: line \d+: TraveledDistanceCondition 'c' \(10\)", verdict.reason)


def test_of_two_verdicts_in_one_frame_failure_counts() -> None:
    both = "".join(f"<{kind}ConditionGroup>{after(1)}</{kind}ConditionGroup>" for kind in ("Success", "Failure"))
    telling = Telling(story(EGO, end=f"<Evaluation>{both}</Evaluation>"))
    telling.run(1.2)
    assert telling.running.board.verdict().result == "failure"


def test_a_story_without_an_evaluation_has_no_verdict() -> None:
    telling = Telling(story(EGO))
    telling.run(0.2)
    assert telling.running.board.verdict() == StoryVerdict()


def walker(**distances: object) -> str:
    properties = "".join(f'<Property name="{name}" value="{value}"/>' for name, value in distances.items())
    body = WALKER.replace("</BoundingBox>", f"</BoundingBox><Properties>{properties}</Properties>")
    return f'<ScenarioObject name="who">{body}</ScenarioObject>'


WALKS = f'<Private entityRef="who">{teleport(at(60, -6, 1.5708))}{speed(1.5)}</Private>'


def test_a_pedestrian_with_an_active_distance_waits_for_the_ego_and_ends_behind_its_way() -> None:
    text = story(EGO, entities=walker(activeDistance=25, moveDistance=4)).replace("</Actions>", f"{WALKS}</Actions>")
    telling = Telling(text)  # the ego begins at x = 20 with 10 m/s
    telling.run(1.4)
    assert (telling.y("who"), telling.speed("who")) == (-6.0, 0.0)
    telling.run(0.6)
    assert telling.speed("who") == 1.5
    telling.run(4.0)
    assert telling.y("who") == pytest.approx(-2.0, abs=1e-3)
    assert telling.speed("who") == pytest.approx(0.0, abs=1e-6)


def test_a_distance_of_a_pedestrian_that_is_none_is_told_with_its_line() -> None:
    with pytest.raises(DocumentError, match=r"line \d+: moveDistance: expected a distance \[m\], got 'far'"):
        scenario_of(story(EGO, entities=walker(moveDistance="far")))


def test_lenient_starts_no_event_whose_trigger_is_refused_and_gives_no_verdict_for_it() -> None:
    refused = by_value('<TimeOfDayCondition rule="greaterThan" dateTime="2026-01-01T00:00:00"/>')
    text = story(
        EGO,
        group("Ego", event("go", speed(30), refused), event("both", speed(30), refused + after(0))),
        end=f"<Evaluation><SuccessConditionGroup>{after(0)}{refused}</SuccessConditionGroup></Evaluation>",
    )
    telling = Telling(text, is_lenient=True)
    telling.run(0.2)
    assert telling.speed("Ego") == 10.0
    assert telling.running.board.verdict() == StoryVerdict()
