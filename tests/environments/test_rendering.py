"""Pictures, films and the page of the environments."""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

from gymnasium.wrappers import FlattenObservation, RecordEpisodeStatistics, RecordVideo  # noqa: E402

from rosbridge_sim.client import Client  # noqa: E402
from rosbridge_sim.environments.registration import register_all  # noqa: E402

LANE = "rosbridge_sim/LaneKeeping-v1"


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    register_all()
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):  # no browser
        monkeypatch.delenv(name, raising=False)


@pytest.mark.slow
def test_page_shows_the_world_of_the_environment() -> None:
    one = gymnasium.make(LANE, render_mode="human", traffic=3).unwrapped
    one.reset(seed=2)
    assert one.page_url.startswith("http://127.0.0.1:")
    try:
        with Client(one.page_url.replace("http", "ws", 1)) as client, client.subscribe("/Ego_topic") as egos:
            client.confirm()
            before = one.worlds.egos()["x"][0, 0]
            for _ in range(3):
                one.step(np.array([0.1, 1.0]))
            x = one.worlds.egos()["x"][0, 0]
            assert x != before
            egos.wait_for(lambda ego: bool(ego["position"]["x"] == x))  # to the bit
        assert one.render() is None
    finally:
        one.close()
    assert not one.page_url


@pytest.mark.slow
def test_page_goes_on_after_a_reset() -> None:
    many = gymnasium.make_vec(
        "rosbridge_sim/Parking-v1", num_envs=2, vectorization_mode="vector_entry_point", render_mode="human"
    )
    many.reset(seed=0)
    try:
        many.step(np.zeros((2, 2)))
        many.reset(seed=1)
        many.step(np.zeros((2, 2)))
        assert many.unwrapped.page_url
    finally:
        many.close()


def test_unknown_render_mode_is_refused() -> None:
    many = {"num_envs": 1, "vectorization_mode": "vector_entry_point"}
    with pytest.raises(ValueError, match="render_mode: expected human, rgb_array or None, got 'ansi'"):
        gymnasium.make_vec(LANE, render_mode="ansi", **many)


class Clip:
    """Stands for the film library of Gymnasium, which is not installed here: keeps the pictures."""

    made: list[tuple[int, int]] = []  # noqa: RUF012

    def __init__(self, pictures: list[Any], fps: int) -> None:
        self.made.append((len(pictures), fps))

    def write_videofile(self, path: str, **_: object) -> None:
        Path(path).write_bytes(b"film")


def test_film_has_a_picture_of_each_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("moviepy.video.io.ImageSequenceClip")
    module.ImageSequenceClip = Clip  # type: ignore[attr-defined]
    for name in ("moviepy", "moviepy.video", "moviepy.video.io"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    shown = gymnasium.make(LANE, render_mode="rgb_array", max_episode_steps=5)
    one = RecordVideo(shown, str(tmp_path / "films"), disable_logger=True)
    one.reset(seed=0)
    for _ in range(5):
        one.step(np.zeros(2))
    one.close()
    assert Clip.made == [(6, 10)]
    assert [path.suffix for path in (tmp_path / "films").iterdir()] == [".mp4"]


def test_wrappers_of_gymnasium_work() -> None:
    parts = {"observation": "Dict", "parts": ("Lane", "Others")}
    one = RecordEpisodeStatistics(FlattenObservation(gymnasium.make(LANE, max_episode_steps=3, **parts)))
    assert one.reset(seed=0)[0].shape == (15 + 14 * 9,)
    info: dict[str, Any] = {}
    for _ in range(3):
        *_, info = one.step(np.zeros(2))
    assert info["episode"]["l"] == 3


def test_wrappers_of_many_environments_work() -> None:
    wrappers = gymnasium.wrappers.vector
    many = gymnasium.make_vec(LANE, num_envs=2, vectorization_mode="vector_entry_point", max_episode_steps=3)
    many = wrappers.RecordEpisodeStatistics(wrappers.NormalizeObservation(many))
    many.reset(seed=0)
    for _ in range(3):
        *_, infos = many.step(np.zeros((2, 2)))
    assert infos["episode"]["l"].tolist() == [3, 3]


def test_environments_are_as_env_runners_of_rllib_take_them() -> None:
    """RLlib 2.60 makes and wraps its environments so, in `SingleAgentEnvRunner.make_env`."""
    mode = gymnasium.VectorizeMode("vector_entry_point")
    many = gymnasium.wrappers.vector.DictInfoToList(
        gymnasium.make_vec(LANE, num_envs=2, vectorization_mode=mode, max_episode_steps=2)
    )
    _, infos = many.reset(seed=0)
    assert infos[1]["speed"] == 0.0
    assert infos[1]["score"]["num_collisions"] == 0.0
    for _ in range(2):
        _, _, _, truncated, infos = many.step(many.action_space.sample())
    assert truncated.all()
    assert len(infos) == many.num_envs == 2
