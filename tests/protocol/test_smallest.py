"""The smallest of numbers that come and go."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.protocol.smallest import Smallest


@given(st.lists(st.tuples(st.integers(0, 40), st.booleans()), max_size=200))
def test_any_order_of_changes_gives_the_smallest_present_number(changes: list[tuple[int, bool]]) -> None:
    bag, there = Smallest(), Counter[int]()
    for number, is_coming in changes:
        if is_coming:
            bag.add(number)
            there[number] += 1
        elif there[number]:
            bag.remove(number)
            there[number] -= 1
        assert bag.get() == min(+there, default=None)
    bag.remove_all(there.elements())
    assert bag.get() is None


class _Counted(float):
    """A number that counts how often it is compared."""

    num_compared = 0

    __hash__ = float.__hash__

    def __lt__(self, other: float) -> bool:
        _Counted.num_compared += 1
        return super().__lt__(other)


def test_the_cost_of_a_change_does_not_grow_with_the_numbers() -> None:
    bag = Smallest()
    numbers = [_Counted(i) for i in range(2_000)]
    for number in numbers:
        bag.add(number)
    _Counted.num_compared = 0
    for number in numbers:  # the smallest one each time
        bag.remove(number)
        bag.get()
    assert _Counted.num_compared < 2_000 * 40  # a few logarithms; all of them each time would be 2,000,000


def test_removed_numbers_are_not_kept() -> None:
    bag = Smallest()
    bag.add(0.0)  # stays, and so nothing above it comes to the top
    for number in range(1, 1_000):
        bag.add(number)
        bag.remove(number)
    assert len(bag._heap) < 30
