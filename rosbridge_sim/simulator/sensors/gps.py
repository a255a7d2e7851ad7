"""GPS: the position of an antenna as WGS 84 angles.

In the map's projection (mostly UTM), minus `eastOffset` and `northOffset`, `latitude` and `longitude` give the map's x
and y. `altitude` has the same zero as the map's heights. `status` is 1 with a fix. It is 0, and both angles are 0, at a
place that the map's projection does not cover.
"""

from __future__ import annotations

from typing import ClassVar

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.georeference import Georeference, import_projection
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.simulator.bus.network_settings import USUAL_RATE
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.ego import Ego
from rosbridge_sim.simulator.sensors.sensor import Sensor
from rosbridge_sim.simulator.sensors.sensor_files import gps_text
from rosbridge_sim.simulator.sensors.sensor_noise import SensorNoise
from rosbridge_sim.simulator.sensors.sensor_specs import GPS_FRAME, SensorSpec
from rosbridge_sim.world.vehicle.sensor_readings import locate

__all__ = ["Gps", "GpsSpec"]


class GpsSpec(SensorSpec, frozen=True, kw_only=True):
    """The GPS antenna; the settings of topics have its rate."""

    kind: ClassVar[str] = "gps"
    is_on_each_ego: ClassVar[bool] = True
    frame_id: ClassVar[str] = GPS_FRAME
    topic: ClassVar[str] = "/gps"
    rate: ClassVar[float] = USUAL_RATE

    @property
    def topics(self) -> list[tuple[str, str]]:
        """Its one topic."""
        return [(self.topic, Gps.type_name)]


class Gps(Sensor):
    """The GPS antenna.

    Attributes:
        prepare: imports what `read` needs, for `ProjectionImport`.
    """

    title: ClassVar[str] = "GPS"
    frame: ClassVar[str] = GPS_FRAME
    topic: ClassVar[str] = "gps"
    type_name: ClassVar[str] = "morai_msgs/GPSMessage"
    prepare = staticmethod(import_projection)

    def __init__(self, context: SimulatorContext, noise: SensorNoise | None) -> None:
        """Read nothing yet; see `Sensor`."""
        super().__init__(context, noise)
        self._globe = Georeference()
        self._make_gps = maker(
            context.bus.store,
            self.type_name,
            *("header", "latitude", "longitude", "altitude", "eastOffset", "northOffset", "status"),
        )

    def read(self, ego: Ego) -> Struct:
        """Return the position of the antenna, as latitude and longitude."""
        road_map = self._context.scene.road_map
        x, y, z = locate(self._context.world, ego.row, ego.mountings[self.frame])
        has_fix = True
        if self._noise is not None:
            read = self._source(self._noise, ego).locate((x, y, z))
            has_fix, (x, y, z) = read is not None, read or (x, y, z)
        east, north, up = road_map.origin
        place = self._globe.locate(road_map, x, y) if has_fix else None
        latitude, longitude = place or (0.0, 0.0)
        return self._make_gps(self._header(ego), latitude, longitude, z + up, east, north, 0 if place is None else 1)

    def read_unless_lost(self, ego: Ego) -> Struct | None:
        """Return the message of the present frame; None in real time while `ProjectionImport` is running."""
        context = self._context
        return None if context.projection_import.is_running and context.sync.is_free else self.read(ego)

    def file(self, frame: int, message: Struct) -> bytes:
        """Return GPS_*.csv."""
        return gps_text(frame, message)
