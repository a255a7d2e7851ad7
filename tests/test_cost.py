"""Fixed workloads cost no more than they did, as multiples of a reference loop; see `scripts/bench/guard.py`."""

from __future__ import annotations

import json

import pytest

from scripts.bench import guard

FIGURES = guard.read_figures(guard.processor())


def test_every_workload_has_a_figure_on_each_kind_of_processor() -> None:
    for figures in json.loads(guard.FIGURES.read_text()).values():
        assert set(figures) == set(guard.WORKLOADS)


def test_processor_without_figures_has_the_highest_of_all() -> None:
    unknown, known = guard.read_figures("unknown"), json.loads(guard.FIGURES.read_text())
    assert unknown["tick"] == max(figures["tick"] for figures in known.values())
    assert guard.read_figures("AuthenticAMD") == known["AuthenticAMD"]


def test_dear_work_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def thrice() -> guard.Work:
        def work() -> None:
            guard.reference()
            guard.reference()
            guard.reference()

        return work

    monkeypatch.setitem(guard.WORKLOADS, "three", thrice)
    (_, is_good), (_, is_dear_good) = (guard.judge("three", figure, rounds=8, tries=2) for figure in (4.0, 1.5))
    assert is_good
    assert not is_dear_good


@pytest.mark.long
@pytest.mark.parametrize("name", guard.WORKLOADS)
def test_workload_is_no_dearer(name: str) -> None:
    cost, is_good = guard.judge(name, FIGURES[name])
    assert is_good, f"{cost:.4f} times the reference loop, {FIGURES[name]:.4f} before; see scripts/bench/guard.py"
