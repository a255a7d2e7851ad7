"""Reasons why a node of ROS 1 sees nothing of a server, in the order in which they hide each other.

The steps: master, server, address, this terminal's own name, types of topics, publishers, clock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rosbridge_sim.graph.gateway.finding import Finding, judge
from rosbridge_sim.graph.ros1.master_view import MasterView, Registration
from rosbridge_sim.graph.ros1.ros1_graph import ONE_TOO_MANY
from rosbridge_sim.records import Record
from rosbridge_sim.suggestions import name_some

CLOCK = "/clock"


class SeenMaster(Record):
    """A graph of ROS 1 as a program in this terminal sees it.

    Attributes:
        uri: of the master; empty if the terminal names none.
        why_no_master: why it cannot be used; empty if it can.
        view: what the master says; None if it cannot be used.
        server: name of the server's node.
        server_uri: its address; empty if the master knows no such node.
        why_no_server: why it cannot be reached there; empty if it can.
        topics: topic -> type of what the server publishes and subscribes to.
        uses_sim_time: `/use_sim_time` is true.
        why_no_name: why nodes of this terminal cannot be reached by their own name; empty if they can.
    """

    uri: str
    why_no_master: str = ""
    view: MasterView | None = None
    server: str = ""
    server_uri: str = ""
    why_no_server: str = ""
    topics: Mapping[str, str] = {}
    uses_sim_time: bool = False
    why_no_name: str = ""


def check_master(seen: SeenMaster) -> Sequence[Finding]:
    """Return the result of each step; the last steps are missing if an earlier one hides them."""
    if seen.view is None:
        advice = "start roscore, or export ROS_MASTER_URI=http://HOST:11311 with the host where it runs"
        return [Finding("master", is_good=False, text=seen.why_no_master, advice=advice)]
    findings = [Finding("master", is_good=True, text=f"{seen.uri} answers")]
    if not seen.server_uri:
        text = f"no node {seen.server} is on the graph"
        advice = f"start the server with --ros1-master {seen.uri}, or name its node: --name"
        return [*findings, Finding("server", is_good=False, text=text, advice=advice)]
    findings.append(Finding("server", is_good=True, text=f"{seen.server} is on the graph"))
    if seen.why_no_server:
        text = f"the server cannot be reached at {seen.server_uri}: {seen.why_no_server}"
        advice = "run your nodes on the machine of the server, or start it with --ros1-host 0.0.0.0 (and ROS_IP)"
        return [*findings, Finding("address", is_good=False, text=text, advice=advice)]
    findings.append(Finding("address", is_good=True, text=f"the server answers at {seen.server_uri}"))
    return [*findings, _check_name(seen), _check_types(seen, seen.view), *_check_publishers(seen, seen.view)]


def _check_name(seen: SeenMaster) -> Finding:
    advice = "export ROS_HOSTNAME=localhost if all runs on this machine, else ROS_IP with its address"
    return judge("own name", seen.why_no_name, advice, "the name of nodes in this terminal can be found")


def _check_types(seen: SeenMaster, view: MasterView) -> Finding:
    misfits = [
        f"{topic}: the server has {type_name}, other nodes {view.types[topic]}"
        for topic, type_name in sorted(seen.topics.items())
        if view.types.get(topic, "*") not in {"*", type_name}
    ]
    advice = "give one of them another name; --ros1-topics or [publishers] of the server can do it"
    good = "types agree by name; a definition that differs (md5 sum) is in the log of the server"
    return judge("types", "\n".join(misfits[:20]), advice, good)


def _check_publishers(seen: SeenMaster, view: MasterView) -> Sequence[Finding]:
    published = {one.name: nodes for one, nodes in view.nodes.items() if one.kind == "Publisher"}
    clocks = published.get(CLOCK, ())
    wrong = advice = ""
    if len(clocks) > 1:
        wrong, advice = f"{' and '.join(clocks)} publish /clock", ONE_TOO_MANY
    elif seen.uses_sim_time and not clocks:
        wrong = "/use_sim_time is true, and no node publishes /clock, so the time of nodes stands"
        advice = "rosparam set /use_sim_time false, or start a simulator"
    kind = "simulated time, of /clock" if seen.uses_sim_time else "the time of day; /use_sim_time is not true"
    first = judge("clock", wrong, advice, f"nodes use {kind}")
    services = [one.name for one, nodes in view.nodes.items() if one.kind == "Service" and seen.server in nodes]
    topics = [name for name, nodes in published.items() if seen.server in nodes]
    other = [one for one in topics if set(view.nodes.get(Registration("Subscriber", one), ())) - {seen.server}]
    text = (
        f"{len(topics)} topics and {len(services)} services of the server; subscribed to: {name_some(other) or 'none'}"
    )
    return [first, Finding("what is there", is_good=True, text=text)]
