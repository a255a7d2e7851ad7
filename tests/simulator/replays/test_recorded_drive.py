"""Recordings: interpolation between stamps, and conversion of messages."""

from __future__ import annotations

import math
from types import SimpleNamespace as Struct
from typing import Any
from weakref import ref

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.morai.messages.object_lists import DEGREES, exact_quotient
from rosbridge_sim.morai.releases import FIELD, MANUAL, Profile
from rosbridge_sim.simulator.replays import recording_builder as recorded
from rosbridge_sim.simulator.replays.recorded_drive import EGO_COLUMNS, OBJECT_COLUMNS, Recording
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.state.world import Kind
from tests.simulator.sim_harness import make_store

SECOND = 1_000_000_000


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Struct:
    return Struct(x=x, y=y, z=z)


def ego(x: float, heading_deg: float = 0.0, **fields: Any) -> Struct:  # noqa: ANN401 - any field
    return Struct(
        **{
            "position": vector(x, 2.0, 3.0),
            "velocity": vector(4.0),
            "acceleration": vector(0.5, 0.25),
            "heading": heading_deg,
            "accel": 0.75,
            "brake": 0.0,
            "wheel_angle": 0.5,
            **fields,
        }
    )


def thing(uid: int, x: float, name: str = "Bus", heading_deg: float = 0.0, size: Struct | None = None) -> Struct:
    return Struct(
        unique_id=uid,
        name=name,
        heading=heading_deg,
        velocity=vector(36.0),
        acceleration=vector(1.0),
        size=size or vector(2.0, 5.0, 3.0),
        position=vector(x, 1.0, 0.0),
    )


def reading(profile: Profile = MANUAL) -> RecordingBuilder:
    return RecordingBuilder("a", Converter(make_store(), profile))


def both(stamp_ns: int) -> tuple[int, int]:
    return stamp_ns, stamp_ns


def ego_at(recording: Recording, since: float, column: str = "x") -> float:
    return float(recording.moment(round(since * SECOND)).egos[0][EGO_COLUMNS.index(column)])


@pytest.mark.parametrize("factor", [DEGREES, MPS_TO_KMH])
def test_converted_values_are_restored_to_the_last_bit(factor: float) -> None:
    rng = np.random.Generator(np.random.PCG64(1))
    values = np.concatenate([rng.uniform(-math.pi, math.pi, 10_000), [math.pi, 0.0, -0.0, 1e-9]])
    products = values * factor
    assert (exact_quotient(products, factor) * factor == products).all()


