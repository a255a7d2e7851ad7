"""Reasons why a node of ROS 2 sees nothing of a server, found from what a program in the domain sees, in a fixed order.

The order is that in which the causes hide each other: domain, range, interface, quality of service,
hash of a type. The last step finds what is seen twice: a topic or a frame of the server that another program publishes,
too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, Literal

from rosbridge_sim.graph.gateway.finding import Finding, judge
from rosbridge_sim.graph.gateway.quality import Quality, why_unheard
from rosbridge_sim.graph.gateway.sentences import node_text
from rosbridge_sim.records import Record
from rosbridge_sim.suggestions import name_some

Discovery = Literal["localhost", "multicast"]
"""Range in which a program looks for others; see `--ros2-discovery`."""

MAX_DOMAIN: Final = 232
MAX_SHOWN: Final = 20
"""Most topics that are named for one step."""

ONE_TOO_MANY: Final = "give a second simulator another --ros2-domain, or a --ros2-namespace; end or rename any other"
"""Advice if two programs publish the same topic or frame, which may have one publisher only."""

_OVERRIDES: Final = (
    "CYCLONEDDS_URI",
    "FASTDDS_DEFAULT_PROFILES_FILE",
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "ROS_DISCOVERY_SERVER",
)
"""Variables that configure discovery beside the range."""

_RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"


class SeenEndpoint(Record):
    """A publisher or subscription in the domain.

    Attributes:
        topic: name on the graph of ROS 2.
        type: name of its type for DDS.
        is_writer: it publishes.
        quality: what it offers or asks for.
        hash: hash of the type; empty before Iron.
        node: full name of its node; empty if it has told none.
        program: GUID of its program, see `guid_text`.
        is_sole: it belongs to a server, and must be the only publisher of its topic.
    """

    topic: str
    type: str
    is_writer: bool
    quality: Quality
    hash: str
    node: str
    program: str = ""
    is_sole: bool = False

    @property
    def shown(self) -> str:
        """Text for its node in messages to the user."""
        return node_text(self.node, self.program)


class SeenGraph(Record):
    """A domain as a program in it sees it.

    Attributes:
        domain: number of the domain.
        found_by: how the server was found; None if it was not.
        server: full name of its node; empty if it was not found.
        endpoints: of all nodes, the server's included.
        other_domains: other domains with programs on this machine.
        why_no_loopback: the reason why loopback cannot be used; empty if it can.
        frames: names of the frames on `/tf` and `/tf_static` of the server, each with its publisher.
    """

    domain: int
    found_by: Discovery | None
    server: str
    endpoints: Sequence[SeenEndpoint]
    other_domains: Sequence[int]
    why_no_loopback: str
    frames: Sequence[tuple[str, SeenEndpoint]] = ()


def domain_of(environment: Mapping[str, str]) -> int | None:
    """Return the domain of nodes that are started with these variables; None if the number is not valid."""
    text = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    return int(text) if text.isascii() and text.isdecimal() and int(text) <= MAX_DOMAIN else None


def check_graph(seen: SeenGraph, environment: Mapping[str, str]) -> Sequence[Finding]:
    """Return the result of each step; the last steps are missing if the server was not found.

    Args:
        environment: variables with which the user's nodes are started.
    """
    findings = [_check_domain(seen, environment), _check_range(seen, environment), _check_interface(seen)]
    if seen.server:
        findings += [_check_quality(seen), _check_types(seen), _check_publishers(seen)]
    return findings


def _check_domain(seen: SeenGraph, environment: Mapping[str, str]) -> Finding:
    own = domain_of(environment)
    wrong, advice = "", f"export ROS_DOMAIN_ID={seen.domain}"
    if own is None:
        wrong = f"ROS_DOMAIN_ID is {environment['ROS_DOMAIN_ID']!r}: expected a number from 0 to {MAX_DOMAIN}"
    elif not seen.server:
        wrong, advice = f"no server is in domain {seen.domain}", f"rosbridge-sim serve --ros2-domain {seen.domain}"
        if seen.other_domains:
            others = ", ".join(map(str, seen.other_domains))
            advice = f"programs of this machine are in domain {others}: export ROS_DOMAIN_ID={seen.other_domains[0]}"
    elif own != seen.domain:
        wrong = f"the server is in domain {seen.domain}, your nodes would be in {own}"
    return judge("domain", wrong, advice, f"{seen.server} is in domain {seen.domain}")


def _check_range(seen: SeenGraph, environment: Mapping[str, str]) -> Finding:
    is_local, shown = _is_local(environment), _shown(environment)
    why, advice = _why_not_in_range(seen, environment)
    if why:
        return Finding("range", is_good=False, text=why, advice=advice)
    others = [name for name in _OVERRIDES if environment.get(name)]
    if others:
        text = f"{' and '.join(others)} may change where your nodes look ({shown})"
        return Finding("range", is_good=True, text=text, advice=f"if all else is ok: unset {' '.join(others)}")
    who = "your nodes" if seen.found_by is None else "your nodes and the server"
    place = "on this machine" if is_local else "in the network"
    return Finding("range", is_good=True, text=f"{who} look {place} ({shown})")


def _why_not_in_range(seen: SeenGraph, environment: Mapping[str, str]) -> tuple[str, str]:
    """Return why nodes and the server look in different places, and what to do; empty if they do not."""
    is_local, shown = _is_local(environment), _shown(environment)
    if environment.get("RMW_IMPLEMENTATION", "").startswith("rmw_zenoh"):
        text = f"RMW_IMPLEMENTATION is {environment['RMW_IMPLEMENTATION']}, which does not use DDS"
        return text, "export RMW_IMPLEMENTATION=rmw_fastrtps_cpp, or rmw_cyclonedds_cpp"
    if environment.get(_RANGE, "").strip().upper() == "OFF":
        return f"{_RANGE} is OFF: your nodes look for no others", f"export {_RANGE}=LOCALHOST"
    if seen.found_by == "localhost" and not is_local:
        text = f"the server is on loopback alone, and your nodes look for others in the network ({shown})"
        wanted = "ROS_LOCALHOST_ONLY=1" if environment.get("ROS_DISTRO") == "humble" else f"{_RANGE}=LOCALHOST"
        return text, f"export {wanted}"
    if seen.found_by == "multicast" and is_local:
        text = f"the server is in the network, and your nodes look for others on this machine alone ({shown})"
        return text, f"unset {_RANGE} ROS_LOCALHOST_ONLY"
    return "", ""


def _is_local(environment: Mapping[str, str]) -> bool:
    """Return whether nodes look for others on loopback; they also do so for a static peer there."""
    peers = environment.get("ROS_STATIC_PEERS", "").replace(",", ";").split(";")
    return (
        environment.get(_RANGE, "").strip().upper() == "LOCALHOST"
        or environment.get("ROS_LOCALHOST_ONLY", "").strip() == "1"
        or any(peer.strip() in {"127.0.0.1", "localhost"} for peer in peers)
    )


def _shown(environment: Mapping[str, str]) -> str:
    names = (_RANGE, "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")
    return ", ".join(f"{name}={environment[name]}" for name in names if name in environment) or f"{_RANGE} is not set"


def _check_interface(seen: SeenGraph) -> Finding:
    if seen.why_no_loopback:
        text = f"loopback cannot be used: {seen.why_no_loopback}"
        return Finding("interface", is_good=False, text=text, advice="ip link set lo up")
    if not seen.server:
        text = "loopback is up. A container has a loopback of its own"
        return Finding("interface", is_good=True, text=text, advice="run both in one, or with --network host")
    place = "loopback" if seen.found_by == "localhost" else "an interface with multicast"
    return Finding("interface", is_good=True, text=f"the server answers over {place}")


def _check_quality(seen: SeenGraph) -> Finding:
    misfits = [
        f"{writer.topic} from {writer.shown} to {reader.shown}: {'; '.join(why)}"
        for writer, reader in _pairs(seen)
        if writer.type == reader.type and (why := why_unheard(writer.quality, reader.quality))
    ]
    num = sum(1 for _ in _pairs(seen))
    advice = "have the subscription ask for less (qos_profile_sensor_data), or see --ros2-qos of the server"
    good = f"all {num} pairs of publisher and subscription with the server fit"
    if not num:
        good = "no other node publishes or subscribes to a topic of the server"
    return judge("quality of service", _list(misfits), advice, good)


def _check_types(seen: SeenGraph) -> Finding:
    misfits = []
    for writer, reader in _pairs(seen):
        if writer.type != reader.type:
            misfits.append(f"{writer.topic}: {writer.shown} has {writer.type}, {reader.shown} has {reader.type}")
        elif writer.hash and reader.hash and writer.hash != reader.hash:
            misfits.append(
                f"{writer.topic}: the definitions of {writer.type} differ in {writer.shown} and {reader.shown}"
            )
    advice = "build the package of the server's --release (rosbridge-sim schema show TYPE), or use --schema-path"
    if any("/Twist" in line.replace("::msg::dds_::", "/") for line in misfits):
        advice = "--cmd-vel TwistStamped of the server, or enable_stamped_cmd_vel: false of Nav2"
    return judge("type hash", _list(misfits), advice, "types and their hashes agree")


def _check_publishers(seen: SeenGraph) -> Finding:
    sole = {one.topic for one in seen.endpoints if one.is_writer and one.is_sole}
    topics = [(one.topic, one.shown) for one in seen.endpoints if one.is_writer and one.topic in sole]
    served = {name for name, writer in seen.frames if writer.node == seen.server}
    frames = [(name, writer.shown) for name, writer in seen.frames if name in served]
    lines = [*_clashes("", topics), *_clashes("frame ", frames)]
    good = "no other program publishes a topic or a frame of the server"
    return judge("publishers", _list(lines), ONE_TOO_MANY, good)


def _clashes(what: str, published: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield a line for each set of programs that publish the same things, of which each may have one publisher.

    Args:
        what: stands before the names.
        published: name of a thing, and the program that publishes it.
    """
    programs_of: dict[str, list[str]] = {}
    for name, program in sorted(set(published), key=lambda one: (not one[0].endswith("/clock"), one)):
        programs_of.setdefault(name, []).append(program)
    same: dict[tuple[str, ...], list[str]] = {}
    for name, programs in programs_of.items():
        same.setdefault(tuple(programs), []).append(name)
    for together, names in same.items():
        if len(together) > 1:
            number = "two" if len(together) == 2 else str(len(together))  # noqa: PLR2004 - a word
            yield f"{number} publish {what}{name_some(names)}: {' and '.join(together)}"


def _pairs(seen: SeenGraph) -> Iterator[tuple[SeenEndpoint, SeenEndpoint]]:
    """Return each publisher and subscription of one topic, of which one is the server's."""
    readers: dict[str, list[SeenEndpoint]] = {}
    for endpoint in seen.endpoints:
        if not endpoint.is_writer:
            readers.setdefault(endpoint.topic, []).append(endpoint)
    for writer in seen.endpoints:
        for reader in readers.get(writer.topic, ()) if writer.is_writer else ():
            if (writer.node == seen.server) is not (reader.node == seen.server):
                yield writer, reader


def _list(lines: Sequence[str]) -> str:
    more = len(lines) - MAX_SHOWN
    return "\n".join([*lines[:MAX_SHOWN], *([f"and {more} more"] if more > 0 else [])])
