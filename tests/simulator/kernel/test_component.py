"""A component of a few lines: what it is given, and at which moments it is called."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from tests.simulator.sim_harness import ALL, Client, SimHarness, put_egos


class Witness:
    """Notes what has happened at which frame; it needs the context alone."""

    def __init__(self, context: SimulatorContext) -> None:
        self.seen: list[tuple[str, int]] = []
        self._context = context
        hooks = context.hooks
        hooks.place.append(lambda: self._note("place"))
        hooks.after_frame.append(lambda _now: self._note("after_frame"))
        hooks.after_move.append(lambda _now: self._note("after_move"))
        hooks.on_mode_change.append(lambda _now: self._note("on_mode_change"))
        hooks.on_scene_change.append(lambda _now: self._note("on_scene_change"))
        hooks.on_reset.append(lambda: self._note("on_reset"))
        hooks.on_new_ego.append(lambda ego, bindings: self._note(f"on_new_ego {ego.index} {bindings.prefix}"))
        hooks.on_leave.append(self._on_leave)

    def _on_leave(self, participant: Participant, _now: float) -> None:
        self._note(f"on_leave {participant.name}")

    def _note(self, what: str) -> None:
        self.seen.append((what, self._context.world.frame))


def in_sync() -> tuple[SimHarness, Client, Witness]:
    harness = SimHarness(start="sync")
    witness = Witness(harness.node.context)
    client = harness.client()
    client.start(time_step=40)
    return harness, client, witness


def test_tick_calls_hooks_frame_by_frame() -> None:
    _, client, witness = in_sync()
    assert witness.seen == [("on_mode_change", 0)]
    witness.seen.clear()
    client.tick()
    frames = [("place", 0), ("after_frame", 1), ("place", 1), ("after_frame", 2)]
    assert witness.seen == [*frames, ("after_move", 2)]


def test_real_time_calls_the_same_hooks() -> None:
    harness = SimHarness()
    witness = Witness(harness.node.context)
    harness.run(0.021)
    assert [what for what, _ in witness.seen if what != "after_move"] == ["place", "after_frame"]
    assert witness.seen[-1] == ("after_move", 1)


def test_refused_tick_calls_no_hook() -> None:
    _, client, witness = in_sync()
    witness.seen.clear()
    client.tick("somebody else")
    assert witness.seen == []


def test_pause_and_departure_of_the_master_change_the_mode() -> None:
    harness, client, witness = in_sync()
    witness.seen.clear()
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    client.leave()
    assert witness.seen == [("on_mode_change", 0), (f"on_leave {client.name}", 0), ("on_mode_change", 0)]
    assert harness.node.sync.master_id == ""


def test_load_reset_and_new_ego_call_their_hooks() -> None:
    _, client, witness = in_sync()
    client.tick()
    witness.seen.clear()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    client.send("/ScenarioLoad", "morai_msgs/ScenarioLoad", file_name="parked", **ALL)
    client.call("/sim/reset", {"seed": -1})
    assert witness.seen == [
        ("on_new_ego 5 /Ego-5/", 2),
        ("on_scene_change", 2),
        ("on_scene_change", 2),
        ("on_reset", 0),
    ]


def test_act_for_one_frame_is_done_once_and_before_those_of_every_frame() -> None:
    harness, client, witness = in_sync()
    witness.seen.clear()
    harness.node.context.hooks.once_after_frame.append(lambda _now: witness.seen.append(("once", 0)))
    client.tick()
    assert [what for what, _ in witness.seen] == ["place", "once", "after_frame", "place", "after_frame", "after_move"]


def test_context_cannot_be_changed() -> None:
    context = SimHarness().node.context
    with pytest.raises(AttributeError):
        context.world = None  # type: ignore[misc, assignment] # the claim
