"""Calls that wait for a provider are found by their ids, and ended ones do not stay for ever."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from rosbridge_sim.graph.peers.pending_work import MIN_TIDY, PendingWork, find_awaited


@dataclass(eq=False)
class Job:
    """A call or a goal."""

    is_done: bool = False


def give(spelling: str, *jobs: Job) -> PendingWork[Job]:
    pending = PendingWork[Job]("service_request", spelling)
    for job in jobs:
        pending.add(job)
    return pending


def test_ids_have_the_spelling_and_a_number_of_their_own() -> None:
    pending = give("s")
    assert [pending.add(Job()) for _ in range(2)] == ["service_request:s:1", "service_request:s:2"]
    assert pending.num_given == 2


def test_work_is_taken_out_once_and_an_id_that_is_no_text_finds_none() -> None:
    job = Job()
    pending = give("s", job)
    for stray in (None, 1, True, 1.5, "service_request:s:2", ""):
        assert pending.get(stray) is pending.pop(stray) is None
    assert pending.get("service_request:s:1") is job
    assert pending.pop("service_request:s:1") is job
    assert pending.pop("service_request:s:1") is None


def test_ended_work_is_forgotten_when_it_is_much_and_the_rest_stays() -> None:
    kept = Job()
    pending = give("s", kept)
    assert pending.tidy()
    for _ in range(3 * MIN_TIDY):
        pending.tidy()
        pending.add(Job(is_done=True))
        assert len(dict(pending.items())) <= MIN_TIDY + 1
    assert list(pending.awaited()) == [kept]
    assert pending.get("service_request:s:1") is kept


@pytest.mark.parametrize("spelling", ["s", "/s"])
def test_work_is_found_by_its_id_however_its_service_is_spelled(spelling: str) -> None:
    job = Job()
    offers = {"/r": give("r", Job()), "/s": give(spelling, Job(), job)}
    assert find_awaited(offers, f"service_request:{spelling}:2") is job
    assert find_awaited(offers, f"service_request:{spelling}:3") is None
    assert find_awaited(offers, "service_request:/other:1") is None
    assert find_awaited(offers, "rubbish") is None


def test_without_an_id_only_work_that_waits_alone_is_meant() -> None:
    first, second = Job(), Job()
    offers = {"/r": give("r", first), "/s": give("s", second, Job(is_done=True))}
    assert find_awaited(offers, None) is None
    first.is_done = True
    assert find_awaited(offers, None) is second
    second.is_done = True
    assert find_awaited(offers, None) is None
    assert find_awaited({}, None) is None
