"""The commands about the graph of a rosbridge: `rosbridge-sim node`, `param` and `action`."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING

from rosbridge_sim.cli.bridge_flags import add_bridge, add_count, add_types, bridge_group, take_type, with_bridge
from rosbridge_sim.cli.command_line import LazyTool, Options, run_command
from rosbridge_sim.cli.tools.text import read_body
from rosbridge_sim.errors import SettingError

if TYPE_CHECKING:
    from rosbridge_sim.cli.tools import action, node, param
    from rosbridge_sim.cli.tools.tool_client import Bridge
else:
    action, node, param = map(LazyTool, ("action", "node", "param"))


def run_node(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim node`."""
    alone = "a rosbridge cannot reach a single node"
    absent = {
        "ping": f"{alone}; rosbridge-sim wait tells if the rosbridge answers",
        "kill": f"{alone}; end the program itself",
        "cleanup": "a client that has gone leaves nothing behind",
        "machine": f"{alone} or tell its machine; the topic /sim/clients has the addresses of this server's clients",
    }
    text = "Nodes of a rosbridge, as rosapi lists them: all clients of a rosbridge are one node."
    group, _, row = bridge_group("node", text, absent)

    parser = row(
        "list",
        lambda bridge, o: node.list_nodes(bridge, is_count=o.is_count, is_json=o.json),
        "list all nodes",
    )
    parser.add_argument("-a", "--all", action="store_true", help="the same: rosapi lists no hidden nodes")
    add_count(parser, "nodes")
    row(
        "info",
        lambda bridge, o: node.show_node(bridge, o.node, is_json=o.json),
        "show topics and services of a node",
        "NODE",
    )
    return run_command(group, argv)


# param


def run_param(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim param`."""
    text = "Parameters of a rosbridge. NAME is /ns/x (ROS 1) or /node:x (ROS 2); a node may stand before it."
    absent = {"load": "a rosbridge reads no files; rosbridge-sim param set sets one value"}
    group, add, row = bridge_group("param", text, absent)

    parser = row(
        "list",
        lambda bridge, o: param.list_parameters(bridge, o.inner, is_json=o.json),
        "list all parameters",
    )
    parser.add_argument("inner", metavar="NODE|NAMESPACE", nargs="?", default="", help="of this one alone [all]")

    def get(bridge: Bridge, o: Options) -> Awaitable[int]:
        return param.get(bridge, o.words, is_bare=o.hide_type, is_json=o.json)

    def set_value(bridge: Bridge, o: Options) -> Awaitable[int]:
        return param.set_value(bridge, o.words, o.value, is_json=o.json)

    def delete(bridge: Bridge, o: Options) -> Awaitable[int]:
        return param.delete(bridge, o.words, is_json=o.json)

    for name, work, words, text in (
        ("get", get, "[NODE] NAME", "print a parameter's value"),
        ("set", set_value, "[NODE] NAME VALUE", "set a parameter to a value, in JSON or YAML"),
        ("delete", delete, "[NODE] NAME", "delete a parameter, or a namespace of ROS 1"),
    ):
        parser = add(name, _with_words(work, words), text)
        parser.add_argument("words", metavar=words, nargs="*")
        if name == "get":
            parser.add_argument("--hide-type", action="store_true", help="print the value alone, also behind a node")
        add_bridge(parser)

    parser = row(
        "describe",
        lambda bridge, o: param.describe(bridge, o.node, o.names, is_json=o.json),
        "show type and constraints of a node's parameters (ROS 2)",
        "NODE",
    )
    parser.add_argument("names", metavar="NAME", nargs="+")
    parser = row("dump", lambda bridge, o: param.dump(bridge, o.inner, is_json=o.json), "print all values as YAML")
    parser.add_argument("inner", metavar="NODE|NAMESPACE", nargs="?", default="", help="of this one alone [all]")
    return run_command(group, argv)


def _with_words(work: Callable[[Bridge, Options], Awaitable[int]], words: str) -> Callable[[Options], int]:
    """Return the function that runs a command with these words: a name, or a node and a name, and perhaps a value."""

    def run(options: Options) -> int:
        number, most = len(options.words), len(words.split())
        if not most - 1 <= number <= most:
            name = f"param {options.command}"
            raise SettingError(f"{name}: expected {words}; got {number} words; see rosbridge-sim {name} --help")
        options.value = read_body(options.words.pop(), "VALUE") if words.endswith("VALUE") else None
        return with_bridge(options, lambda bridge: work(bridge, options))

    return run


# action


def run_action(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim action`."""
    group, add, row = bridge_group("action", "Actions of a rosbridge: list, show, and send goals.")

    parser = row(
        "list",
        lambda bridge, o: action.list_actions(bridge, has_types=o.types, is_count=o.is_count, is_json=o.json),
        "list all actions",
    )
    add_types(parser)
    add_count(parser, "actions")
    parser = row(
        "info",
        lambda bridge, o: action.show_action(bridge, o.name, has_types=o.types, is_json=o.json),
        "show the nodes of an action",
        "NAME",
    )
    add_types(parser)
    row(
        "type",
        lambda bridge, o: action.show_action_type(bridge, o.name, is_json=o.json),
        "print the type of an action",
        "NAME",
    )

    parser = add("send_goal", _send_goal, "send a goal, and wait for its result; Ctrl-C cancels it")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument(
        "words", metavar="[TYPE] GOAL", nargs="*", help="the goal is JSON or YAML; fields may be left out"
    )
    parser.add_argument("-f", "--feedback", action="store_true", help="print the feedback, too")
    add_bridge(parser)
    return run_command(group, argv)


def _send_goal(options: Options) -> int:
    kind = take_type(options.words)
    goal = read_body(" ".join(options.words) or "{}", "GOAL")
    if not isinstance(goal, dict):
        raise SettingError(f"GOAL: expected an object such as '{{order: 5}}'; got {goal!r}")
    return with_bridge(
        options,
        lambda bridge: action.send_goal(
            bridge, options.name, kind, goal, has_feedback=options.feedback, is_json=options.json
        ),
    )
