"""Boxes of the entities that a picture shows."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.records import Record
from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, boxes_in_view
from rosbridge_sim.scenery.pictures import Picture
from rosbridge_sim.scenery.scene_frame import SceneFrame

BOX_RANGE: Final = 150.0
"""Farthest boxes in a picture [m]: a car there is 4 pixels wide at 640 pixels and 90 deg."""


class VisibleBox(Record, eq=False):
    """Box of an entity of which a picture shows something.

    Attributes:
        uid: id of the entity on the wire.
        label: class of most of its own pixels.
        bounds: left, top, right, bottom of the projected box [pixels].
        visibility: own pixels, as a share of those and the pixels within the bounds that something nearer covers.
        centre: middle in the camera's axes, x forward, y left, z up [m].
        size: length, width and height [m].
        axes: directions of length and height in the camera's axes.
    """

    uid: int
    label: int
    bounds: list[float]
    visibility: float
    centre: list[float]
    size: list[float]
    axes: tuple[list[float], list[float]]


def find_visible_boxes(
    frame: SceneFrame, camera: CameraModel, pose: Pose, picture: Picture, carrier: int
) -> list[VisibleBox]:
    """Return the boxes of the entities that a picture shows.

    Args:
        picture: with instances, depths and labels.
        carrier: id of the entity that is left out.
    """
    instance, depth, label = picture.instance, picture.depth, picture.label
    assert instance is not None, "all three were asked for"
    assert depth is not None
    assert label is not None
    boxes = boxes_in_view(frame, camera, pose, without=carrier, max_range=BOX_RANGE)
    nearest = camera.depths(boxes.corners).min(axis=1)
    found = []
    for i, row in enumerate(boxes.rows.tolist()):
        left, top, right, bottom = boxes.bounds[i].tolist()
        window = (slice(int(top), int(np.ceil(bottom))), slice(int(left), int(np.ceil(right))))
        is_own = instance[window] == frame.ids.item(row) + 1
        num_own = int(np.count_nonzero(is_own))
        if not num_own:
            continue
        corners = boxes.corners[i]
        num_hidden = int(np.count_nonzero(~is_own & (depth[window] < nearest[i])))
        # Corners count z first, then y, then x: 0 is low right behind, 1 above it, 4 before it.
        length, height = corners[4] - corners[0], corners[1] - corners[0]
        box = VisibleBox(
            uid=frame.ids.item(row),
            label=int(np.bincount(label[window][is_own]).argmax()),
            bounds=[left, top, right, bottom],
            visibility=num_own / (num_own + num_hidden),
            centre=corners.mean(axis=0).tolist(),
            size=frame.sizes[row].tolist(),
            axes=(_unit(length), _unit(height)),
        )
        found.append(box)
    return found


def _unit(vector: NDArray[np.float64]) -> list[float]:
    return list((vector / max(float(np.sqrt(np.square(vector).sum())), 1e-9)).tolist())
