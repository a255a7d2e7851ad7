"""Boxes of a picture: which entities are seen, where, and which share of each is hidden; pictures made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, boxes_in_view
from rosbridge_sim.scenery.mesh import Label
from rosbridge_sim.scenery.pictures import Picture
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.simulator.sensor_data.visible_boxes import find_visible_boxes
from rosbridge_sim.world.state.world import Body, Kind, World

CAMERA = CameraModel(200, 100, 90.0)
POSE = Pose(0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def test_box_has_the_share_of_its_entity_that_nothing_nearer_hides() -> None:
    world = World()
    world.spawn(Kind.OBSTACLE, Body.box(2.0, 4.0, 2.0), name="box", x=11.0, y=0.0, yaw=np.pi)
    hidden = world.spawn(Kind.OBSTACLE, Body.box(2.0, 1.0, 2.0), name="box", x=20.0, y=9.0)
    frame = take_frame(world)
    bounds = boxes_in_view(frame, CAMERA, POSE, without=-1, max_range=200.0).bounds[0]
    left, top, right, bottom = (round(float(bound)) for bound in bounds)
    assert (left, right) == (80, 120)  # 4 m wide at 10 m: 40 pixels of a focal length of 100
    instance, depth = np.zeros((100, 200), dtype=np.int32), np.full((100, 200), 50.0, dtype=np.float32)
    label = np.zeros((100, 200), dtype=np.uint8)
    own = slice(top, bottom), slice(left, 100)
    instance[own], depth[own], label[own] = frame.ids[0] + 1, 10.0, Label.OBSTACLE
    label[top, left:100] = Label.POLE  # fewer pixels
    depth[top:bottom, 100:110] = 5.0  # hidden by something nearer; behind the rest there is the ground
    (found,) = find_visible_boxes(frame, CAMERA, POSE, Picture(None, depth, label, instance), carrier=-1)
    assert (found.uid, found.label) == (frame.ids[0], Label.OBSTACLE)
    assert found.visibility == pytest.approx(2 / 3)
    assert found.bounds == pytest.approx(bounds.tolist())
    assert found.centre == pytest.approx([11.0, 0.0, 0.0], abs=1e-6)
    assert found.size == [2.0, 4.0, 2.0]
    assert np.array(found.axes) == pytest.approx(np.array([(-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)]), abs=1e-6)
    assert hidden != found.uid
    alone = find_visible_boxes(frame, CAMERA, POSE, Picture(None, depth, label, instance), carrier=int(frame.ids[0]))
    assert alone == []
