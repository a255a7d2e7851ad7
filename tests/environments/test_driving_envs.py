"""The environments by Gymnasium's rules, one by one and as one set of arrays."""

from __future__ import annotations

import copy
import math
import pickle
import sys
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("loops")

gymnasium = pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

from rosbridge_sim.environments.observations import observe, pick  # noqa: E402
from rosbridge_sim.environments.registration import TASKS, register_all  # noqa: E402
from tests import fork_server  # noqa: E402

LANE = "rosbridge_sim/LaneKeeping-v1"


@pytest.fixture(autouse=True)
def registered() -> None:
    register_all()


def make_many(num: int, mode: AutoresetMode, **options: Any) -> Any:  # noqa: ANN401 - Gymnasium has no types here
    return gymnasium.make_vec(
        LANE, num_envs=num, vectorization_mode="vector_entry_point", autoreset_mode=mode, **options
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_environment_follows_the_rules(name: str) -> None:
    check_env(gymnasium.make(name).unwrapped, skip_render_check=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"observation": "OccupancyGrid", "grid_size": 30.0, "grid_step": 3.0},
        {"observation": "Lidar", "num_rays": 12, "normalize": False},
        {"observation": "Dict", "parts": ("Lane", "Others", "Lidar", "OccupancyGrid")},
        {"observation": "Kinematics", "normalize": False, "lights": True, "action": "Pedals"},
        {"observation": "Lane", "action": "DiscreteMeta"},
    ],
)
def test_observations_and_actions_follow_the_rules(options: dict[str, Any]) -> None:
    check_env(gymnasium.make("rosbridge_sim/Drive-v0", traffic=3, **options).unwrapped, skip_render_check=True)
    many = gymnasium.make_vec(
        "rosbridge_sim/Drive-v0", num_envs=2, vectorization_mode="vector_entry_point", traffic=3, **options
    )
    many.reset(seed=0)
    many.action_space.seed(0)
    for _ in range(3):
        assert many.observation_space.contains(many.step(many.action_space.sample())[0])


@pytest.mark.slow
def test_observations_in_si_units_are_those_of_the_worlds() -> None:
    one = gymnasium.make(
        "rosbridge_sim/Highway-v1", normalize=False, observation="Dict", parts=("Lane", "Others", "Lidar")
    )
    one.reset(seed=0)
    seen = one.step(np.array([0.0, 1.0]))[0]
    worlds = one.unwrapped.worlds
    assert seen["Lane"][0] == np.float32(worlds.egos()["speed"][0, 0])
    assert seen["Others"] == pytest.approx(np.clip(worlds.others(14)[0, 0], -100.0, 100.0), rel=1e-6)
    assert seen["Lidar"][:, 0] == pytest.approx(worlds.rays(36, 50.0)[0, 0, :, 0], rel=1e-6)


@pytest.mark.slow
def test_meta_actions_change_lanes_and_speeds() -> None:
    one = gymnasium.make(
        "rosbridge_sim/Highway-v1", traffic=0, action="DiscreteMeta", start_lane="L2_03", start_s=10.0, start_speed=20.0
    )
    one.reset(seed=0)
    speeds, lanes = [], []
    roads = one.unwrapped.worlds.world(0).roads
    for number in range(85):
        action = {0: 3, 1: 3, 10: 0, 60: 4, 61: 4}.get(number, 1)
        *_, terminated, _, info = one.step(action)
        assert not terminated
        speeds.append(info["speed"])
        lanes.append(roads.ids[int(one.unwrapped.worlds.lanes()["lane"][0, 0])][:2])
    assert lanes[9] == "L2"
    assert lanes[59] == "L1"
    assert speeds[59] == pytest.approx(30.0, abs=1.0)
    assert speeds[-1] < 26.0


def test_meta_actions_of_many_environments_equal_those_of_one() -> None:
    options: dict[str, Any] = {"action": "DiscreteMeta", "traffic": 8, "observation": "Kinematics"}
    many = gymnasium.make_vec(
        "rosbridge_sim/Highway-v1", num_envs=2, vectorization_mode="vector_entry_point", **options
    )
    one = gymnasium.make("rosbridge_sim/Highway-v1", **options)
    many.reset(seed=3)
    one.reset(seed=4)
    rng = np.random.default_rng(0)
    for _ in range(15):
        actions = rng.integers(5, size=2)
        assert one.step(actions[1])[0].tobytes() == many.step(actions)[0][1].tobytes()


