"""The commands that read files and need no server: `rosbridge-sim schema|bag|scenario|map|docs ...`."""

from __future__ import annotations

from rosbridge_sim.cli.command_line import Options, add_definitions, add_json, command_of, group_of, run_tool
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

# schema


def make_schema() -> Parser:
    """Return the parser of `rosbridge-sim schema ...`."""
    group, add = group_of("schema", "Message, service and action definitions on this machine; no server is needed.")

    parser = add("list", "tools.schema.list_types", "list all known types")
    parser.add_argument("package", metavar="PACKAGE", nargs="?", help="only the types of this package")
    _add_folders(parser)

    parser = add("show", "tools.schema.show_type", "print the definition of a type")
    parser.add_argument("name", metavar="TYPE", help="pkg/Type, or Type of any package")
    parser.add_argument("--full", action="store_true", help="with the definitions of all types in it")
    _add_folders(parser)

    text = "print TypeScript declarations of a package, for roslib.js"
    parser = add("typescript", "tools.schema.write_typescript", text)
    parser.add_argument("package", metavar="PACKAGE", help="such as morai_msgs")
    _add_choice(parser)

    parser = add("file", "tools.schema.show_file_schema", "print the JSON Schema of a file that you write, for editors")
    parser.add_argument(
        "name", metavar="NAME", help="campaign, contract, mock, scenario, sensor_noise, sensors or signal_plan"
    )
    return group


def _add_folders(parser: Parser) -> None:
    add_json(parser)
    _add_choice(parser)


def _add_choice(parser: Parser) -> None:
    add_definitions(parser)
    parser.add_argument("--ros", metavar="1|2", help="ROS generation of the standard messages")


# interface


def make_interface() -> Parser:
    """Return the parser of `rosbridge-sim interface ...`."""
    absent = {
        "md5": "programs behind a rosbridge compare no checksums; rosbridge-sim interface show prints the definition",
        "users": "no package here says what it uses; rosbridge-sim topic find and service find ask a server",
    }
    text = "The definitions of `schema`, in the form of ros2 interface and rosmsg; no server is needed."
    group, add = group_of("interface", text, absent)
    for command, text in (
        ("list", "list all types"),
        ("package", "list the types of a package"),
        ("packages", "list the packages that have types"),
    ):
        parser = add(command, "tools.schema.list_interfaces", text)
        if command == "package":
            parser.add_argument("package", metavar="PACKAGE")
        parser.set_defaults(package=None, kinds=None)
        for kind in ("msg", "srv", "action"):
            parser.add_argument(
                f"-{kind[0]}", f"--only-{kind}s", action="append_const", const=kind, dest="kinds", help=f"only {kind}s"
            )
        _add_choice(parser)

    for command, work, text in (
        ("show", "show_interface", "print a definition, with the fields of the messages in it"),
        ("proto", "show_prototype", "print a message, request or goal with its default values"),
    ):
        parser = add(command, f"tools.schema.{work}", text)
        parser.add_argument("name", metavar="TYPE", help="pkg/Type, pkg/msg/Type, or Type of any package")
        _add_choice(parser)
    return group


# scenario


def make_scenario() -> Parser:
    """Return the parser of `rosbridge-sim scenario ...`."""
    group, add = group_of("scenario", "Scenario files; no server is needed.")

    parser = add(
        "check",
        "files.scenario_report.check_scenarios",
        "explain a scenario file: its mistakes, its contents, and the keys that are used; or check several",
    )
    parser.add_argument(
        "names",
        metavar="FILE",
        nargs="+",
        help="FILE.json, FILE.xosc, the name of a scenario as for a server, or a folder of scenarios",
    )
    parser.add_argument("--map", metavar="NAME|DIR", help="map to check it on [the map in the scenario]")
    parser.add_argument(
        "--scenario-path", action="append", default=[], metavar="DIR", help="folder with scenarios; may be repeated"
    )
    parser.add_argument(
        "--catalogue", metavar="FILE", help="your own table of models, *.toml or *.csv, as for serve; lengths in metres"
    )
    parser.add_argument(
        "--param",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="value of a parameter of a *.xosc",
    )
    parser.add_argument("--ego-entity", metavar="NAME", help="entity of a *.xosc that is the ego")
    parser.add_argument(
        "--lenient",
        dest="is_lenient",
        action="store_true",
        help="what a *.xosc asks for and is not supported is left out, and no mistake",
    )
    _add_picture(parser)
    _add_strict(parser)
    add_json(parser)
    return group


def _add_picture(parser: Parser) -> None:
    parser.add_argument("--picture", metavar="FILE.png", help="also draw a picture; FILE.jpg is possible, too")


def _add_strict(parser: Parser) -> None:
    parser.add_argument(
        "--strict",
        action="store_true",
        help="exit with code 1 for remarks, too, not only for mistakes",
    )


# map


def make_map() -> Parser:
    """Return the parser of `rosbridge-sim map ...`."""
    group, add = group_of("map", "Map folders; no server is needed.")

    text = "explain a map: its mistakes, missing parts and contents; or check several"
    parser = add("info", "files.map.show_maps", text)
    parser.add_argument(
        "names",
        metavar="DIR|NAME",
        nargs="+",
        help="a folder of MGeo files, an OpenDRIVE file (.xodr), a folder of such, or a built-in map",
    )
    _add_picture(parser)
    _add_strict(parser)
    add_json(parser)
    return group


# docs


def make_docs() -> Parser:
    """Return the parser of `rosbridge-sim docs ...`."""
    parser = command_of(
        "docs",
        _show_docs,
        "List the documentation pages in the package, or print one of them.",
    )
    parser.add_argument("name", metavar="PAGE", nargs="?", help="a page to print, such as tutorial or guides/ci")
    parser.add_argument("--open", action="store_true", help="open the site in a browser, if mkdocs has built it")
    add_json(parser)
    return parser


def _show_docs(options: Options) -> int:
    if options.open:
        if options.name is not None or options.json:
            raise SettingError("docs: --open opens the whole site; expected neither PAGE nor --json with it")
        return run_tool("tools.docs.open_site", options)
    return run_tool(f"tools.docs.{'list_pages' if options.name is None else 'show_page'}", options)
