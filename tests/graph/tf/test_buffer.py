"""The tree of frames, compared with matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.tf.buffer import (
    IDENTITY,
    MAX_TF_FRAMES,
    MAX_TREE_DEPTH,
    Placed,
    Transform,
    TransformBuffer,
    compose,
    frame_name,
    invert,
    turn,
)
from rosbridge_sim.loose_types import Struct
from tests.graph.bus_fixture import make_bus, make_peer, make_store

Matrix = npt.NDArray[np.float64]


class TransformSource(Participant):
    """Whoever tells of transforms."""

    def __init__(self, name: str = "/notifier") -> None:
        self.name = name

    def notify(self, level: str, text: str) -> None:
        raise AssertionError(f"{level}: {text}")


TELLER = TransformSource()


def stamped(parent: str, child: str, pose: Transform = IDENTITY, frame: int = 0) -> Struct:
    store = make_store()
    types = {
        name: store.message(f"geometry_msgs/{name}").struct_type for name in ("Vector3", "Quaternion", "Transform")
    }
    return store.message("geometry_msgs/TransformStamped").struct_type(
        header=store.message("std_msgs/Header").struct_type(
            stamp=store.time_value(frame * 20_000_000), frame_id=parent
        ),
        child_frame_id=child,
        transform=types["Transform"](
            translation=types["Vector3"](x=pose.x, y=pose.y, z=pose.z),
            rotation=types["Quaternion"](x=pose.qx, y=pose.qy, z=pose.qz, w=pose.qw),
        ),
    )


def put(
    frames: TransformBuffer,
    parent: str,
    child: str,
    pose: Transform = IDENTITY,
    frame: int = 0,
    *,
    static: bool = False,
) -> None:
    frames.put(stamped(parent, child, pose, frame), TELLER, is_static=static)


def find(frames: TransformBuffer, target: str, source: str) -> Placed:
    placed = frames.look_up(target, source)
    assert placed is not None
    return placed


def seconds(placed: Placed) -> float | None:
    stamp: Any = placed.stamp
    return None if stamp is None else stamp.secs + stamp.nsecs / 1e9


def random_pose(rng: np.random.Generator, size: float = 100.0) -> Transform:
    q = rng.normal(size=4)
    return Transform(*rng.uniform(-size, size, 3).tolist(), *(q / np.linalg.norm(q)).tolist())


def matrix(pose: Transform) -> Matrix:
    """The same pose by the textbook."""
    x, y, z, w = pose[3:]
    m = np.eye(4)
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, 3] = pose[:3]
    return m


def test_poses_multiply_like_matrices() -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        a, b = random_pose(rng), random_pose(rng)
        np.testing.assert_allclose(matrix(compose(a, b)), matrix(a) @ matrix(b), atol=1e-12)
        np.testing.assert_allclose(matrix(invert(a)), np.linalg.inv(matrix(a)), atol=1e-12)


def test_angle_between_two_orientations_equals_that_of_their_matrices() -> None:
    rng = np.random.default_rng(2)
    for _ in range(100):
        a, b = random_pose(rng), random_pose(rng)
        trace = np.trace(matrix(a)[:3, :3].T @ matrix(b)[:3, :3])
        assert turn(a, b) == pytest.approx(math.acos(np.clip((trace - 1) / 2, -1, 1)), abs=1e-7)
        assert turn(a, a) == 0.0
        assert turn(a, Transform(*a[:3], *(-q for q in a[3:]))) == 0.0
    for angle in (1e-9, 1e-3, 1.0, 3.1):
        turned = Transform(0, 0, 0, 0, math.sin(angle / 2), 0, math.cos(angle / 2))
        assert turn(IDENTITY, turned) == pytest.approx(angle, rel=1e-9)


def test_transform_between_any_two_frames_of_a_tree_is_found() -> None:
    rng = np.random.default_rng(3)
    frames, in_root = TransformBuffer(), {"f0": np.eye(4)}
    for i in range(1, 25):
        parent, pose = f"f{rng.integers(i)}", random_pose(rng)
        put(frames, parent, f"f{i}", pose, static=bool(i % 3 == 0))
        in_root[f"f{i}"] = in_root[parent] @ matrix(pose)
    for target, target_matrix in in_root.items():
        for source, source_matrix in in_root.items():
            pose = find(frames, target, source).pose
            np.testing.assert_allclose(matrix(pose), np.linalg.inv(target_matrix) @ source_matrix, atol=1e-9)
            assert math.hypot(*pose[3:]) == pytest.approx(1.0, abs=1e-12)


def test_single_transform_is_returned_bit_for_bit() -> None:
    frames, pose = TransformBuffer(), Transform(1e6 + 0.1, -2.3, 0.7, 0.0, 0.0, math.sin(0.15), math.cos(0.15))
    put(frames, "map", "base_link", pose, 7)
    assert find(frames, "map", "base_link").pose == pose
    assert find(frames, "base_link", "base_link").pose == IDENTITY


def test_lookup_uses_latest_transforms_and_reports_the_oldest_stamp() -> None:
    frames = TransformBuffer()
    put(frames, "map", "odom", frame=100)
    put(frames, "odom", "base", frame=150)
    put(frames, "base", "lidar", static=True)
    assert seconds(find(frames, "map", "lidar")) == 2.0
    assert seconds(find(frames, "lidar", "odom")) == 3.0
    assert seconds(find(frames, "base", "lidar")) is None
    put(frames, "map", "odom", Transform(5, 0, 0, 0, 0, 0, 1), 200)
    placed = find(frames, "map", "lidar")
    assert (placed.pose.x, seconds(placed)) == (5.0, 3.0)


def test_frame_has_one_parent_and_is_static_or_moving() -> None:
    frames = TransformBuffer()
    put(frames, "a", "x", static=True)
    put(frames, "b", "x", frame=1)
    assert frames.look_up("a", "x") is None
    assert seconds(find(frames, "b", "x")) == 0.02
    put(frames, "a", "x", static=True)
    assert frames.look_up("b", "x") is None
    assert len(frames) == 1


def test_unconnected_frames_have_no_transform() -> None:
    frames = TransformBuffer()
    assert frames.look_up("a", "b") is None
    put(frames, "root", "a")
    put(frames, "other", "b")
    assert frames.look_up("a", "b") is None
    assert frames.look_up("b", "a") is None
    assert frames.look_up("nobody", "a") is None


def test_lookup_in_circles_and_long_chains_ends() -> None:
    frames = TransformBuffer()
    put(frames, "a", "b")
    put(frames, "b", "c")
    put(frames, "c", "a")
    assert frames.look_up("c", "a") is not None
    assert frames.look_up("elsewhere", "a") is None
    for i in range(MAX_TF_FRAMES - 10):
        put(frames, f"n{i}", f"n{i + 1}")
    assert frames.look_up("n0", f"n{MAX_TREE_DEPTH}") is not None
    assert frames.look_up("n0", f"n{MAX_TREE_DEPTH + 2}") is None


def test_least_recently_updated_frame_is_evicted_first_and_static_frames_stay() -> None:
    frames = TransformBuffer()
    put(frames, "map", "fixed", static=True)
    put(frames, "map", "base")
    for i in range(MAX_TF_FRAMES):
        put(frames, "map", f"n{i}")
        put(frames, "map", "base")
    assert len(frames) == MAX_TF_FRAMES + 1
    assert frames.look_up("fixed", "base") is not None
    assert frames.look_up("map", "n0") is None
    assert frames.look_up("map", "n1") is not None


@pytest.mark.parametrize("is_static", [True, False])
def test_client_with_too_many_frames_evicts_only_its_own(*, is_static: bool) -> None:
    client, _ = make_peer(make_bus())
    frames = TransformBuffer()
    put(frames, "map", "base", Transform(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), static=is_static)
    for i in range(MAX_TF_FRAMES + 5):
        frames.put(stamped("map", f"client_{i}"), client, is_static=is_static)
    assert len(frames) == MAX_TF_FRAMES
    assert frames.look_up("map", "base") is not None
    assert frames.look_up("map", "client_0") is None
    assert frames.look_up("map", f"client_{MAX_TF_FRAMES + 4}") is not None


def test_moving_frames_of_one_source_can_be_forgotten() -> None:
    frames, other = TransformBuffer(), TransformSource("/other")
    put(frames, "map", "mine")
    put(frames, "map", "fixed", static=True)
    frames.put(stamped("map", "theirs"), other, is_static=False)
    version = frames.version
    frames.forget(lambda sender: sender is TELLER)
    assert frames.version > version
    assert [frames.look_up("map", name) is None for name in ("mine", "fixed", "theirs")] == [True, False, False]


def test_orientations_are_normalised() -> None:
    frames = TransformBuffer()
    put(frames, "map", "x", Transform(0, 0, 0, 0, 0, 3, 4))
    assert find(frames, "map", "x").pose == Transform(0, 0, 0, 0, 0, 0.6000000000000001, 0.8)


@pytest.mark.parametrize(
    ("parent", "child", "pose", "text"),
    [
        ("", "x", IDENTITY, "needs a name"),
        ("map", "/", IDENTITY, "needs a name"),
        ("map", "/map", IDENTITY, "map -> map: a frame cannot be its own parent"),
        ("map", "x" * 257, IDENTITY, "at most 256"),
        ("map", "x", Transform(0, 0, 0, 0, 0, 0, 0), r"map -> x: rotation \(0, 0, 0, 0\) is not an orientation"),
        ("map", "x", Transform(0, 0, 0, math.nan, 0, 0, 1), "not an orientation"),
        ("map", "x", Transform(0, 0, 0, 1e200, 0, 0, 1), "not an orientation"),
        ("map", "x", Transform(0, math.nan, 0, 0, 0, 0, 1), "not a position"),
        ("map", "x", Transform(math.inf, 0, 0, 0, 0, 0, 1), "not a position"),
    ],
)
def test_invalid_transform_is_refused_and_nothing_is_kept(parent: str, child: str, pose: Transform, text: str) -> None:
    frames = TransformBuffer()
    with pytest.raises(GraphError, match=text):
        put(frames, parent, child, pose)
    assert len(frames) == 0


def test_leading_slash_of_a_frame_name_is_ignored() -> None:
    assert frame_name("/map") == frame_name("map") == "map"
    assert frame_name("/Ego-2/base_link") == "Ego-2/base_link"
