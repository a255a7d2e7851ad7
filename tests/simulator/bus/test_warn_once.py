"""Each text once for each client, until the client leaves."""

from __future__ import annotations

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.simulator.bus.warn_once import WarnOnce


class Listener(Participant):
    def __init__(self) -> None:
        self.name = "/listener"
        self.told: list[tuple[str, str]] = []

    def notify(self, level: str, text: str) -> None:
        self.told.append((level, text))


def test_each_text_is_told_once_to_each_client() -> None:
    warnings, one, other = WarnOnce(), Listener(), Listener()
    for _ in range(3):
        warnings.warn(one, "a")
        warnings.warn(one, "b")
    warnings.warn(other, "a")
    assert one.told == [("warning", "a"), ("warning", "b")]
    assert other.told == [("warning", "a")]


def test_client_that_has_left_takes_no_memory_and_is_warned_anew() -> None:
    warnings, client = WarnOnce(), Listener()
    warnings.warn(client, "a")
    warnings.forget(client)
    assert len(warnings) == 0
    warnings.forget(client)
    warnings.warn(client, "a")
    assert client.told == [("warning", "a")] * 2
