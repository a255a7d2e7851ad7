"""Pictures of the cameras of egos, by formulas in place of a graphics library."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

from rosbridge_sim import Worlds
from rosbridge_sim.environments import camera
from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.pictures import Channel, Picture, PictureChoices
from rosbridge_sim.world.state.world import Kind


class Renderer:
    """Paints each picture in the number of the ego, and keeps what it was asked for."""

    asked: list[tuple[CameraModel, Pose, PictureChoices]] = []  # noqa: RUF012 - emptied by each test

    def render(self, _mesh: Any, _frame: Any, model: CameraModel, pose: Pose, choices: PictureChoices) -> Picture:  # noqa: ANN401
        self.asked.append((model, pose, choices))
        rgb = np.full((model.height, model.width, 3), choices.without + 1, dtype=np.uint8)
        return Picture(rgb, None, None, None)


@pytest.fixture(autouse=True)
def renderer(monkeypatch: pytest.MonkeyPatch) -> type[Renderer]:
    monkeypatch.setattr(camera, "CameraRenderer", Renderer)
    monkeypatch.setattr(camera, "static_mesh", lambda *_: Mesh.empty())  # it takes seconds, and nobody looks at it
    Renderer.asked.clear()
    return Renderer


def test_camera_looks_down_by_seven_degrees_from_behind_the_windscreen(renderer: type[Renderer]) -> None:
    worlds = Worlds("loop", 2, seed=[0, 1])
    cameras = camera.EgoCameras(worlds, 8, 6)
    pictures = cameras.draw()
    assert pictures.shape == (2, 1, 6, 8, 3)
    assert pictures.dtype == np.uint8
    egos = worlds.egos()
    for i, (model, pose, choices) in enumerate(renderer.asked):
        uid = int(worlds.world(i).uid[worlds.world(i).rows(Kind.EGO)][0])
        assert np.unique(pictures[i]).tolist() == [uid + 1]
        assert (model.width, model.height, model.fov_deg) == (8, 6, 90.0)
        assert (choices.channels, choices.without) == (Channel.RGB, uid)
        x, y, z, yaw = (float(egos[name][i, 0]) for name in ("x", "y", "z", "yaw"))
        wanted = (x + 1.8 * math.cos(yaw), y + 1.8 * math.sin(yaw), z + 2.0, 0.0, math.radians(7.0), yaw)
        assert tuple(pose) == pytest.approx(wanted)
    assert len(renderer.asked) == 2
    second = copy.copy(cameras)
    assert second._renderer is not cameras._renderer
    assert second.draw().shape == pictures.shape
