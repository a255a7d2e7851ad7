"""The choices for our node of ROS 1 (its names, addresses and master), and the objects that all its parts use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rosbridge_sim.graph.gateway.gateway import Gateway
from rosbridge_sim.graph.gateway.node_services import NodeServices
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.ros1.ros1_graph import is_name
from rosbridge_sim.graph.ros1.ros1_types import Ros1Type, Ros1Types
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.records import Record
from rosbridge_sim.shell.ros1.xmlrpc_http import call


class Ros1Choices(Record):
    """The settings of the node.

    Attributes:
        master: URI of the master.
        name: full name of the node.
        namespace: stands before all names on the graph; empty, or absolute without a slash at its end.
        host: where the node listens.
        shown_host: host in its addresses, for other nodes.
        max_message_size: longest message of another node [bytes].
        room: for messages of all nodes that have not come whole yet.
    """

    master: str
    name: str
    namespace: str
    host: str
    shown_host: str
    max_message_size: int
    room: Account

    def there(self, name: str) -> str:
        """Return the name on the graph of a name on the bus."""
        return self.namespace + name

    def here(self, name: str) -> str:
        """Return the name on the bus of a name on the graph; empty if it is not in the namespace, or not valid."""
        short = name.removeprefix(self.namespace) if name.startswith(f"{self.namespace}/") else ""
        return short if is_name(short) else ""

    async def ask(self, method: str, *args: object) -> Any:  # noqa: ANN401 - any value of XML-RPC
        """Call the master.

        Raises:
            GraphError: it refuses, or cannot be reached.
        """
        return await call(self.master, method, self.name, *args, is_master=True)


@dataclass(frozen=True)
class Ros1Parts:
    """Objects that all parts of our node use. Topics and services have their names on the bus.

    Attributes:
        log: has each line once.
        gateway: moves messages.
        services: moves calls.
    """

    choices: Ros1Choices
    types: Ros1Types
    log: OnceLog
    gateway: Gateway[Ros1Type]
    services: NodeServices