@pytest.mark.slow
def test_camera_shows_the_road_ahead() -> None:
    pytest.importorskip("moderngl", reason="the extra rosbridge-sim[sensors]")
    one = gymnasium.make("rosbridge_sim/LaneKeeping-v1", observation="Camera", camera_width=48, camera_height=32)
    seen, _ = one.reset(seed=0)
    assert one.observation_space.contains(seen)
    sky, road = seen[:6].mean(axis=(0, 1)), seen[-6:].mean(axis=(0, 1))
    assert sky[2] > 1.3 * sky[0]  # blue
    assert abs(road[2] - road[0]) < 20.0  # grey


def test_camera_without_its_library_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "moderngl", None)
    with pytest.raises(RuntimeError, match=r"pip install 'rosbridge-sim\[sensors\]'"):
        gymnasium.make(LANE, observation="Camera")


@pytest.mark.slow
def test_environments_of_arrays_equal_single_ones_of_the_same_seed() -> None:
    many = make_many(3, AutoresetMode.DISABLED, traffic=3, observation="Kinematics")
    singles = [gymnasium.make(LANE, traffic=3, observation="Kinematics") for _ in range(3)]
    seen = many.reset(seed=5)[0]
    rng = np.random.default_rng(1)
    for i, one in enumerate(singles):
        assert one.reset(seed=5 + i)[0].tobytes() == seen[i].tobytes()
    for _ in range(12):
        actions = rng.uniform(-1.0, 1.0, (3, 2))
        seen, rewards, *_ = many.step(actions)
        for i, one in enumerate(singles):
            own, reward, *_ = one.step(actions[i])
            assert own.tobytes() == seen[i].tobytes()
            assert reward == rewards[i]


def leave_the_road(many: Any) -> tuple[int, tuple[Any, ...]]:  # noqa: ANN401 - as above
    """Steer the first environment off the road; the number of steps and the last result."""
    actions = np.zeros((2, 2))
    actions[0] = 0.3, 1.0
    for num in range(200):
        result = many.step(actions)
        if result[2][0]:
            return num, result
    raise AssertionError("it stays on the road")


def test_ended_environment_begins_again_at_the_next_step() -> None:
    many = make_many(2, AutoresetMode.NEXT_STEP)
    many.reset(seed=1)
    _, (_, rewards, terminated, _, infos) = leave_the_road(many)
    assert rewards[0] < -5.0
    assert infos["is_off_road"].tolist() == [True, False]
    assert terminated.tolist() == [True, False]
    frames = many.unwrapped.worlds.frames
    _, rewards, terminated, _, _ = many.step(np.ones((2, 2)))
    assert many.unwrapped.worlds.frames.tolist() == [0, frames[1] + 5]
    assert (rewards[0], terminated[0]) == (0.0, False)


def test_ended_environment_begins_again_at_the_same_step() -> None:
    many = make_many(2, AutoresetMode.SAME_STEP)
    many.reset(seed=1)
    _, (seen, _, terminated, _, infos) = leave_the_road(many)
    assert terminated.tolist() == [True, False]
    assert many.unwrapped.worlds.frames[0] == 0
    assert infos["_final_obs"].tolist() == [True, False]
    assert not np.array_equal(infos["final_obs"][0], seen[0])
    assert infos["final_info"]["is_off_road"][0]


def test_environments_are_reset_by_a_mask_alone() -> None:
    many = make_many(2, AutoresetMode.DISABLED)
    many.reset(seed=1)
    leave_the_road(many)
    frames = many.unwrapped.worlds.frames
    many.reset(options={"reset_mask": np.array([True, False])})
    assert many.unwrapped.worlds.frames.tolist() == [0, frames[1]]


def test_episode_is_truncated_after_the_steps_that_gymnasium_knows() -> None:
    assert gymnasium.spec("rosbridge_sim/Parking-v1").max_episode_steps == 600
    assert gymnasium.make(LANE).spec.max_episode_steps == 400
    one, many = gymnasium.make(LANE, max_episode_steps=5), make_many(1, AutoresetMode.DISABLED, max_episode_steps=5)
    for each, action in ((one, np.zeros(2)), (many, np.zeros((1, 2)))):
        each.reset(seed=0)
        assert [bool(each.step(action)[3]) for _ in range(5)] == [False, False, False, False, True]
    with pytest.raises(TypeError, match="duration: there is no such option; give max_episode_steps"):
        gymnasium.make(LANE, duration=0.5)


def test_pictures_a_second_are_the_steps_a_second() -> None:
    for each in (gymnasium.make(LANE, frame_skip=2), make_many(1, AutoresetMode.DISABLED, frame_skip=2)):
        assert each.metadata["render_fps"] == 25.0


