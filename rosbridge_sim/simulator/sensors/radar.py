"""Radars."""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from rosbridge_sim.documents import number_spelling
from rosbridge_sim.simulator.sensors.sensor_specs import Fov, FrameId, MountedSpec, Range, Rate, TopicName

__all__ = ["RadarSpec"]

_Echoes = Annotated[int, number_spelling(1, 1000, "integer"), Meta(ge=1, le=1000)]


class RadarSpec(MountedSpec, frozen=True, kw_only=True):
    """A radar with a wide beam for what is near and a narrow beam for what is far.

    The defaults are our choice, of the class of a car's 77 GHz radar with two beams.

    Attributes:
        near_range, far_range: of the two beams [m].
        near_fov, far_fov: horizontal angles of the beams, left and right together [deg].
        vertical_fov: vertical angle of both [deg].
        max_echoes: largest number of echoes in a message; the nearest are kept.
    """

    kind: ClassVar[str] = "radar"
    frame_id: FrameId = "radar"
    topic: TopicName = "/radar"
    rate: Rate = 20.0
    near_range: Range = 60.0
    far_range: Range = 174.0
    near_fov: Fov = 90.0
    far_fov: Fov = 20.0
    vertical_fov: Fov = 10.0
    max_echoes: _Echoes = 64

    @property
    def topics(self) -> list[tuple[str, str]]:
        """Its one topic."""
        return [(self.topic, "morai_msgs/RadarDetections")]
