"""The graph as the master of ROS 1 tells it: publishers, providers of services, and our own registrations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

from rosbridge_sim.errors import GraphError
from rosbridge_sim.records import Record

Kind: TypeAlias = Literal["Publisher", "Subscriber", "Service"]
"""Kinds of registrations, by the words of the master's methods."""


class Registration(NamedTuple):
    """Something that a node has registered, by its name on the graph."""

    kind: Kind
    name: str


class MasterView(Record):
    """The graph as the master knows it.

    Attributes:
        nodes: registration -> names of the nodes that have it.
        types: topic -> name of its type, `*` if the master knows none.
    """

    nodes: Mapping[Registration, Sequence[str]]
    types: Mapping[str, str]

    def names(self) -> set[str]:
        """Return the names of all nodes on the graph."""
        return {node for nodes in self.nodes.values() for node in nodes}

    def of(self, node: str) -> set[Registration]:
        """Return the registrations of a node."""
        return {one for one, nodes in self.nodes.items() if node in nodes}

    def others(self, kind: Kind, node: str) -> Iterator[tuple[str, str]]:
        """Yield name and node of each registration of a kind that another node has.

        Args:
            node: the node that is left out.
        """
        for one, nodes in self.nodes.items():
            if one.kind == kind:
                yield from ((one.name, other) for other in nodes if other != node)


def read_view(state: Any, types: Any) -> MasterView:  # noqa: ANN401 - what another program sent
    """Return the view that the master's answers give.

    Args:
        state: of `getSystemState`: publishers, subscribers and services, each a list of `[name, [nodes]]`.
        types: of `getTopicTypes`: a list of `[topic, type]`.

    Raises:
        GraphError: they have another form.
    """
    kinds: tuple[Kind, ...] = ("Publisher", "Subscriber", "Service")
    try:
        nodes = {
            Registration(kind, str(name)): [str(node) for node in owners]
            for kind, listed in zip(kinds, state, strict=True)
            for name, owners in listed
        }
        return MasterView(nodes, {str(topic): str(name) for topic, name in types})
    except (TypeError, ValueError):
        raise GraphError("the master answered in a form that no master of ROS 1 has") from None