@pytest.mark.parametrize(
    ("seed", "text"),
    [
        ([1, 2, 3], "seed: expected 2 seeds, one for each environment, got 3"),
        ([1, -1], "seed: expected whole numbers from 0 on, or None, got -1"),
        ([1, 0.5], "seed: expected whole numbers from 0 on, or None, got 0.5"),
        (-1, "seed: expected whole numbers from 0 on, or None, got -1"),
    ],
)
def test_wrong_seeds_are_refused(seed: Any, text: str) -> None:  # noqa: ANN401
    many = make_many(2, AutoresetMode.DISABLED)
    with pytest.raises(ValueError, match=text):
        many.reset(seed=seed)
    with pytest.raises(ValueError, match=r"reset_mask: expected bool of shape \(2,\), got bool \(3,\)"):
        many.reset(options={"reset_mask": np.ones(3, dtype=bool)})


def test_infos_have_the_score() -> None:
    one = gymnasium.make(LANE)
    assert one.reset(seed=0)[1]["score"]["num_collisions"] == 0.0
    for _ in range(5):
        info = one.step(np.array([0.0, 1.0]))[4]
    assert info["score"]["score_distance"] == info["distance"] > 0.0


def test_function_of_the_user_replaces_the_reward() -> None:
    def reward(worlds: Any, judgement: Any, actions: Any) -> Any:  # noqa: ANN401 - the user's
        return 2.0 * judgement.reward + actions[:, 0] + worlds.frames

    plain, own = (make_many(2, AutoresetMode.DISABLED, **options) for options in ({}, {"reward": reward}))
    rewards = []
    for each in (plain, own):
        each.reset(seed=3)
        rewards.append(each.step(np.array([[0.5, 1.0], [0.0, 1.0]]))[1])
    assert rewards[1] == pytest.approx(2.0 * rewards[0] + [0.5, 0.0] + 5.0)


def test_function_of_the_user_is_the_observation() -> None:
    def observation(worlds: Any) -> Any:  # noqa: ANN401 - the user's
        return np.stack([worlds.egos()["speed"], worlds.lanes()["offset"]], axis=-1)

    many = make_many(2, AutoresetMode.DISABLED, observation=observation)
    assert many.single_observation_space.shape == (2,)
    many.reset(seed=0)
    seen, *_, infos = many.step(np.array([[0.1, 1.0], [0.0, 0.5]]))
    assert seen.dtype == np.float32
    assert seen[:, 0].tolist() == infos["speed"].astype(np.float32).tolist()
    with pytest.raises(
        ValueError, match=r"observation: expected shape \(2, 1\) and more from the function, got \(2,\)"
    ):
        make_many(2, AutoresetMode.DISABLED, observation=lambda worlds: worlds.frames)


def test_reward_of_another_shape_is_refused() -> None:
    many = make_many(2, AutoresetMode.DISABLED, reward=lambda *_: 1.0)
    with pytest.raises(ValueError, match=r"reward: expected an array of shape \(2,\) from the function, got \(\)"):
        many.reset(seed=0)


def test_episode_begins_on_its_lane_with_nothing_near() -> None:
    one = gymnasium.make("rosbridge_sim/Merge-v0")
    for seed in range(3):
        seen, info = one.reset(seed=seed)
        assert info["speed"] == 15.0
        assert abs(info["offset"]) < 0.01
        others = seen[15:].reshape(-1, 9)
        assert (np.hypot(others[:, 1], others[:, 2])[others[:, 0] > 0.0] > 0.2).all()


def test_no_change_of_lanes_leads_to_a_goal() -> None:
    many = gymnasium.make_vec("rosbridge_sim/Intersection-v1", num_envs=6, vectorization_mode="vector_entry_point")
    many.reset(seed=0)
    episodes, lanes = many.unwrapped.episodes, many.unwrapped.worlds.lanes()["lane"][:, 0].astype(int)
    roads = many.unwrapped.worlds.world(0).roads.alone
    num_beside = 0
    for lane, goals in zip(lanes.tolist(), episodes.starts.goal_lanes[:, 0], strict=True):
        names = {roads.ids[goal] for goal in goals.nonzero()[0].tolist()}
        road, end = roads.ids[lane][:-2], roads.ids[lane][3:5]  # R, from column and row, to column and row
        assert names
        assert all(name[1:3] == end and name[:-2] != road for name in names)
        num_beside += roads.left[lane] >= 0 or roads.right[lane] >= 0
    assert num_beside


