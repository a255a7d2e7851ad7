"""GPS: the position of an antenna as WGS 84 angles.

In the map's projection (mostly UTM), minus `eastOffset` and `northOffset`, `latitude` and `longitude` give the map's x
and y. `altitude` has the same zero as the map's heights. `status` is 1 with a fix. It is 0, and both angles are 0, at a
place that the map's projection does not cover.
"""

from __future__ import annotations

from typing import Any, ClassVar

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.georeference import Georeference, import_projection
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.sensor_data.sensor_files import gps_text
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_specs import GPS_FRAME, EgoSensorSpec
from rosbridge_sim.world.vehicle.sensor_readings import locate


class _Maker:
    """Maker of the messages of all antennas of a simulator."""

    def __init__(self, store: Store) -> None:
        self.globe = Georeference()
        fields = "header latitude longitude altitude eastOffset northOffset status"
        self.make: Any = maker(store, GpsSpec.type_name, fields)


class GpsSpec(EgoSensorSpec, frozen=True, kw_only=True):
    """The GPS antenna; the settings of topics have its rate."""

    kind: ClassVar[str] = "gps"
    morai_noun: ClassVar[str] = "GPS"
    morai_lists: ClassVar[tuple[str, ...]] = ("GPSList",)
    frame_id: ClassVar[str] = GPS_FRAME
    topic: ClassVar[str] = "/gps"
    type_name: ClassVar[str] = "morai_msgs/GPSMessage"
    file_name: ClassVar[str] = "GPS_{}.csv"

    as_text = staticmethod(gps_text)
    load_library = staticmethod(import_projection)
    """Imports what `read` needs, for `ProjectionImport`."""

    def read(self, shared: SensorContext, ego: Ego, number: int = 0) -> Struct | None:  # noqa: ARG002 - it has one topic
        """Return the position of the antenna; None in real time while `ProjectionImport` is running."""
        simulator = shared.simulator
        is_early = simulator.projection_import.is_running and simulator.sync.is_free
        return None if is_early else self.measure(shared, ego)

    def measure(self, shared: SensorContext, ego: Ego) -> Struct:
        """Return the position of the antenna."""
        simulator, maker_ = shared.simulator, shared.once(_Maker)
        road_map = simulator.scene.road_map
        x, y, z = locate(simulator.world, ego.row, ego.mountings[self.frame_id])
        has_fix = True
        errors = shared.errors(ego)
        if errors is not None:
            read = errors.locate((x, y, z))
            has_fix, (x, y, z) = read is not None, read or (x, y, z)
        east, north, up = road_map.origin
        place = maker_.globe.locate(road_map, x, y) if has_fix else None
        latitude, longitude = place or (0.0, 0.0)
        header = shared.header(ego, self.frame_id)
        return maker_.make(header, latitude, longitude, z + up, east, north, 0 if place is None else 1)
