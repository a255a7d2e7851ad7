from __future__ import annotations

import logging

import pytest
from pyproj import Proj

from rosbridge_sim.maps.georeference import Georeference, proj_text
from rosbridge_sim.maps.mgeo import read_projection
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.world.roads.roads import Roads

K_CITY = (302_459.942, 4_122_635.537, 28.991)


def make_map(projection: Projection | str, origin: tuple[float, float, float] = K_CITY) -> RoadMap:
    if isinstance(projection, str):
        projection = read_projection(projection, "map")
    return RoadMap("tiny", projection, origin, Roads())


def there_and_back(road_map: RoadMap, proj: Proj, x: float, y: float) -> tuple[float, float]:
    """What a client makes of our latitude and longitude: projected, less the offsets."""
    place = Georeference().locate(road_map, x, y)
    assert place is not None
    latitude, longitude = place
    east, north = proj(longitude, latitude)
    return east - road_map.origin[0], north - road_map.origin[1]


@pytest.mark.parametrize(
    "projection",
    [
        "UTM52N",
        "+proj=utm +zone=52 +ellps=WGS84",
        "+proj=utm +zone=52 +datum=WGS84 +units=m +no_defs",
        "+proj=utm +zone=52 +ellps=WGS84 +geoidgrids=egm96_15.gtx +vunits=m +no_defs",
        Projection(is_tm=False, zone=52),
    ],
)
@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (1_234.5678, -987.6543), (-50_000.0, 80_000.0)])
def test_utm_projection_of_a_fix_gives_map_coordinates(projection: Projection | str, x: float, y: float) -> None:
    utm = Proj(proj="utm", zone=52, ellps="WGS84")
    assert there_and_back(make_map(projection), utm, x, y) == pytest.approx((x, y), abs=1e-4)


def test_southern_hemisphere_has_a_false_northing_of_ten_million() -> None:
    road_map = make_map("UTM23S", (330_000.0, 7_390_000.0, 0.0))
    utm = Proj(proj="utm", zone=23, south=True, ellps="WGS84")
    assert there_and_back(road_map, utm, 12.5, -3.25) == pytest.approx((12.5, -3.25), abs=1e-4)
    place = Georeference().locate(road_map, 0.0, 0.0)
    assert place is not None
    assert place[0] == pytest.approx(-23.6, abs=0.1)


@pytest.mark.parametrize(
    "text",
    [
        "+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs",
        "+proj=tmerc +lat_0=38 +lon_0=127 +k=1 +x_0=200000 +y_0=600000 +ellps=GRS80 +units=m +no_defs",
        "+proj=tmerc +lat_0=38 +lon_0=127.0028902777778 +k=0.9996 +x_0=1e5 +ellps=WGS84",
    ],
)
@pytest.mark.parametrize("is_by_figures", [False, True])
def test_custom_transverse_mercator_is_supported(text: str, *, is_by_figures: bool) -> None:
    road_map = make_map(text, (100.0, 200.0, 0.0))
    if is_by_figures:
        figures = {name: getattr(road_map.projection, name) for name in Projection.__struct_fields__}
        road_map = make_map(Projection(**(figures | {"text": ""})), road_map.origin)
    assert there_and_back(road_map, Proj(text), 321.0, 654.0) == pytest.approx((321.0, 654.0), abs=1e-4)


def test_latitude_and_longitude_are_wgs_84_for_every_map_datum() -> None:
    shifted = "+proj=tmerc +lat_0=38 +lon_0=127 +ellps=bessel +towgs84=-146.43,507.89,681.46 +units=m +no_defs"
    plain = "+proj=tmerc +lat_0=38 +lon_0=127 +ellps=WGS84 +units=m +no_defs"
    one, other = (Georeference().locate(make_map(text, (0.0, 0.0, 0.0)), 0.0, 0.0) for text in (shifted, plain))
    assert one is not None
    assert other is not None
    assert 0.001 < abs(one[1] - other[1]) < 0.01  # some 200 m, by the shift of the datum


def test_invalid_projection_gives_no_fix_and_one_log_line(caplog: pytest.LogCaptureFixture) -> None:
    globe, road_map = Georeference(), make_map("+proj=utm +zone=52 +ellps=bogus")
    with caplog.at_level(logging.WARNING):
        assert globe.locate(road_map, 0.0, 0.0) is None
        assert globe.locate(road_map, 1.0, 0.0) is None
    (line,) = caplog.messages
    assert line.startswith("map tiny: no GPS fix, because its projection cannot be used: ")
    assert globe.locate(make_map("UTM52N"), 0.0, 0.0) is not None, "another map comes"


def test_position_outside_the_projection_gives_no_fix() -> None:
    assert Georeference().locate(make_map("UTM52N"), 1e9, 0.0) is None


def test_projection_text_of_the_map_is_kept_unchanged() -> None:
    text = "+proj=utm +zone=52 +ellps=WGS84 +units=m"
    assert proj_text(read_projection(text, "map")) == text
    assert proj_text(read_projection("UTM52N", "map")) == "+proj=utm +zone=52 +ellps=WGS84 +units=m +no_defs"
