"""Pictures agree with geometry: places, depths, classes, instances, and colours that programs look for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import CameraModel, FisheyeModel, Pose, boxes_in_view, mount, rotation
from rosbridge_sim.scenery.mesh import Label, Mesh, join_meshes
from rosbridge_sim.scenery.pictures import Channel, PictureChoices, Weather
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.shell.rendering import camera_renderer
from rosbridge_sim.shell.rendering.camera_renderer import CameraRenderer
from rosbridge_sim.shell.rendering.shaders import ASPHALT_FADES, GRASS_FADES
from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError
from rosbridge_sim.shell.rendering.weather_looks import LOOKS
from rosbridge_sim.world.state.world import World
from tests.scenery.projection import project
from tests.shell.rendering.graphics import EDU, box_mesh, built_in, ground_mesh, nothing, open_renderer, put
from tests.support import ROOT

pytestmark = pytest.mark.slow

CAMERA = CameraModel(640, 480, 90.0)
CLASSES = Channel.ALL & ~Channel.RGB


def edges_of(mask: np.ndarray) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of the pixels of a mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return float(columns[0]), float(rows[0]), float(columns[-1] + 1), float(rows[-1] + 1)


@pytest.mark.parametrize(
    "pose", [Pose(0, 0, 1.2), Pose(0.3, -1.0, 2.0, 0.02, 0.1, 0.15), Pose(3, 4, 0.5, 0, -0.2, -0.4)]
)
@pytest.mark.parametrize("fov", [60.0, 90.0])
def test_cube_appears_where_its_corners_are_projected(pose: Pose, fov: float) -> None:
    camera = CameraModel(640, 480, fov)
    low, high = (9.0, -0.5, 0.3), (10.0, 0.5, 1.3)
    picture = open_renderer().render(box_mesh(low, high, 7), nothing(), camera, pose, PictureChoices(channels=CLASSES))
    corners = np.array([(x, y, z) for x in (9.0, 10.0) for y in (-0.5, 0.5) for z in (0.3, 1.3)])
    place, _ = project(camera, pose, corners)
    assert picture.instance is not None
    expected = (*place.min(axis=0), *place.max(axis=0))
    # A pixel belongs to the cube if its middle does: an edge is told to half a pixel.
    assert edges_of(picture.instance == 7) == pytest.approx(expected, abs=0.5 + 1e-3)


def test_depth_is_that_of_a_plane_to_a_tenth_of_a_per_mille() -> None:
    pose = Pose(0.0, 0.0, 2.0, pitch=math.radians(7.0))
    picture = open_renderer().render(ground_mesh(), nothing(), CAMERA, pose, PictureChoices(channels=CLASSES))
    assert picture.depth is not None
    assert picture.label is not None
    rays = CAMERA.rays.astype(np.float64)
    down = rays[:, 0] * math.sin(pose.pitch) - rays[:, 2] * math.cos(pose.pitch)
    expected = np.where(down > 0, 2.0 / np.where(down > 0, down, 1.0), np.inf).reshape(480, 640)
    is_near = expected < 100.0
    np.testing.assert_allclose(picture.depth[is_near], expected[is_near], rtol=1e-4)
    assert (picture.label[is_near] == Label.ASPHALT).all()
    assert np.isinf(picture.depth[:100]).all()
    assert not picture.label[:100].any()


def test_nearer_thing_hides_the_farther_one() -> None:
    scene = join_meshes([box_mesh((10, -1, 0), (11, 1, 2), 1), box_mesh((20, -4, 0), (21, 4, 2), 2)])
    picture = open_renderer().render(scene, nothing(), CAMERA, Pose(0, 0, 1.0), PictureChoices(channels=CLASSES))
    assert picture.instance is not None
    assert picture.instance[240, 320] == 1
    assert picture.instance[240, 320 - 50] == 2


def test_silhouettes_fill_the_boxes_of_entities() -> None:
    world = World()
    for name, x, y, yaw in (
        ("2015_Kia_K5", 14, 0, 0.3),
        ("Van", 20, 6, 2.0),
        ("Bus", 35, -9, 0.1),
        ("Box", 9, -3, 0.4),
    ):
        put(world, name, x, y, yaw=yaw)
    frame, pose = take_frame(world), Pose(0, 0, 1.5)
    boxes = boxes_in_view(frame, CAMERA, pose)
    picture = open_renderer().render(ground_mesh(), frame, CAMERA, pose, PictureChoices(channels=CLASSES))
    assert picture.instance is not None
    assert boxes.rows.tolist() == [0, 1, 2, 3]
    for row, bounds in zip(boxes.rows, boxes.bounds, strict=True):
        seen = edges_of(picture.instance == frame.ids[row] + 1)
        width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
        is_within = [
            seen[0] >= bounds[0] - 1,
            seen[1] >= bounds[1] - 1,
            seen[2] <= bounds[2] + 1,
            seen[3] <= bounds[3] + 1,
        ]
        assert all(is_within), (seen, bounds)
        assert (seen[2] - seen[0]) > 0.88 * width
        assert (seen[3] - seen[1]) > 0.85 * height


def test_carrier_of_a_camera_is_not_in_its_picture() -> None:
    world = World()
    own = put(world, "2016_Hyundai_Ioniq", 0, 0)
    other = put(world, "2016_Hyundai_Ioniq", 12, 0)
    picture = open_renderer().render(
        ground_mesh(), take_frame(world), CAMERA, Pose(1.5, 0, 1.4), PictureChoices(without=own, channels=CLASSES)
    )
    assert picture.instance is not None
    assert set(np.unique(picture.instance)) == {0, other + 1}


def test_vehicle_has_its_paint_in_the_colours_and_lights_the_road_ahead_of_it_in_the_night() -> None:
    world = World()
    put(world, "2016_Hyundai_Ioniq", 12, 0)
    frame, pose, camera = take_frame(world), Pose(0, 0, 2.0), CameraModel(160, 120, 90.0)

    def colours(weather: Weather, *, is_there: bool) -> np.ndarray:
        choices = PictureChoices(weather, channels=Channel.RGB)
        rgb = open_renderer().render(ground_mesh(), frame if is_there else nothing(), camera, pose, choices).rgb
        assert rgb is not None
        return rgb.astype(float)

    body = (slice(62, 70), slice(75, 85))
    assert np.abs(colours(Weather.NOON, is_there=True)[body] - colours(Weather.NOON, is_there=False)[body]).mean() > 20
    road = (slice(66, 68), slice(60, 72))  # ahead of the car, and to its left
    with_lamps, without = (colours(Weather.NIGHT, is_there=each)[road].mean() for each in (True, False))
    assert with_lamps > without + 3.0


def test_vehicle_whose_nose_alone_is_in_the_picture_is_drawn() -> None:
    world = World()
    bus = put(world, "Bus", -4.0, 3.0, yaw=0.0)  # its rear axle is behind the camera
    bicycle = put(world, "Bicycle", 3.0, -2.8, yaw=-0.5 * math.pi)  # its rear wheel alone is in the picture
    picture = open_renderer().render(
        ground_mesh(), take_frame(world), CAMERA, Pose(0, 0, 1.5), PictureChoices(channels=CLASSES)
    )
    assert picture.instance is not None
    assert set(np.unique(picture.instance)) == {0, bus + 1, bicycle + 1}


def test_cameras_of_one_frame_see_each_their_own_side() -> None:
    world = World()
    ahead, behind = put(world, "2015_Kia_K5", 12, 0), put(world, "2015_Kia_K5", -12, 0)
    frame = take_frame(world)
    for yaw, seen in ((0.0, ahead), (math.pi, behind), (0.0, ahead)):
        pose = Pose(0, 0, 1.5, yaw=yaw)
        picture = open_renderer().render(ground_mesh(), frame, CAMERA, pose, PictureChoices(channels=CLASSES))
        assert picture.instance is not None
        assert set(np.unique(picture.instance)) == {0, seen + 1}


def test_entities_are_drawn_up_to_their_reach() -> None:
    world, camera = World(), CameraModel(640, 480, 4.0)
    ids = [put(world, "Bus", x, y) for x, y in ((370.0, 4.0), (460.0, -4.0))]
    picture = open_renderer().render(
        ground_mesh(), take_frame(world), camera, Pose(0, 0, 1.5), PictureChoices(channels=CLASSES)
    )
    assert picture.instance is not None
    assert set(np.unique(picture.instance)) == {0, ids[0] + 1}


def test_plain_picture_has_no_mixed_colours_at_the_edges_of_things() -> None:
    scene, pose = box_mesh((10, -1, 0), (11, 1, 2)), Pose(0, 0, 1.0, roll=0.2)
    colours = []
    for is_smooth in (False, True):
        picture = open_renderer().render(
            scene, nothing(), CAMERA, pose, PictureChoices(channels=Channel.RGB, is_smooth=is_smooth)
        )
        assert picture.rgb is not None
        around = picture.rgb[180:300, 260:380].reshape(-1, 3)
        colours.append(len(np.unique(around[around[:, 0] > around[:, 2]], axis=0)))  # red, not sky
    assert colours[0] == 1
    assert colours[1] > 1


def test_parts_that_are_not_wanted_are_not_made() -> None:
    picture = open_renderer().render(
        ground_mesh(), nothing(), CAMERA, Pose(0, 0, 1.0), PictureChoices(channels=Channel.RGB)
    )
    assert picture.depth is None
    assert picture.label is None
    assert picture.instance is None


def test_same_scene_gives_the_same_bytes() -> None:
    world = World()
    put(world, "2015_Kia_K5", 14, 0, yaw=0.3)
    frame = take_frame(world)
    _, static = built_in("town")
    pictures = []
    for weather in (Weather.NOON, Weather.NIGHT, Weather.NOON):
        picture = open_renderer().render(static, frame, CAMERA, Pose(0, 0, 1.5), PictureChoices(weather=weather))
        assert picture.rgb is not None
        pictures.append(picture.rgb.tobytes())
    assert pictures[0] == pictures[2]
    assert pictures[0] != pictures[1]


def test_sizes_that_were_used_are_not_kept_without_bound() -> None:
    renderer = CameraRenderer()
    for width in range(1_000, 3_000, 100):
        renderer.render(
            ground_mesh(), nothing(), CameraModel(width, 720), Pose(0, 0, 1.0), PictureChoices(channels=CLASSES)
        )
    assert sum(width * height for width, height, _ in renderer.sizes) <= 4_000_000
    renderer.close()


def test_lens_bends_a_picture_as_the_model_says() -> None:
    camera = CameraModel(640, 480, 90.0, (-0.2, 0.05, 0.001, -0.002, 0.0))
    pose, low, high = Pose(0, 0, 1.2), (9.0, 4.0, 1.8), (10.0, 5.0, 2.8)
    picture = open_renderer().render(box_mesh(low, high, 7), nothing(), camera, pose)
    corners = np.array([(x, y, z) for x in (9.0, 10.0) for y in (4.0, 5.0) for z in (1.8, 2.8)])
    place, _ = project(camera, pose, corners)
    assert picture.instance is not None
    assert picture.rgb is not None
    assert picture.rgb.shape == (480, 640, 3)
    assert edges_of(picture.instance == 7) == pytest.approx((*place.min(axis=0), *place.max(axis=0)), abs=1.5)


def test_fisheye_has_the_same_depths_on_all_sides_and_beyond_its_seams() -> None:
    camera, pose = FisheyeModel(320, 320, 200.0, (0.02, -0.004, 0.0, 0.0)), Pose(0.0, 0.0, 1.5, 0.05, 0.3, 0.8)
    picture = open_renderer().render(ground_mesh(), nothing(), camera, pose)
    assert picture.depth is not None
    assert picture.label is not None
    down = (camera.rays.astype(np.float64) @ rotation(*pose[3:]).T)[:, 2].reshape(320, 320)
    is_seen = np.isfinite(down)
    assert np.isinf(picture.depth[~is_seen]).all()
    assert (picture.label[~is_seen] == 0).all()
    is_road = is_seen & (down < -0.1)
    assert is_road.sum() > 20_000
    np.testing.assert_allclose(picture.depth[is_road], -1.5 / down[is_road], rtol=0.05)
    assert np.isinf(picture.depth[is_seen & (down > 0.02)]).all()


def test_fisheye_shows_a_box_beside_the_camera_where_the_model_says() -> None:
    camera, pose, low, high = FisheyeModel(640, 480, 200.0), Pose(0, 0, 1.2), (-0.5, 3.0, 0.5), (1.0, 4.0, 2.8)
    picture = open_renderer().render(box_mesh(low, high, 7), nothing(), camera, pose)
    corners = np.array([(x, y, z) for x in (-0.5, 1.0) for y in (3.0, 4.0) for z in (0.5, 2.8)]) - np.array(pose[:3])
    place = camera.outline(corners[None])[0]
    assert picture.instance is not None
    assert edges_of(picture.instance == 7) == pytest.approx((*place.min(axis=0), *place.max(axis=0)), abs=1.5)


@pytest.mark.parametrize(
    ("roll", "pitch"),
    [(0.0, 0.0), (0.0, 0.12), (0.3, 0.1), (-0.3, -0.1), (1.57, 0.0), (2.9, 0.2), (0.0, 1.2), (0.0, -1.2)],
)
def test_sky_has_its_colour_at_each_height_however_the_camera_is_turned(roll: float, pitch: float) -> None:
    camera = CameraModel(80, 60, 90.0)
    picture = open_renderer().render(
        *(ground_mesh(1.0), nothing(), camera, Pose(500.0, 0.0, 2.0, roll, pitch, 0.7)),
        PictureChoices(channels=Channel.RGB),
    )
    rows, columns = np.mgrid[:60, :80]
    ahead = np.full(rows.shape, camera.focal)
    rays = np.stack([ahead, 40.0 - columns - 0.5, 30.0 - rows - 0.5]).reshape(3, -1)  # forward, left, up
    up = (rotation(roll, pitch, 0.7) @ rays)[2].reshape(rows.shape) / np.linalg.norm(rays, axis=0).reshape(rows.shape)
    share = np.clip(up / 0.45, 0.0, 1.0)
    share = (share * share * (3.0 - 2.0 * share))[..., None]  # GLSL's smoothstep
    look = LOOKS[Weather.NOON]
    expected = 255.0 * (np.array(look.horizon) * (1.0 - share) + np.array(look.zenith) * share)
    assert picture.rgb is not None
    assert np.abs(picture.rgb - expected).max() < 1.5


@pytest.mark.parametrize(("label", "fades"), [(Label.ASPHALT, ASPHALT_FADES), (Label.GROUND, GRASS_FADES)])
def test_patterns_of_asphalt_and_grass_are_there_until_they_have_faded_away(label: Label, fades: float) -> None:
    camera, eye = CameraModel(400, 300, 40.0), Pose(0.0, 0.0, 12.0, pitch=math.atan2(12.0, fades))
    num_colours = []
    for first in (0.9 * fades - 3.0, fades):  # farther than `fades` from the eye, which is above the ground
        corners = np.array([(x, y, 0.0) for x in (first, first + 3.0) for y in (-2.0, 2.0)], dtype=np.float32)
        strip = Mesh.of(corners, np.array([[0, 2, 1], [1, 2, 3]], dtype=np.int32), (97, 97, 99), label)
        picture = open_renderer().render(strip, nothing(), camera, eye, PictureChoices(is_smooth=False))
        assert picture.rgb is not None
        assert picture.label is not None
        shown = picture.rgb[picture.label == label]
        assert len(shown) > 50
        num_colours.append(len(np.unique(shown, axis=0)))
    assert num_colours[0] > 3 * num_colours[1]


def test_missing_graphics_name_the_packages_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    open_renderer()
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json")
    monkeypatch.setenv("LIBGL_DRIVERS_PATH", "/nowhere")

    def refuse(**_: object) -> None:
        raise RuntimeError("eglInitialize failed")

    import moderngl  # noqa: PLC0415 - the machine may have none

    monkeypatch.setattr(moderngl, "create_context", refuse)
    with pytest.raises(RenderingUnavailableError) as caught:
        camera_renderer.open_context()
    _, _, packages = str(caught.value).partition("apt-get install ")
    assert packages == "libegl1 libgl1 libgl1-mesa-dri"
    assert packages in (ROOT / "Dockerfile").read_text("utf-8")


# Colours


def hsv_of(rgb: np.ndarray) -> np.ndarray:
    """(n, 3) hue 0..180, saturation and value 0..255, as OpenCV has them."""
    values = rgb.reshape(-1, 3).astype(np.float64)
    top, low = values.max(axis=1), values.min(axis=1)
    span = np.maximum(top - low, 1e-9)
    red, green, blue = values.T
    hue = np.where(
        top == red, (green - blue) / span % 6, np.where(top == green, (blue - red) / span + 2, (red - green) / span + 4)
    )
    return np.column_stack([30.0 * hue * (top > low), 255.0 * (top - low) / np.maximum(top, 1.0), top])


def inner(mask: np.ndarray) -> np.ndarray:
    """Those pixels of a mask whose neighbours belong to it, too: antialiasing mixes no other colour into them."""
    kept = mask.copy()
    for axis in (0, 1):
        for shift in (1, -1):
            kept &= np.roll(mask, shift, axis)
    kept[[0, -1]] = kept[:, [0, -1]] = False
    return kept


@pytest.mark.parametrize("name", ["roundabout", "town"])
def test_paint_asphalt_ground_and_sky_have_the_colours_that_masks_expect_at_noon(name: str) -> None:
    road_map, static = built_in(name)
    roads = road_map.roads
    seen: dict[Label, list[np.ndarray]] = {label: [] for label in Label}
    sky: list[np.ndarray] = []
    for lane in np.argsort(-roads.length)[:40:10].tolist():
        (point,), (yaw,) = roads.at([lane], [0.4 * roads.length[lane]])
        pose = mount(Pose(point[0], point[1], point[2], yaw=float(yaw)), EDU)
        picture = open_renderer().render(static, nothing(), CAMERA, pose)
        assert picture.rgb is not None
        assert picture.label is not None
        assert picture.depth is not None
        for label in (Label.ASPHALT, Label.PAINT_WHITE, Label.PAINT_YELLOW, Label.GROUND):
            near = inner(picture.label == label) & (picture.depth < 20.0)
            seen[label].append(hsv_of(picture.rgb[near]))
        sky.append(hsv_of(picture.rgb[picture.label == Label.NONE]))
    white, yellow, asphalt = (
        np.concatenate(seen[label]) for label in (Label.PAINT_WHITE, Label.PAINT_YELLOW, Label.ASPHALT)
    )
    assert min(len(white), len(yellow)) > 1_000
    assert np.mean((white[:, 0] <= 30) & (white[:, 1] <= 10) & (white[:, 2] >= 205)) > 0.99
    is_yellow = (yellow[:, 0] >= 20) & (yellow[:, 0] <= 30) & (yellow[:, 1] >= 130)
    assert np.mean(is_yellow & (yellow[:, 2] >= 120) & (yellow[:, 2] <= 230)) > 0.99
    assert np.mean(asphalt[:, 2] <= 145) > 0.999
    # The widest masks for yellow paint begin at a saturation of 80 and end at a hue of 45.
    ground = np.concatenate(seen[Label.GROUND])
    assert np.mean((ground[:, 0] > 45) | (ground[:, 1] < 80)) > 0.999
    # No mask for white or yellow paint takes the sky: its saturation is above 80 and its hue is blue.
    blue = np.concatenate(sky)
    assert np.mean((blue[:, 1] > 80) & (blue[:, 0] > 90) & (blue[:, 0] < 120)) > 0.99