@pytest.mark.parametrize("has_jump", [False, True])
def test_bag_in_simulated_time_ignores_wall_clock_headers(*, has_jump: bool) -> None:
    """The second is of a drive in which the time of day was chosen after its beginning."""
    day = 1_700_000_000 * SECOND
    builder = reading()
    for i in range(5):
        said = i * SECOND // 50 if has_jump and i < 2 else day + i * 1_000
        builder.take_ego(0, ego(float(i)), (said, i * SECOND // 50))
        builder.take_objects(
            Struct(npc_list=[thing(3, float(i))], pedestrian_list=[], obstacle_list=[]), (said, i * SECOND // 50)
        )
    recording = builder.finish()
    assert recording.duration_ns == 4 * SECOND // 50
    assert [ego_at(recording, 0.02 * i) for i in range(5)] == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_bag_in_wall_clock_time_uses_message_stamps() -> None:
    day = 1_700_000_000 * SECOND
    builder = reading()
    for i, came in enumerate([0.013, 0.021, 0.055]):
        builder.take_ego(0, ego(float(i)), (day + i * SECOND // 50, day + round(came * SECOND)))
    recording = builder.finish()
    assert recording.duration_ns == 2 * SECOND // 50


def test_values_between_stamps_are_interpolated() -> None:
    builder = reading()
    for i, (x, heading) in enumerate([(0.0, 170.0), (1.0, -170.0), (2.0, -170.0)]):
        builder.take_ego(0, ego(x, heading), both(SECOND + i * SECOND // 10))
    recording = builder.finish()
    assert recording.duration_ns == SECOND // 5
    assert ego_at(recording, 0.025) == 0.25
    assert ego_at(recording, 0.075, "yaw") == pytest.approx(math.radians(185.0))
    assert ego_at(recording, 0.1, "yaw") == math.radians(-170.0)
    assert ego_at(recording, 0.1, "yaw_rate") == pytest.approx(math.radians(200.0))
    assert ego_at(recording, 99.0) == 2.0


def test_jumps_and_gaps_are_not_interpolated() -> None:
    builder = reading()
    for x, stamp in ((0.0, 1.0), (500.0, 1.1), (501.0, 3.0), (502.0, 3.1)):
        builder.take_ego(0, ego(x), both(round(stamp * SECOND)))
    recording = builder.finish()
    assert [ego_at(recording, since) for since in (0.05, 0.1, 1.0, 2.05)] == [0.0, 500.0, 500.0, 501.5]


def test_objects_are_interpolated_until_they_leave() -> None:
    builder = reading()
    builder.take_ego(0, ego(0.0), both(SECOND))
    for i, xs in enumerate([{3: 0.0, 5: 7.0}, {5: 8.0, 9: 1.0}]):
        npcs = [thing(uid, x) for uid, x in xs.items()]
        builder.take_objects(
            Struct(npc_list=npcs, pedestrian_list=[], obstacle_list=[]), both(SECOND + i * SECOND // 10)
        )
    moment = builder.finish().moment(SECOND // 20)
    assert [actor.uid for actor in moment.actors] == [3, 5]
    assert moment.values[0].tolist() == [0.0, 7.5]
    assert moment.values[OBJECT_COLUMNS.index("speed")].tolist() == [10.0, 10.0]
    assert moment.actors[0].size == (5.0, 2.0, 3.0)
    assert moment.actors[0].kind is Kind.VEHICLE


def test_profile_gives_the_units() -> None:
    builder = reading(FIELD)
    builder.take_ego(0, ego(0.0, wheel_angle=90.0), both(1))
    builder.take_objects(Struct(npc_list=[thing(1, 0.0)]), both(1))
    moment = builder.finish().moment(0)
    assert moment.egos[0][EGO_COLUMNS.index("steer")] == pytest.approx(math.pi / 2)
    assert moment.actors[0].size == (2.0, 5.0, 3.0)


@pytest.mark.parametrize("profile", [MANUAL, FIELD])
def test_front_steer_angle_is_in_degrees(profile: Profile) -> None:
    builder = reading(profile)
    message = ego(0.0, front_steer_angle=90.0)
    del message.wheel_angle
    builder.take_ego(0, message, both(1))
    assert builder.finish().moment(0).egos[0][EGO_COLUMNS.index("steer")] == pytest.approx(math.pi / 2)


def test_header_stamps_are_used_if_they_increase() -> None:
    for said, duration in (([5, 6, 7], 2), ([0, 0, 0], 20), ([7, 6, 5], 20)):
        builder = reading()
        for stamp, came in zip(said, (10, 20, 30), strict=True):
            builder.take_ego(0, ego(0.0), (stamp, came))
        assert builder.finish().duration_ns == duration


def test_entries_are_sorted_by_time_and_repeated_stamps_dropped() -> None:
    builder = reading()
    for x, came in ((1.0, 30), (2.0, 10), (3.0, 30)):
        builder.take_ego(0, ego(x), (0, came))
        builder.take_objects(Struct(npc_list=[thing(1, x), thing(1, 99.0)]), (0, came))
    recording = builder.finish()
    assert recording.egos[0].values[0].tolist() == [2.0, 3.0]
    assert recording.objects is not None
    assert recording.objects.values[0].tolist() == [2.0, 3.0]


def test_invalid_numbers_are_left_out_and_noted() -> None:
    builder = reading()
    for i, x in enumerate((1.0, math.nan, 3.0)):
        builder.take_ego(0, ego(x), both(10 + i))
        builder.take_objects(Struct(npc_list=[thing(1, x), thing(2, 0.0, heading_deg=math.inf)]), both(10 + i))
    recording = builder.finish()
    assert recording.egos[0].values[0].tolist() == [1.0, 3.0]
    assert recording.objects is not None
    assert recording.objects.starts.tolist() == [0, 1, 1, 2]
    assert recording.notes == (
        "1 states of ego 0 are left out: their numbers are not finite, or out of range",
        "4 states of an object are left out: their numbers are not finite, or out of range",
    )


def test_recording_without_messages_is_empty() -> None:
    assert reading().finish().is_empty
    builder = reading()
    builder.take_ego(0, ego(math.nan), both(1))
    assert builder.finish().is_empty


def test_recording_is_held_by_nothing_after_its_digest_was_asked_for() -> None:
    builder = reading()
    builder.take_ego(0, ego(1.0), both(1))
    recording = builder.finish()
    assert recording.digest == recording.digest
    held = ref(recording)
    del recording
    assert held() is None


def test_recording_beyond_the_limit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded, "MAX_RECORDED_ENTRIES", 3)
    builder = reading()
    builder.take_objects(Struct(npc_list=[thing(1, 0.0)]), both(1))
    with pytest.raises(DocumentError, match="a: expected at most 3 states; cut it into shorter recordings"):
        builder.take_objects(Struct(npc_list=[thing(1, 0.0)]), both(2))


def test_random_recordings_agree_with_a_simple_reference() -> None:
    rng = np.random.Generator(np.random.PCG64(7))
    builder = reading()
    frames = [{uid: rng.uniform(-9, 9) for uid in range(6) if rng.random() < 0.5} for _ in range(30)]
    for i, xs in enumerate(frames):
        npcs = [thing(uid, x) for uid, x in xs.items()]
        if i % 2:
            npcs.reverse()
        builder.take_objects(Struct(npc_list=npcs), both((i + 1) * SECOND // 50))
    recording = builder.finish()
    for i, xs in enumerate(frames):
        moment = recording.moment(i * SECOND // 50)
        found = {actor.uid: x for actor, x in zip(moment.actors, moment.values[0].tolist(), strict=True)}
        assert found == xs
