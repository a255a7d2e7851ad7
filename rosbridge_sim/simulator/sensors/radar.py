"""Radars."""

from __future__ import annotations

from typing import ClassVar

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.sensors.drawn_errors import disturb_radar
from rosbridge_sim.simulator.sensors.radar_echoes import RadarBeams, RadarEchoes, find_echoes
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_specs import FrameId, Rate, TopicName


class _Maker:
    """Maker of the messages of all radars of a simulator."""

    def __init__(self, store: Store) -> None:
        self._detections = maker(store, RadarSpec.type_name, "header detections")
        self._detection = maker(store, "morai_msgs/RadarDetection", "detection_id position azimuth rangerate amplitude")
        self._point = maker(store, "geometry_msgs/Point", "x y z")

    def make(self, header: Struct, echoes: RadarEchoes) -> Struct:
        """Return the RadarDetections of a scan."""
        columns = (echoes.azimuth, echoes.range_rate, echoes.amplitude)
        rows = zip(echoes.position.tolist(), *(column.tolist() for column in columns), strict=True)
        return self._detections(
            header, [self._detection(i, self._point(*place), *figures) for i, (place, *figures) in enumerate(rows)]
        )


class RadarSpec(RadarBeams, frozen=True, kw_only=True):
    """A radar with a wide beam for what is near and a narrow beam for what is far.

    The defaults are our choice, of the class of a car's 77 GHz radar with two beams.

    Attributes:
        near_range, far_range: of the two beams [m].
        near_fov, far_fov: horizontal angles of the beams, left and right together [deg].
        vertical_fov: vertical angle of both [deg].
        max_echoes: largest number of echoes in a message; the nearest are kept.
    """

    kind: ClassVar[str] = "radar"
    noise_key: ClassVar[str] = "radar"
    morai_noun: ClassVar[str] = "radar"
    morai_lists: ClassVar[tuple[str, ...]] = ("RadarList", "DelphiRadarList")
    type_name: ClassVar[str] = "morai_msgs/RadarDetections"
    has_turns: ClassVar[bool] = True
    frame_id: FrameId = "radar"
    topic: TopicName = "/radar"
    rate: Rate = 20.0

    def read(self, shared: SensorContext, ego: Ego, number: int) -> Struct | None:  # noqa: ARG002 - it has one topic
        """Return the echoes of this frame."""
        carrier = shared.simulator.world, ego.row, ego.mountings[self.frame_id]
        echoes, errors = find_echoes(*carrier, self), shared.errors(ego)
        if errors is not None:
            echoes = disturb_radar(echoes, carrier, self, errors.noise.radar, errors.generator(self.frame_id))
        return shared.once(_Maker).make(shared.header(ego, self.frame_id), echoes)
