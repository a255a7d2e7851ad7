"""Georeference of maps: plane coordinates <-> latitude and longitude, by the map's own projection.

pyproj does the projection. It is imported when the first position is needed, because that takes a tenth of a second,
and it is set up for each map. After that a position takes a microsecond.
"""

from __future__ import annotations

import logging
import math
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from rosbridge_sim.maps.road_map import Projection, RoadMap

if TYPE_CHECKING:
    from pyproj import Transformer

GEOGRAPHIC: Final = "+proj=longlat +datum=WGS84 +no_defs"
"""Coordinate system of satellite positions: WGS 84, whatever ellipsoid the map is drawn on."""

_log = logging.getLogger("rosbridge_sim.morai")


class Georeference:
    """Converter of positions, for the map of its last call."""

    def __init__(self) -> None:
        self._map: RoadMap | None = None
        self._transformer: Transformer | None = None
        self._has_warned = False

    def locate(self, road_map: RoadMap, x: float, y: float) -> tuple[float, float] | None:
        """Return the latitude and longitude of a place.

        Args:
            x: east of the map's origin [m].
            y: north of the map's origin [m].

        Returns:
            Both [deg]. None if the map has no projection, or if it does not cover the place; or if pyproj cannot use
            the projection, which is logged once for a map; or if pyproj cannot be read from the disk now, for example
            because the process has no file descriptors left. Then the next call tries again.
        """
        transformer = self._transformer_of(road_map)
        if transformer is None:
            return None
        east, north, _ = road_map.origin
        longitude, latitude = transformer.transform(east + x, north + y)
        return (latitude, longitude) if math.isfinite(latitude) and math.isfinite(longitude) else None

    def find_place(self, road_map: RoadMap, latitude: float, longitude: float) -> tuple[float, float] | None:
        """Return x and y of a place in the map frame [m], by its latitude and longitude [deg]; None as for `locate`."""
        transformer = self._transformer_of(road_map)
        if transformer is None:
            return None
        east, north, _ = road_map.origin
        x, y = transformer.transform(longitude, latitude, direction="INVERSE")
        return (x - east, y - north) if math.isfinite(x) and math.isfinite(y) else None

    def _transformer_of(self, road_map: RoadMap) -> Transformer | None:
        if road_map is not self._map:
            try:
                self._map, self._transformer = road_map, _find_transformer(road_map)
            except (OSError, ImportError) as error:
                # A library that was readable at the start may not be readable later.
                if not self._has_warned:
                    self._has_warned = True
                    _log.warning("no GPS fix for now, because pyproj cannot be read: %s", error)
                return None
        return self._transformer


def import_projection() -> None:
    """Import pyproj; this may be called in any thread. If that fails, each position that is needed tries it again."""
    with suppress(OSError, ImportError):
        import pyproj  # noqa: F401, PLC0415 - a tenth of a second


def proj_text(projection: Projection) -> str:
    """Return a projection in PROJ's notation.

    Args:
        projection: of a map. Its own PROJ text is used if it has one, because that may hold terms that we do not read.
    """
    if "+proj=" in projection.text:
        return projection.text
    if projection.is_tm:
        return (
            f"+proj=tmerc +lat_0={projection.central_latitude!r} +lon_0={projection.central_meridian!r}"
            f" +k={projection.scale_factor!r} +x_0={projection.false_easting!r} +y_0={projection.false_northing!r}"
            f" +ellps={projection.ellipse} +units=m +no_defs"
        )
    half = " +south" if projection.is_south else ""
    return f"+proj=utm +zone={projection.zone}{half} +ellps={projection.ellipse} +units=m +no_defs"


def _find_transformer(road_map: RoadMap) -> Transformer | None:
    if not road_map.projection.is_known:
        return None  # the map's notes tell it
    from pyproj.exceptions import ProjError  # noqa: PLC0415 - a tenth of a second

    try:
        return _make_transformer(proj_text(road_map.projection))
    except ProjError as error:
        _log.warning("map %s: no GPS fix, because its projection cannot be used: %s", road_map.name, error)
        return None


@lru_cache(maxsize=16)
def _make_transformer(text: str) -> Transformer:
    """Return a transformer from a projection to WGS 84; cached, because scenarios may alternate between maps.

    Raises:
        ProjError: the text is not a projection.
    """
    from pyproj import CRS, Transformer  # noqa: PLC0415 - a tenth of a second

    return Transformer.from_crs(CRS(text), CRS(GEOGRAPHIC), always_xy=True)