def test_lane_on_which_the_scenario_has_the_ego_is_no_goal() -> None:
    env = gymnasium.make("rosbridge_sim/Drive-v0", scenario="loop", goal="lane", goal_lane="*")
    env.reset(seed=0)
    *_, terminated, truncated, info = env.step(np.zeros(2))
    assert (terminated, truncated, bool(info["has_arrived"])) == (False, False, False)


def test_red_light_costs_and_a_lane_beyond_the_junction_is_the_goal() -> None:
    one = gymnasium.make("rosbridge_sim/Intersection-v1", traffic=0)
    seen, info = one.reset(seed=0)
    assert 15.0 < 100.0 * seen[15] <= 41.0
    ran_red = False
    for _ in range(200):
        must_stop, before = seen[16] > 0.0, info["score"]["num_red_lights"]
        forward, left = 40.0 * seen[9], 40.0 * seen[10]
        steering = np.clip(12.0 * left / max(forward**2 + left**2, 1.0), -1.0, 1.0)
        seen, reward, terminated, _, info = one.step(np.array([steering, np.clip(8.0 - 40.0 * seen[0], -1.0, 1.0)]))
        if info["score"]["num_red_lights"] > before:
            ran_red = True
            assert must_stop
            assert reward < -8.0
        if terminated:
            break
    assert ran_red
    assert info["has_arrived"]
    assert reward > 9.0


def test_parked_ego_has_arrived() -> None:
    one = gymnasium.make("rosbridge_sim/Parking-v1").unwrapped
    goals = set()
    for seed in range(4):
        one.reset(seed=seed)
        goals.add(tuple(one._many.episodes.starts.goals[0, 0]))
    assert len(goals) > 1
    x, y, yaw = one._many.episodes.starts.goals[0, 0]
    centre = float(one.worlds.egos()["centre"][0, 0])
    one.worlds.place(0, x=x - centre * np.cos(yaw), y=y - centre * np.sin(yaw), yaw=yaw)
    seen, reward, terminated, _, info = one.step(np.zeros(2))
    assert terminated
    assert info["has_arrived"]
    assert not info["has_collided"]
    assert np.abs(seen["achieved_goal"] - seen["desired_goal"]).max() < 1e-3
    assert reward == one.compute_reward(seen["achieved_goal"], seen["desired_goal"], info) > -0.02


def test_ego_that_may_reverse_does_so_after_it_has_stopped() -> None:
    one = gymnasium.make("rosbridge_sim/Parking-v1")
    one.reset(seed=0)
    speeds = [one.step(np.array([0.0, accel]))[4]["speed"] for accel in [0.5] * 10 + [-0.5] * 20 + [0.5] * 20]
    assert speeds[9] > 1.0
    assert min(speeds) < -0.5
    assert speeds[-1] > 0.5


def test_rewards_of_goals_are_computed_for_many_steps() -> None:
    one = gymnasium.make("rosbridge_sim/Parking-v1").unwrapped
    one.reset(seed=0)
    steps = [one.step(np.array([0.1, 0.5])) for _ in range(4)]
    achieved, desired = (np.stack([step[0][f"{name}_goal"] for step in steps]) for name in ("achieved", "desired"))
    infos = np.array([step[4] for step in steps])
    assert one.compute_reward(achieved, desired, infos).tolist() == [step[1] for step in steps]


