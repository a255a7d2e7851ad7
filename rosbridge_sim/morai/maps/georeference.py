"""Where the map's metres lie on the globe: plane coordinates -> latitude and longitude, by the map's own projection.

The projection is pyproj's business, which is imported and set up when the first position is asked for: that takes a
tenth of a second, which nobody pays who asks for none. A position is then a microsecond.
"""

from __future__ import annotations

import logging
import math
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from rosbridge_sim.morai.maps.mgeo import Projection, RoadMap

if TYPE_CHECKING:
    from pyproj import Transformer

__all__ = ["Georeference", "proj_text"]

GEOGRAPHIC: Final = "+proj=longlat +datum=WGS84 +no_defs"
"""What satellites tell: WGS 84, whatever ellipsoid the map is drawn on."""

_log = logging.getLogger("rosbridge_sim.morai")


class Georeference:
    """Finds positions on one map after another."""

    def __init__(self) -> None:
        """Nothing is set up before it is asked for."""
        self._map: RoadMap | None = None
        self._transformer: Transformer | None = None
        self._has_warned = False

    def locate(self, road_map: RoadMap, x: float, y: float) -> tuple[float, float] | None:
        """Latitude and longitude [deg] of a place.

        Args:
            road_map: whose metres these are.
            x: east of the map's origin [m].
            y: north of it [m].

        Returns:
            None where there are none: the place is beyond what the projection covers; or pyproj cannot use the
            projection, which the log is told of once for a map; or pyproj cannot be read from the disk now, as when
            the process has no file descriptors left: the next call tries again.
        """
        if road_map is not self._map:
            try:
                self._map, self._transformer = road_map, _find_transformer(road_map)
            except (OSError, ImportError) as error:  # a library that is there at the start may be out of reach later
                if not self._has_warned:
                    self._has_warned = True
                    _log.warning("no GPS for now, since pyproj cannot be read: %s", error)
                return None
        if self._transformer is None:
            return None
        east, north, _ = road_map.origin
        longitude, latitude = self._transformer.transform(east + x, north + y)
        return (latitude, longitude) if math.isfinite(latitude) and math.isfinite(longitude) else None


def proj_text(projection: Projection) -> str:
    """A projection in PROJ's words: the map's own where it has any, for there may be more in them than we read."""
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
    from pyproj.exceptions import ProjError  # noqa: PLC0415 - a tenth of a second

    try:
        return _make_transformer(proj_text(road_map.projection))
    except ProjError as error:
        _log.warning("map %s: no GPS, since its projection cannot be used: %s", road_map.name, error)
        return None


@lru_cache(maxsize=16)
def _make_transformer(text: str) -> Transformer:
    """From a projection to the globe; scenarios may go to and fro between maps.

    Raises:
        ProjError: it is no projection.
    """
    from pyproj import CRS, Transformer  # noqa: PLC0415 - a tenth of a second

    return Transformer.from_crs(CRS(text), CRS(GEOGRAPHIC), always_xy=True)
