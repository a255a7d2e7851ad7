"""`watch` reads messages of any server, and draws them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.cli.watch.picture import MAX_SCALE, MIN_SCALE, View, draw, pan, show_whole_map, zoom
from rosbridge_sim.cli.watch.watched_scene import MapLines, TimeMeter, WatchedScene, lamp_word, number_of

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["x", "y", "", "secs"]), inner, max_size=3)
    ),
    max_leaves=6,
)


def ego_at(x: float, y: float, *, heading: float = 0.0, secs: float = 1.0, **fields: object) -> dict[str, Any]:
    stamp = {"secs": int(secs), "nsecs": int(1e9 * (secs % 1))}
    position = {"x": x, "y": y, "z": 0.0}
    return {"header": {"stamp": stamp}, "unique_id": 0, "position": position, "heading": heading, **fields}


def picture(scene: WatchedScene, view: View | None = None, size: tuple[int, int] = (80, 24)) -> str:
    return "\n".join(draw(scene, view or View(), size, now=0.0, title="ws://here"))


@given(
    ego=st.dictionaries(st.sampled_from(["position", "heading", "velocity", "unique_id", "header"]), JSON), other=JSON
)
def test_any_message_gives_a_picture(ego: dict[str, Any], other: Any) -> None:  # noqa: ANN401 - any JSON
    scene = WatchedScene()
    scene.take_ego(ego, 0.0)
    scene.take_objects(
        {"npc_list": [other, {"position": other, "size": other, "heading": other}], "obstacle_list": other}
    )
    scene.take_light({"trafficLightStatus": other}, 0.0)
    scene.take_markers({"markers": [other, {"ns": "lights", "points": [other], "colors": [other]}]})
    scene.sync = {"frame": other, "status": True, "master_id": other}
    scene.event = {"gear": other, "ctrl_mode": other}
    scene.map = MapLines.read([{"lanes": [{"x": other, "y": [1.0], "left": other}], "west": other, "name": other}])
    for size in ((80, 24), (20, 8), (1, 1)):
        view = View()
        rows = draw(scene, view, size, now=0.0, title="ws://here")
        assert len(rows) == size[1]
        assert all(len(row) <= size[0] for row in rows)
        show_whole_map(view, scene, *size)
        assert MIN_SCALE <= view.scale <= MAX_SCALE


def test_steering_gear_and_mode_stand_in_the_ego_line() -> None:
    scene = WatchedScene()
    scene.take_ego(ego_at(0, 0, velocity={"x": 10.0}, wheel_angle=math.radians(-3.25), accel=0.5), 0.0)
    scene.event = {"gear": 4, "ctrl_mode": 3}
    text = picture(scene)
    assert "ego 0    36.0 km/h  steer  3.2° right  gear D  external control" in text
    assert "throttle  50 %" in text
    scene.ego = ego_at(0, 0, front_steer_angle=2.0)
    assert "steer  2.0° left" in picture(scene)


def test_master_and_light_ahead_stand_in_the_time_line() -> None:
    scene = WatchedScene()
    scene.take_ego(ego_at(0, 0), 0.0)
    scene.sync = {"frame": 1234, "status": True, "master_id": "me\x1b[2J"}
    scene.take_light({"trafficLightStatus": 33}, 0.0)
    text = picture(scene)
    assert "frame 1,234" in text
    assert "light ahead: red and arrow" in text
    assert "\x1b" not in text, "a name cannot command the terminal"
    assert "synchronous, master" in text
    late = "\n".join(draw(scene, View(), (80, 24), now=9.0, title=""))
    assert "light ahead" not in late


def test_without_a_map_a_grid_and_a_trail_show_motion() -> None:
    scene = WatchedScene()
    scene.take_ego(ego_at(0, 0), 0.0)
    still = picture(scene)
    assert any(char in still for char in "⠁⠂⠄⡀⠈⠐⠠⢀")
    for x in range(1, 31):
        scene.take_ego(ego_at(x, 0, secs=1 + x / 10), 0.1 * x)
    assert len(scene.trail) == 31
    moved = picture(scene)
    middle = moved.splitlines()[10]
    assert middle.strip("⠀ ") != still.splitlines()[10].strip("⠀ ")


def test_jump_of_the_ego_ends_the_trail_and_asks_for_the_map() -> None:
    scene = WatchedScene()
    scene.take_ego(ego_at(0, 0), 0.0)
    assert not scene.has_jumped
    scene.take_ego(ego_at(100, 0), 0.1)
    assert scene.has_jumped
    assert list(scene.trail) == [(100.0, 0.0)]
    scene.has_jumped = False
    scene.take_ego(ego_at(100, 0, secs=0.5), 0.2)
    assert scene.has_jumped, "time began anew"


@pytest.mark.parametrize(("heading", "arrow"), [(0, "→"), (90, "↑"), (180, "←"), (-45, "↘")])
def test_ego_from_far_is_an_arrow_along_its_heading(heading: float, arrow: str) -> None:
    scene = WatchedScene()
    scene.take_ego(ego_at(5, 5, heading=heading), 0.0)
    view = View(scale=10.0)
    assert arrow in picture(scene, view)
    view.is_heading_up = True
    assert "↑" in picture(scene, view)
    plain = picture(scene, View(scale=10.0, has_unicode=False))
    assert plain.isascii()
    assert {"→": ">", "↑": "^", "←": "<", "↘": "\\"}[arrow] in plain


def test_panned_view_stays_and_follows_again() -> None:
    scene, view = WatchedScene(), View(scale=1.0)
    scene.take_ego(ego_at(5, 5, heading=180.0), 0.0)
    picture(scene, view)
    pan(view, scene, 10.0, -4.0)
    assert (view.x, view.y) == (15.0, 1.0)
    picture(scene, view)
    assert (view.x, view.y, view.is_following) == (15.0, 1.0, False)
    view.is_following = view.is_heading_up = True
    picture(scene, view)
    pan(view, scene, 0.0, 10.0)
    assert view.x == pytest.approx(-5.0), "up is ahead of the ego"
    assert view.y == pytest.approx(5.0)


def test_zoom_stays_within_its_limits() -> None:
    view = View()
    zoom(view, 100)
    assert view.scale == MIN_SCALE
    zoom(view, -1000)
    assert view.scale == MAX_SCALE


def test_map_has_edges_outside_of_intersections_alone() -> None:
    lane: dict[str, Any] = {"x": [0.0, 10.0], "y": [0.0, 0.0], "left": [2.0, 2.0], "right": [1.0, 1.0]}
    page = {
        "name": "made",
        "lanes": [{"link": "a", "successors": ["b"], **lane}, {"link": "b", "successors": [], **lane}],
        "stop_lines": [{"link": "a", "x": [10.0, 10.0], "y": [2.0, -1.0]}],
        "crosswalks": [{"parts": [{"x": [0, 1, 1], "y": [0, 0, 1]}]}],
        "east": 10.0,
    }
    lines = MapLines.read([page])
    assert len(lines.lanes) == 2
    assert lines.edges.tolist() == [[0.0, 2.0, 10.0, 2.0], [0.0, -1.0, 10.0, -1.0]]
    assert lines.stop_lines.tolist() == [[10.0, 2.0, 10.0, -1.0]]
    assert len(lines.crosswalks) == 3, "the area is closed"
    assert lines.extent == (0.0, 0.0, 10.0, 0.0)


def test_meter_measures_simulated_seconds_in_a_second() -> None:
    meter = TimeMeter()
    assert meter.factor(0.0) is None
    for i in range(40):
        meter.add(0.1 * i, 5.0 + 0.2 * i)
    assert meter.factor(3.95) == pytest.approx(2.0)
    assert meter.factor(100.0) == pytest.approx(0.0, abs=0.1), "no message comes: the world stands"
    meter.add(101.0, 0.0)
    assert meter.factor(101.5) is None, "time began anew"


def test_lamps_have_words() -> None:
    assert [lamp_word(status) for status in (-1, 0, 1, 4, 16, 33, 48)] == [
        *("", "", "red", "yellow", "green", "red and arrow", "green and arrow")
    ]


def test_number_of_anything_else_is_0() -> None:
    values = [{}, {"x": None}, {"x": "1"}, {"x": True}, {"x": math.nan}, {"x": math.inf}, {"x": 10**400}, [], None]
    assert [number_of(value, "x") for value in values] == [0.0] * len(values)
    assert number_of({"x": 2}, "x") == 2.0


def test_labels_come_near_and_boxes_have_the_size_of_objects() -> None:
    scene = WatchedScene()
    scene.take_ego(ego_at(0, 0), 0.0)
    thing = {"unique_id": 7, "position": {"x": 0, "y": 8}, "size": {"x": 1.8, "y": 4.5}, "velocity": {"x": 36.0}}
    scene.take_objects({"npc_list": [thing]})
    assert (scene.things[0].length, scene.things[0].width) == (4.5, 1.8)
    assert "7 36 km/h" in picture(scene, View(scale=0.5))
    assert "7 36 km/h" not in picture(scene, View(scale=1.0))
    assert np.isfinite(scene.things[0].speed)
