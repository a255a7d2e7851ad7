"""The environment of a server's ego: equal to one in this process, and refusals."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from rosbridge_sim import Simulator, Worlds  # noqa: E402
from rosbridge_sim.client import Client  # noqa: E402
from rosbridge_sim.environments.registration import REMOTE, register_all  # noqa: E402
from rosbridge_sim.errors import ClientError, DocumentError  # noqa: E402
from rosbridge_sim.maps.road_map import RoadMap  # noqa: E402
from rosbridge_sim.shell.files.library import DiskLibrary  # noqa: E402
from rosbridge_sim.worlds.remote_worlds import RemoteWorlds  # noqa: E402


@pytest.fixture(scope="module")
def server() -> Iterator[Simulator]:
    register_all()
    with Simulator(port=0, scenario="loop", traffic=4, start="sync") as simulator:
        yield simulator


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"observation": "Kinematics"},
        {"observation": "Dict", "parts": ("Lane", "Others", "Lidar", "OccupancyGrid"), "normalize": False},
        {"observation": "Lane", "action": "Pedals", "frame_skip": 7},
        {"observation": "Lane", "goal": "lane", "goal_lane": "*", "weights": {"arrived": 5.0}, "frame_skip": 50},
    ],
)
def test_remote_environment_equals_one_in_this_process(server: Simulator, options: dict[str, Any]) -> None:
    near = gymnasium.make("rosbridge_sim/Drive-v0", scenario="loop", traffic=4, **options)
    far = gymnasium.make(REMOTE, url=server.url, **options)
    rng = np.random.default_rng(2)
    try:
        for seed in (3, None):
            steps = [near.reset(seed=seed), far.reset(seed=seed)]
            for number in range(12):
                assert _bytes(steps[0][0]) == _bytes(steps[1][0]), number
                assert steps[0][1:] == steps[1][1:]
                action = np.array([rng.uniform(-0.3, 0.3), rng.uniform(0.0, 1.0)])
                steps = [env.step(action) for env in (near, far)]
            assert near.unwrapped.worlds.digests() == far.unwrapped.worlds.digests()
    finally:
        far.close()


def _bytes(seen: Any) -> Any:  # noqa: ANN401 - an array or a dict of them
    return {name: part.tobytes() for name, part in seen.items()} if isinstance(seen, dict) else seen.tobytes()


@pytest.mark.slow
def test_remote_environment_follows_the_rules(server: Simulator) -> None:
    far = gymnasium.make(REMOTE, url=server.url, observation="Lane", render_mode="rgb_array")
    try:
        check_env(far.unwrapped, skip_render_check=True, skip_close_check=True)
        assert far.unwrapped.render().shape == (400, 600, 3)
    finally:
        far.close()


@pytest.mark.slow
def test_remote_environment_refuses_to_be_copied(server: Simulator) -> None:
    far = gymnasium.make(REMOTE, url=server.url, observation="Lane")
    try:
        for make in (copy.deepcopy, pickle.dumps):
            with pytest.raises(TypeError, match="the world of a server cannot be copied or pickled: save it there"):
                make(far)
    finally:
        far.close()


@pytest.mark.slow
def test_closed_environment_leaves_the_server_to_others(server: Simulator) -> None:
    for _ in range(2):
        far = gymnasium.make(REMOTE, url=server.url, observation="Lane")
        far.reset(seed=0)
        far.close()
    with Client(server.url) as client:
        assert client.start_sync() >= 0


@pytest.mark.slow
def test_world_of_a_server_is_commanded_and_begun_again_as_one_in_this_process(server: Simulator) -> None:
    far = RemoteWorlds(server.url)
    try:
        far.reset(seeds=[5])
        far.step({"steering": [[0.0]], "speed": 5.0}, 30)
        assert (far.frames.tolist(), far.seeds) == ([30], [5])
        assert far.scores()["score_distance"][0, 0] > 0.3
        far.reset(np.array([False]))
        assert far.frames.tolist() == [30]
        far.reset()
        assert (far.frames.tolist(), far.seeds, far.map_of(0).name) == ([0], [5], Worlds("loop").map_of(0).name)
        with pytest.raises(ValueError, match=r"world: expected 0\.\.0, got 1"):
            far.map_of(1)
        with pytest.raises(ValueError, match="gear: expected none"):
            far.step({"steering": 0.0, "accel": 0.0, "gear": 1})
        refusals: list[Callable[[], None]] = [lambda: far.place(0), lambda: far.remove(0, 1)]
        for refused in refusals:
            with pytest.raises(ValueError, match="an ego of a server begins where its scenario has it"):
                refused()
    finally:
        far.close()


class OtherMaps(DiskLibrary):
    """A library that has another map under each name."""

    def map(self, name: str) -> RoadMap:
        return super().map("hills" if name != "hills" else "track")


@pytest.mark.slow
def test_server_with_another_map_under_the_same_name_is_refused_and_left_to_others(server: Simulator) -> None:
    for _ in range(2):  # the first attempt does not stay the master
        with pytest.raises(DocumentError, match="the server has another one than this program"):
            RemoteWorlds(server.url, library=OtherMaps())


@pytest.mark.slow
def test_second_master_is_refused(server: Simulator) -> None:
    with Client(server.url) as client:
        client.start_sync(user_id="somebody")
        with pytest.raises(ClientError, match="somebody"):
            gymnasium.make(REMOTE, url=server.url)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"start_lane": "L2_00"}, "start_lane: expected '' with a server, got 'L2_00'"),
        ({"action": "DiscreteMeta"}, "action: expected Continuous or Pedals with a server"),
        ({"render_mode": "human"}, "render_mode: expected rgb_array or None, because the server has a page"),
        ({"goal": "bay", "goal_lane": "*"}, "goal: expected '' or 'lane' with a server"),
        ({"reverses": True}, "reverses: expected False with a server"),
    ],
)
def test_options_that_no_server_can_have_are_refused(options: dict[str, Any], text: str) -> None:
    register_all()
    with pytest.raises(ValueError, match=text):
        gymnasium.make(REMOTE, url="ws://127.0.0.1:1", disable_env_checker=True, **options)


def test_missing_server_is_told() -> None:
    register_all()
    with pytest.raises(ClientError, match=r"127\.0\.0\.1:1"):
        gymnasium.make(REMOTE, url="ws://127.0.0.1:1")