def test_picture_shows_the_ego_in_the_middle() -> None:
    one = gymnasium.make(LANE, render_mode="rgb_array")
    one.reset(seed=0)
    picture = one.render()
    assert picture.shape == (400, 600, 3)
    assert picture[195:206, 300:310].reshape(-1, 3).tolist().count([20, 120, 60]) > 50


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"observation": "Lanes"}, "observation: expected one of Lane, Others"),
        ({"parts": ("Lanes",)}, "parts: expected names of Lane"),
        ({"goal": "bay"}, "goal_lane: expected the lanes of the goal"),
        ({"weights": {"speeed": 1.0}}, r"weights: expected names of .* got speeed \(did you mean speed\?\)"),
        ({"weights": {"speed": math.nan}}, "weights: expected finite numbers, got nan for speed"),
        ({"frame_skip": 0}, "frame_skip: expected a whole number from 1 on, got 0"),
        ({"frame_skip": 2.5}, "frame_skip: expected a whole number from 1 on, got 2.5"),
        ({"num_rays": True}, "num_rays: expected a whole number from 1 on, got True"),
        ({"traffic": -1}, "traffic: expected a whole number from 0 on, got -1"),
        ({"max_offset": math.nan}, "max_offset: expected a positive number or inf, got nan"),
        ({"target_speeds": (math.nan,)}, "target_speeds: expected rising positive numbers"),
        ({"reward": 1.0}, "reward: expected a function"),
        ({"start_lane": "none"}, "start_lane: expected a lane of the map of 'loop', or a pattern of lanes, got 'none'"),
        ({"start_speed": -1.0}, "start_speed: expected a number from 0 on"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        gymnasium.make(LANE, **options)


def test_misspelt_option_is_told_with_the_nearest_name() -> None:
    with pytest.raises(TypeError, match=r"frame_skp: there is no such option \(did you mean frame_skip\?\)"):
        gymnasium.make(LANE, frame_skp=5)


def test_wrong_meta_actions_are_refused() -> None:
    many = make_many(2, AutoresetMode.DISABLED, action="DiscreteMeta")
    many.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions: expected 2 numbers within 0\.\.4"):
        many.unwrapped.step(np.array([0, 5]))


def test_wrong_actions_are_refused() -> None:
    many = make_many(2, AutoresetMode.DISABLED)
    many.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions: expected shape \(2, 2\), got \(3, 2\)"):
        many.unwrapped.step(np.zeros((3, 2)))


def copies(env: Any) -> list[Any]:  # noqa: ANN401
    return [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]  # noqa: S301 - our own bytes


def told(result: tuple[Any, ...]) -> list[Any]:
    return [each.tobytes() if isinstance(each, np.ndarray) else str(each) for each in result]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Intersection-v1", "Parking-v1", "Drive-v0"])
def test_copy_goes_on_to_the_bit(name: str) -> None:
    env = gymnasium.wrappers.RecordEpisodeStatistics(gymnasium.make(f"rosbridge_sim/{name}", max_episode_steps=14))
    env.reset(seed=3)
    env.action_space.seed(1)
    for _ in range(7):
        env.step(env.action_space.sample())
    all_three = [env, *copies(env)]
    for _ in range(2):
        is_over = False
        while not is_over:
            results = [each.step(each.action_space.sample()) for each in all_three]
            is_over = results[0][2] or results[0][3]
            for result in results:
                result[4].get("episode", {}).pop("t", None)  # by the clock on the wall
            assert told(results[0]) == told(results[1]) == told(results[2])
        begins = [told(each.reset()) for each in all_three]
        assert begins[0] == begins[1] == begins[2]


def test_copy_of_many_environments_goes_on_to_the_bit() -> None:
    options: dict[str, Any] = {"action": "DiscreteMeta", "traffic": 3, "observation": "Kinematics"}
    many = make_many(3, AutoresetMode.SAME_STEP, max_episode_steps=6, **options)
    many.reset(seed=3)
    rng = np.random.default_rng(0)
    many.step(rng.integers(5, size=3))
    both = [many, *copies(many)]
    for _ in range(8):
        actions = rng.integers(5, size=3)
        results = [told(each.step(actions)) for each in both]
        assert results[0] == results[1] == results[2]
    many.reset(seed=9)
    assert told(both[1].step(actions)) == told(both[2].step(actions))  # what is done to one leaves the others alone


@pytest.mark.slow
def test_name_alone_imports_the_environments() -> None:
    """For programs of others that take a name and import nothing of ours."""
    program = (
        "import gymnasium, sys\n"
        "assert not any('rosbridge_sim' in name for name in gymnasium.registry)\n"
        "assert 'rosbridge_sim.environments' not in sys.modules\n"
        "env = gymnasium.make('rosbridge_sim.environments:rosbridge_sim/LaneKeeping-v1')\n"
        "print(env.reset(seed=1)[0].shape)\n"
    )
    done = fork_server.run(["-c", program])
    assert (done.stdout, done.stderr) == ("(15,)\n", "")


@pytest.mark.parametrize("observation", ["Lane", "Kinematics", "Others", "Dict"])
def test_observation_of_a_step_is_that_of_the_worlds_after_it(observation: str) -> None:
    env: Any = gymnasium.make("rosbridge_sim/Highway-v1", observation=observation)
    env.reset(seed=0)
    for _ in range(3):
        seen, *_ = env.step(np.array([0.1, 0.5], np.float32))
        fresh = pick(observe(env.unwrapped.worlds, env.unwrapped.task), (0, 0))
        names = seen if isinstance(seen, dict) else [...]
        assert all(np.array_equal(seen[name], fresh[name]) for name in names)
