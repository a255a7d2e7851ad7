"""The parameters of the master of ROS 1, mirrored in those of the bus.

So reading takes no time, and rosapi needs to know nothing of a master. A change on either side goes to the other one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final

import orjson

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.parameters import Parameters
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.ros1.ros1_graph import ROS1_GRAPH, is_name

MAX_DEPTH: Final = 100
"""Deepest nesting of a value."""

MAX_UNSENT: Final = 10_000
"""Most changes that wait for the master; the oldest is dropped, because the master has been away for long."""

_LARGEST: Final = 2**31
"""The integers of XML-RPC have 32 bits."""

_OF_ROSCORE: Final = frozenset({"/rosdistro", "/rosversion", "/run_id"})
"""Parameters that every roscore sets. This server sets them only at a master that lacks them."""


class MasterParameters(Participant):
    """The mirror.

    Attributes:
        name: stands for the name of a node.
        unsent: changes for the master, by name: the value, or None if it is deleted.
        on_change: called if there is one.
    """

    name = "/ros1"

    def __init__(self, parameters: Parameters) -> None:
        """Mirror nothing yet."""
        self.unsent: dict[str, Any] = {}
        self.on_change: Callable[[], None] = lambda: None
        self._parameters = parameters
        self._is_taking = False
        self._log = OnceLog(ROS1_GRAPH.logger)
        parameters.on_change = self._note

    def begin(self, tree: object) -> None:
        """Take all parameters of a master; what it lacks and the server has is to be set there.

        Args:
            tree: all values, nested by namespace.
        """
        own = {name: self._parameters.text(name) for name in self._parameters if name not in _OF_ROSCORE}
        self.take("/", tree)
        for name, text in own.items():
            if name not in self._parameters and is_name(name):
                self._parameters.put(name, text, self)

    def take(self, name: str, value: object) -> None:
        """Take a value of the master, or that it is deleted. A value that cannot be kept is told once.

        Args:
            name: absolute name.
            value: of XML-RPC; an empty namespace if it is deleted.
        """
        name = name.rstrip("/")
        self._is_taking = True
        try:
            gone = [name] if name in self._parameters else []
            self._parameters.remove(gone + self._parameters.below(f"{name}/"))
            for each, text in _flat(name, value, 0):
                self._parameters.put(each, text, self)
        except GraphError as error:
            self._log.tell(f"a parameter of the master is not seen here: {error}", key="unseen")
        finally:
            self._is_taking = False

    def _note(self, name: str, text: str | None) -> None:
        """Note a change on the bus; one that the master cannot have is refused."""
        if self._is_taking or not is_name(name):
            return
        value = None if text is None else orjson.loads(text)
        if text is not None:
            _check(name, value, 0)
        self.unsent[name] = value
        if len(self.unsent) > MAX_UNSENT:
            del self.unsent[next(iter(self.unsent))]
        self.on_change()


def _check(name: str, value: object, depth: int) -> None:
    """Raise GraphError for a value that XML-RPC cannot have."""
    if depth > MAX_DEPTH:
        raise GraphError(f"Parameter {name}: the value is nested too deeply for the master of ROS 1")
    if value is None or (isinstance(value, int) and not -_LARGEST <= value < _LARGEST):
        raise GraphError(f"Parameter {name}: the master of ROS 1 keeps no null and no integer beyond 32 bits")
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _check(name, part, depth + 1)


def _flat(name: str, value: object, depth: int) -> Iterator[tuple[str, str]]:
    """Yield name and JSON text of each value of a namespace.

    Raises:
        GraphError: it cannot be written as JSON.
    """
    if depth > MAX_DEPTH:
        raise GraphError(f"{name}: namespaces are nested too deeply")
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _flat(f"{name}/{key}", part, depth + 1)
        return
    try:
        yield name, orjson.dumps(value, default=str).decode()
    except orjson.JSONEncodeError as error:
        raise GraphError(f"{name}: {error}") from None
