"""Quality of service of endpoints on the graph of ROS 2, as far as two endpoints must agree in it.

A subscription gets messages only from publishers that offer as much as it asks for: a reliable one gets nothing from a
best-effort publisher, one with `transient_local` gets nothing from a `volatile` publisher. So our publishers are
reliable, sensors included: rclpy's own default for a subscription is reliable, and it would miss the sensors otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Quality:
    """Quality of service of an endpoint.

    Attributes:
        is_reliable: lost messages are sent again.
        is_latched: late subscribers get the last messages (`transient_local`).
        depth: messages that are kept for a slow or late subscriber.
    """

    is_reliable: bool = True
    is_latched: bool = False
    depth: int = 10


PROFILES: Final[Mapping[str, Quality]] = {
    "default": Quality(),
    "sensor_data": Quality(is_reliable=False, depth=5),
    "latched": Quality(is_latched=True, depth=1),
}
"""Profiles by the names of ROS 2 (`rmw_qos_profile_sensor_data` and so on); `latched` is what a map has."""


def read_choice(text: str) -> tuple[str, Quality]:
    """Return the pattern of topics and the quality in a text such as `/camera*=sensor_data`.

    Args:
        text: pattern, `=`, and the name of a profile.

    Raises:
        ValueError: it is no such text.
    """
    pattern, _, name = text.rpartition("=")
    if not pattern or name not in PROFILES:
        raise ValueError(text)
    return pattern, PROFILES[name]


def why_unheard(offered: Quality, wanted: Quality) -> Sequence[str]:
    """Return in which points a publisher offers less than a subscription asks for; empty if they fit."""
    points = []
    if wanted.is_reliable and not offered.is_reliable:
        points.append("reliability: best_effort is offered, reliable is wanted")
    if wanted.is_latched and not offered.is_latched:
        points.append("durability: volatile is offered, transient_local is wanted")
    return points
