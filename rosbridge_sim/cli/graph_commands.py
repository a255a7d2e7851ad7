"""The commands about the graph of a rosbridge: `rosbridge-sim node`, `param` and `action`."""

from __future__ import annotations

from rosbridge_sim.cli.bridge_flags import add_bridge, add_count, add_types, bridge_group, take_type
from rosbridge_sim.cli.command_line import Options, run_tool
from rosbridge_sim.cli.tools.text import read_body
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser


def make_node() -> Parser:
    """Return the parser of `rosbridge-sim node`."""
    alone = "a rosbridge cannot reach a single node"
    absent = {
        "ping": f"{alone}; rosbridge-sim wait tells if the rosbridge answers",
        "kill": f"{alone}; end the program itself",
        "cleanup": "a client that has gone leaves nothing behind",
        "machine": f"{alone} or tell its machine; the topic /sim/clients has the addresses of this server's clients",
    }
    text = "Nodes of a rosbridge, as rosapi lists them: all clients of a rosbridge are one node."
    group, _, row = bridge_group("node", text, absent)

    parser = row("list", "tools.node.list_nodes", "list all nodes")
    parser.switch("-a", "--all", "the same: rosapi lists no hidden nodes")
    add_count(parser, "nodes")
    row("info", "tools.node.show_node", "show topics and services of a node", name="NODE")
    return group


# param


def make_param() -> Parser:
    """Return the parser of `rosbridge-sim param`."""
    text = "Parameters of a rosbridge. NAME is /ns/x (ROS 1) or /node:x (ROS 2); a node may stand before it."
    absent = {"load": "a rosbridge reads no files; rosbridge-sim param set sets one value"}
    group, add, row = bridge_group("param", text, absent)

    parser = row("list", "tools.param.list_parameters", "list all parameters")
    parser.option("inner", "NODE|NAMESPACE", "of this one alone [all]", nargs="?", default="")

    for name, words, text in (
        ("get", "[NODE] NAME", "print a parameter's value"),
        ("set", "[NODE] NAME VALUE", "set a parameter to a value, in JSON or YAML"),
        ("delete", "[NODE] NAME", "delete a parameter, or a namespace of ROS 1"),
    ):
        parser = add(name, _with_words, text)
        parser.add_argument("given", metavar=words, nargs="*")
        parser.set_defaults(words=words)
        if name == "get":
            parser.switch("--hide-type", "print the value alone, also behind a node", dest="is_bare")
        add_bridge(parser)

    text = "show type and constraints of a node's parameters (ROS 2)"
    parser = row("describe", "tools.param.describe", text, node="NODE")
    parser.add_argument("names", metavar="NAME", nargs="+")
    parser = row("dump", "tools.param.dump", "print all values as YAML")
    parser.option("inner", "NODE|NAMESPACE", "of this one alone [all]", nargs="?", default="")
    return group


def _with_words(options: Options) -> int:
    """Run a command with its words: a name, or a node and a name, and perhaps a value."""
    number, most = len(options.given), len(options.words.split())
    if not most - 1 <= number <= most:
        name = f"param {options.command}"
        raise SettingError(f"{name}: expected {options.words}; got {number} words; see rosbridge-sim {name} --help")
    value = read_body(options.given.pop(), "VALUE") if options.command == "set" else None
    return run_tool(f"tools.param.{options.command}_value", options, value=value)


# action


def make_action() -> Parser:
    """Return the parser of `rosbridge-sim action`."""
    group, add, row = bridge_group("action", "Actions of a rosbridge: list, show, and send goals.")

    parser = row("list", "tools.action.list_actions", "list all actions")
    add_types(parser)
    add_count(parser, "actions")
    add_types(row("info", "tools.action.show_action", "show the nodes of an action", name="NAME"))
    row("type", "tools.action.show_action_type", "print the type of an action", name="NAME")

    parser = add("send_goal", _send_goal, "send a goal, and wait for its result; Ctrl-C cancels it")
    parser.add_argument("name", metavar="NAME")
    parser.option("words", "[TYPE] GOAL", "the goal is JSON or YAML; fields may be left out", nargs="*")
    parser.switch("-f", "--feedback", "print the feedback, too")
    add_bridge(parser)
    return group


def _send_goal(options: Options) -> int:
    kind = take_type(options.words)
    goal = read_body(" ".join(options.words) or "{}", "GOAL")
    if not isinstance(goal, dict):
        raise SettingError(f"GOAL: expected an object such as '{{order: 5}}'; got {goal!r}")
    return run_tool("tools.action.send_goal", options, type_name=kind, goal=goal)
