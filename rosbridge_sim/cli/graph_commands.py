"""The commands about the graph of a rosbridge: `rosbridge-sim node`, `param` and `action`."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence

from rosbridge_sim.cli.bridge_flags import add_bridge, add_count, on_bridge, take_type, with_bridge
from rosbridge_sim.cli.command_line import Options, group_of, run_command
from rosbridge_sim.cli.tools.text import read_body
from rosbridge_sim.cli.tools.tool_client import Bridge
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

__all__ = ["run_action", "run_node", "run_param"]


def run_node(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim node`."""
    from rosbridge_sim.cli.tools import node  # noqa: PLC0415 - not before the command is known; the same below

    alone = "a rosbridge cannot reach a single node"
    absent = {
        "ping": f"{alone}; rosbridge-sim wait tells if the rosbridge answers",
        "kill": f"{alone}; end the program itself",
        "cleanup": "a client that has gone leaves nothing behind",
        "machine": f"{alone} or tell its machine; the topic /sim/clients has the addresses of this server's clients",
    }
    text = "Nodes of a rosbridge, as rosapi lists them: all clients of a rosbridge are one node."
    group, add = group_of("node", text, absent)

    parser = add(
        "list",
        on_bridge(lambda bridge, o: node.list_nodes(bridge, is_count=o.is_count, is_json=o.json)),
        "list all nodes",
    )
    parser.add_argument("-a", "--all", action="store_true", help="the same: rosapi lists no hidden nodes")
    add_count(parser, "--count-nodes")
    add_bridge(parser)

    parser = add(
        "info",
        on_bridge(lambda bridge, o: node.show_node(bridge, o.name, is_json=o.json)),
        "show topics and services of a node",
    )
    parser.add_argument("name", metavar="NODE")
    add_bridge(parser)
    return run_command(group, argv)


# param


def run_param(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim param`."""
    from rosbridge_sim.cli.tools import param  # noqa: PLC0415

    text = "Parameters of a rosbridge. NAME is /ns/x (ROS 1) or /node:x (ROS 2); a node may stand before it."
    absent = {"load": "a rosbridge reads no files; rosbridge-sim param set sets one value"}
    group, add = group_of("param", text, absent)

    parser = add(
        "list",
        on_bridge(lambda bridge, o: param.list_parameters(bridge, o.inner, is_json=o.json)),
        "list all parameters",
    )
    parser.add_argument("inner", metavar="NODE|NAMESPACE", nargs="?", default="", help="only those of it")
    add_bridge(parser)

    parser = add(
        "get",
        _with_words(lambda bridge, o: param.get(bridge, o.words, is_bare=o.hide_type, is_json=o.json)),
        "print a parameter's value",
    )
    parser.add_argument("--hide-type", action="store_true", help="print the value alone, also behind a node")
    _add_words(parser, "[NODE] NAME")

    parser = add(
        "set",
        _with_words(lambda bridge, o: param.set_value(bridge, o.words, o.value, is_json=o.json), has_value=True),
        "set a parameter to a value, in JSON or YAML",
    )
    _add_words(parser, "[NODE] NAME VALUE")

    parser = add(
        "delete",
        _with_words(lambda bridge, o: param.delete(bridge, o.words, is_json=o.json)),
        "delete a parameter, or a namespace of ROS 1",
    )
    _add_words(parser, "[NODE] NAME")

    parser = add(
        "describe",
        on_bridge(lambda bridge, o: param.describe(bridge, o.node, o.names, is_json=o.json)),
        "show type and constraints of a node's parameters (ROS 2)",
    )
    parser.add_argument("node", metavar="NODE")
    parser.add_argument("names", metavar="NAME", nargs="+")
    add_bridge(parser)

    parser = add(
        "dump", on_bridge(lambda bridge, o: param.dump(bridge, o.inner, is_json=o.json)), "print all values as YAML"
    )
    parser.add_argument("inner", metavar="NODE|NAMESPACE", nargs="?", default="", help="only those of it")
    add_bridge(parser)
    return run_command(group, argv)


def _add_words(parser: Parser, names: str) -> None:
    parser.add_argument("words", metavar=names, nargs="*")
    add_bridge(parser)


def _with_words(
    work: Callable[[Bridge, Options], Awaitable[int]], *, has_value: bool = False
) -> Callable[[Options], int]:
    """Return the function that runs a command whose words are a name, or a node and a name, and perhaps a value."""

    def run(options: Options) -> int:
        if not 1 <= len(options.words) - has_value <= 2:  # noqa: PLR2004 - see above
            name = f"param {options.command}"
            what = "[NODE] NAME VALUE" if has_value else "[NODE] NAME"
            raise SettingError(
                f"{name}: expected {what}; got {len(options.words)} words; see rosbridge-sim {name} --help"
            )
        options.value = read_body(options.words.pop(), "VALUE") if has_value else None
        return with_bridge(options, lambda bridge: work(bridge, options))

    return run


# action


def run_action(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim action`."""
    from rosbridge_sim.cli.tools import action  # noqa: PLC0415

    group, add = group_of("action", "Actions of a rosbridge: list, show, and send goals.")

    parser = add(
        "list",
        on_bridge(
            lambda bridge, o: action.list_actions(bridge, has_types=o.types, is_count=o.is_count, is_json=o.json)
        ),
        "list all actions",
    )
    parser.add_argument("-t", "--types", "--show-types", action="store_true", help="with types, in brackets")
    add_count(parser, "--count-actions")
    add_bridge(parser)

    parser = add(
        "info",
        on_bridge(lambda bridge, o: action.show_action(bridge, o.name, has_types=o.types, is_json=o.json)),
        "show the nodes of an action; clients only as far as rosapi tells them, which is in ROS 1",
    )
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("-t", "--types", "--show-types", action="store_true", help="with types, in brackets")
    add_bridge(parser)

    parser = add(
        "type",
        on_bridge(lambda bridge, o: action.show_action_type(bridge, o.name, is_json=o.json)),
        "print the type of an action",
    )
    parser.add_argument("name", metavar="NAME")
    add_bridge(parser)

    parser = add("send_goal", _send_goal, "send a goal, and wait for its result; Ctrl-C cancels it")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument(
        "words", metavar="[TYPE] GOAL", nargs="*", help="the goal is JSON or YAML; fields may be left out"
    )
    parser.add_argument("-f", "--feedback", action="store_true", help="print the feedback, too")
    add_bridge(parser)
    return run_command(group, argv)


def _send_goal(options: Options) -> int:
    from rosbridge_sim.cli.tools.action import send_goal  # noqa: PLC0415

    kind = take_type(options.words)
    goal = read_body(" ".join(options.words) or "{}", "GOAL")
    if not isinstance(goal, dict):
        raise SettingError(f"GOAL: expected an object such as '{{order: 5}}'; got {goal!r}")
    return with_bridge(
        options,
        lambda bridge: send_goal(bridge, options.name, kind, goal, has_feedback=options.feedback, is_json=options.json),
    )
