"""Scenarios and recordings that are filmed without a server."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbridge_sim.client import Client
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.scene_film import FilmCamera, SceneFilm
from tests.shell.rendering.graphics import open_renderer

SIZE = (160, 90)
DEMO = Settings(scenario="demo", sensors="all")


@pytest.fixture(autouse=True)
def _graphics() -> None:
    open_renderer()


def pixels(film: SceneFilm) -> np.ndarray:
    return np.frombuffer(film.shoot(), np.uint8).reshape(*SIZE[::-1], 3).astype(int)


@pytest.mark.slow
def test_camera_behind_sees_the_ego_and_follows_it() -> None:
    film = SceneFilm(DEMO, FilmCamera("chase", "all", SIZE))
    start = film.pose
    seen = []
    for frame in (0, 150):
        assert film.advance(frame)
        red, _, blue = np.moveaxis(pixels(film)[46:64, 71:89], -1, 0)
        seen.append(np.mean(blue > red + 40))
    film.close()
    assert film.frame == 150
    assert np.hypot(film.pose.x - start.x, film.pose.y - start.y) > 5.0  # it drives itself
    assert min(seen) > 0.3  # the ego is blue


@pytest.mark.slow
def test_camera_of_the_ego_does_not_see_it_and_has_its_own_size_and_picture() -> None:
    camera = FilmCamera("Camera-depth", "all", None)
    assert (camera.size, camera.is_chase) == ((640, 480), False)
    film = SceneFilm(DEMO, FilmCamera("1", "all", SIZE), is_driving=False)
    depth = np.frombuffer(film.shoot(), "<f4").reshape(SIZE[::-1])
    film.close()
    assert depth[-1].min() > 1.0  # the road, not the bonnet


@pytest.mark.slow
def test_recording_moves_the_ego_until_its_end(tmp_path: Path) -> None:
    path = tmp_path / "drive.bag"
    with Simulator(port=0, start="sync", scenario="demo", record=path) as sim, Client(sim.url) as client:
        client.start_sync()
        client.set_object(0, speed=10.0)
        states = client.subscribe("/Ego_topic")
        for _ in range(20):
            client.tick()
            last = states.next()["position"]
    film = SceneFilm(DEMO, FilmCamera("chase", "none", SIZE), recording=path)
    start = film.pose
    assert film.advance(10)
    assert film.pose.x != start.x or film.pose.y != start.y
    assert not film.advance(1_000)
    assert (film.pose.x, film.pose.y) == pytest.approx((last["x"], last["y"]), abs=0.05)


def test_camera_that_is_not_there_is_refused_with_the_names() -> None:
    with pytest.raises(DocumentError, match=r"--camera: expected chase, Camera, got 'Camra' \(did you mean Camera\?\)"):
        FilmCamera("Camra", "camera", None)
    with pytest.raises(DocumentError, match=r"got '0'.*--sensors camera brings one"):
        FilmCamera("0", "none", None)


def test_ego_that_is_not_there_is_refused() -> None:
    with pytest.raises(DocumentError, match="--ego: expected the number of an ego of the scenario, got 3"):
        SceneFilm(DEMO, FilmCamera("chase", "none", SIZE), ego=3)
