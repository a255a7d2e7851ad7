"""The environments by Gymnasium's rules, one by one and as one set of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from gymnasium.wrappers import FlattenObservation, RecordEpisodeStatistics  # noqa: E402

from rosbridge_sim.environments.registration import TASKS, register_all  # noqa: E402

LANE = "rosbridge_sim/LaneKeeping-v0"


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


def test_episode_is_truncated_after_its_duration() -> None:
    one = gymnasium.make(LANE, duration=0.5)
    one.reset(seed=0)
    ends = [one.step(np.zeros(2))[3] for _ in range(5)]
    assert ends == [False, False, False, False, True]


def test_wrappers_of_gymnasium_work() -> None:
    one = RecordEpisodeStatistics(FlattenObservation(gymnasium.make(LANE, duration=0.3)))
    one.reset(seed=0)
    info: dict[str, Any] = {}
    for _ in range(3):
        *_, info = one.step(np.zeros(2))
    assert info["episode"]["l"] == 3


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


def test_red_light_costs_and_a_lane_beyond_the_junction_is_the_goal() -> None:
    one = gymnasium.make("rosbridge_sim/Intersection-v0", traffic=0)
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
    one = gymnasium.make("rosbridge_sim/Parking-v0").unwrapped
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
    one = gymnasium.make("rosbridge_sim/Parking-v0")
    one.reset(seed=0)
    speeds = [one.step(np.array([0.0, accel]))[4]["speed"] for accel in [0.5] * 10 + [-0.5] * 20 + [0.5] * 20]
    assert speeds[9] > 1.0
    assert min(speeds) < -0.5
    assert speeds[-1] > 0.5


def test_rewards_of_goals_are_computed_for_many_steps() -> None:
    one = gymnasium.make("rosbridge_sim/Parking-v0").unwrapped
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
        ({"weights": {"speeed": 1.0}}, "weights: expected names of"),
        ({"frame_skip": 0}, "frame_skip: expected a positive number"),
        ({"reward": 1.0}, "reward: expected a function"),
        ({"start_lane": "none"}, "start_lane: expected a lane of the map of 'loop', or a pattern of lanes, got 'none'"),
        ({"start_speed": -1.0}, "start_speed: expected a number from 0 on"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        gymnasium.make(LANE, **options)


def test_wrong_actions_are_refused() -> None:
    many = make_many(2, AutoresetMode.DISABLED)
    many.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions: expected shape \(2, 2\), got \(3, 2\)"):
        many.unwrapped.step(np.zeros((3, 2)))
