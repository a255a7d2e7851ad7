"""Watch a rosbridge or a bag for a while: which topics and services there are, and what the messages are."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress

from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, words
from rosbridge_sim.cli.tools.topic import types_of_topics
from rosbridge_sim.contracts.seen_system import SeenTopic
from rosbridge_sim.link.bridge_errors import BridgeError, RefusedError

MAX_WATCHED = 1_000
"""Most topics that are watched at a time."""

MAX_SAID = 20
"""Different errors of the server that are printed."""

OF_THE_SERVER = (
    *("/rosout*", "/parameter_events", "/client_count", "/connected_clients", "/rosapi/*", "/rosapi_params/*"),
    *("*/get_loggers", "*/set_logger_level", "*/*_parameters", "*/*_parameters_atomically", "*/get_parameter_types"),
    *("*/get_type_description", "*/get_logger_levels", "*/set_logger_levels", "/sim/clients", "/sim/topics"),
    *("/sim/refusals", "/mock/*"),
)
"""Topics and services of ROS itself, or about the clients. They are left out unless a pattern selects them."""


def chosen(names: Iterable[str], patterns: Sequence[str], never: Sequence[str] = ()) -> list[str]:
    """Return the names that patterns select, sorted; without patterns all but `OF_THE_SERVER`.

    Args:
        never: patterns of names that are not selected in any case.
    """

    def fits(name: str, some: Iterable[str]) -> bool:
        return any(fnmatch.fnmatchcase(name, pattern) for pattern in some)

    wanted = [absolute(pattern) for pattern in patterns]
    return sorted(
        name
        for name in names
        if (fits(name, wanted) if wanted else not fits(name, OF_THE_SERVER)) and not fits(name, never)
    )


async def types_if_told(bridge: Bridge) -> dict[str, str] | None:
    """Return topic -> type of all topics; None if there is no rosapi."""
    with suppress(BridgeError, RefusedError):
        return {absolute(name): kind for name, kind in (await types_of_topics(bridge)).items()}
    note("rosapi does not answer: the types of topics and services are not known")
    return None


async def services_if_told(
    bridge: Bridge, patterns: Sequence[str], never: Sequence[str] = (), typed: Collection[str] | None = None
) -> dict[str, str] | None:
    """Return service -> type of the services that patterns select, see `chosen`; None if there is no rosapi.

    Args:
        typed: services whose types are asked for, others have none; None means all.

    Raises:
        RefusedError: there are too many.
    """
    try:
        names = chosen(map(absolute, words(await bridge.ask("services"), "services")), patterns, never)
    except (BridgeError, RefusedError):
        return None
    asked = [name for name in names if typed is None or name in typed]
    if len(asked) > MAX_WATCHED:
        raise RefusedError(f"{len(asked):,} services, expected at most {MAX_WATCHED:,}; --service selects some")
    answers = await bridge.ask_all([("service_type", {"service": name}) for name in asked])
    return dict.fromkeys(names, "") | {name: one.word("type") for name, one in zip(asked, answers, strict=True)}


Take = Callable[[str, float, Frame], None]
"""Takes topic, time [s] and message of each message that comes."""


async def watch_topics(
    bridge: Bridge, types: Mapping[str, str], seconds: float, take: Take | None = None
) -> dict[str, SeenTopic]:
    """Return what came on topics within a time.

    Args:
        types: topic -> its type; an empty one is that of an existing topic.
        seconds: how long [s].
        take: also gets each message.

    Raises:
        RefusedError: there are too many topics, or the connection has ended.
    """
    if len(types) > MAX_WATCHED:
        raise RefusedError(f"{len(types):,} topics, expected at most {MAX_WATCHED:,}; --topic selects some")
    seen = {topic: SeenTopic() for topic in types}
    note(f"watching {len(types)} topic{'s' * (len(types) != 1)} for {seconds:g} s")
    until = bridge.now() + seconds
    for topic, kind in types.items():
        await bridge.send("subscribe", topic=topic, **({"type": kind} if kind else {}))
    said: set[str] = set()
    while (frame := await bridge.receive(until)) is not None:
        message = frame.get("msg")
        name = absolute(str(frame.get("topic"))) if frame.get("op") == "publish" else ""
        if name in seen and isinstance(message, dict):
            seen[name].add(bridge.now(), message)
            if take is not None:
                take(name, bridge.now(), message)
        elif frame.get("op") == "status" and frame.get("level") == "error" and len(said) < MAX_SAID:
            if str(message) not in said:
                note(f"the server says: {message}")
            said.add(str(message))
        if bridge.now() >= until:  # more came than can be read
            break
    for topic in types:
        await bridge.send("unsubscribe", topic=topic)
    return seen
