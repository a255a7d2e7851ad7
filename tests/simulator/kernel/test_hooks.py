"""Functions of a moment: in their order, and not called while they rest."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from rosbridge_sim.simulator.kernel.hooks import Moment
from tests.simulator.sim_harness import SimHarness


def test_function_that_rests_is_not_called_and_wakes_in_its_place() -> None:
    seen: list[str] = []
    moment = Moment[Callable[[], object]]()
    one, two, three = (partial(seen.append, name) for name in ("one", "two", "three"))
    for act in (one, two, three):
        moment.append(act)

    def called() -> list[str]:
        seen.clear()
        for act in moment.awake:
            act()
        return list(seen)

    assert called() == ["one", "two", "three"]
    moment.rest(two)
    moment.rest(two)
    moment.rest(one)
    assert called() == ["three"]
    moment.wake(two)
    assert called() == ["two", "three"]
    moment.remove(three)
    moment.wake(one)
    assert called() == ["one", "two"]


def names_of(moment: Moment[Callable[[float], object]]) -> list[str]:
    """Names of the functions that are called, with those of their classes."""
    return [act.__qualname__ for act in moment.awake]


def test_components_with_nothing_to_do_are_not_called_in_a_frame() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start()
    client.tick()
    hooks = harness.node.context.hooks
    assert not hooks.place.awake
    assert not hooks.after_move.awake
    assert not hooks.after_frame.awake
    client.listen("/sim/collisions", "/sim/state_hash")
    client.tick()
    assert names_of(hooks.after_frame) == ["Contacts._after_frame", "Snapshots._publish_hash"]
