"""The commands that read files and need no server: `rosbridge-sim schema|bag|scenario|map|docs ...`."""

from __future__ import annotations

from rosbridge_sim.cli.command_line import Options, add_definitions, add_json, command_of, group_of, run_tool, words_of
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

# schema


def make_schema() -> Parser:
    """Return the parser of `rosbridge-sim schema ...`."""
    group, add = group_of("schema", "Message, service and action definitions on this machine; no server is needed.")

    parser = add("list", "tools.schema.list_types", "list all known types")
    parser.option("package", "PACKAGE", "only the types of this package", nargs="?")
    _add_folders(parser)

    parser = add("show", "tools.schema.show_type", "print the definition of a type")
    parser.option("name", "TYPE", "pkg/Type, or Type of any package")
    parser.switch("--full", "with the definitions of all types in it")
    _add_folders(parser)

    text = "print TypeScript declarations of a package, for roslib.js"
    parser = add("typescript", "tools.schema.write_typescript", text)
    parser.option("package", "PACKAGE", "such as morai_msgs")
    _add_choice(parser)

    parser = add("file", "tools.schema.show_file_schema", "print the JSON Schema of a file that you write, for editors")
    parser.option("name", "NAME", "campaign, contract, mock, scenario, sensor_noise, sensors or signal_plan")
    return group


def _add_folders(parser: Parser) -> None:
    add_json(parser)
    _add_choice(parser)


def _add_choice(parser: Parser) -> None:
    add_definitions(parser)
    parser.option("--ros", "1|2", "ROS generation of the standard messages")


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
        parser.option("name", "TYPE", "pkg/Type, pkg/msg/Type, or Type of any package")
        _add_choice(parser)
    return group


# scenario


def make_scenario() -> Parser:
    """Return the parser of `rosbridge-sim scenario ...`."""
    group, add = group_of("scenario", "Scenario files; no server is needed.")

    parser = add(
        "check",
        _check_scenarios,
        "explain a scenario file: its mistakes, its contents, and the keys that are used; or check several",
    )
    about = "FILE.json, FILE.xosc, the name of a scenario as for a server, or a folder of scenarios"
    parser.option("names", "FILE", about, nargs="+")
    parser.option("--map", "NAME|DIR", "map to check it on [the map in the scenario]")
    parser.repeated("--scenario-path", "DIR", "folder with scenarios; may be repeated")
    parser.option("--catalogue", "FILE", "your own table of models, *.toml or *.csv, as for serve; lengths in metres")
    parser.repeated("--param", "NAME=VALUE", "value of a parameter of a *.xosc")
    parser.option("--ego-entity", "NAME", "entity of a *.xosc that is the ego")
    about = "what a *.xosc asks for and is not supported is left out, and no mistake"
    parser.switch("--lenient", about)
    _add_picture(parser)
    _add_strict(parser)
    add_json(parser)
    return group


def _check_scenarios(options: Options) -> int:
    words = words_of(options, "scenario_path", "map", "catalogue", "param", "ego_entity", "lenient")
    return run_tool("files.scenario_report.check_scenarios", options, words=words)


def _add_picture(parser: Parser) -> None:
    parser.option("--picture", "FILE.png", "also draw a picture; FILE.jpg is possible, too")


def _add_strict(parser: Parser) -> None:
    parser.switch("--strict", "exit with code 1 for remarks, too, not only for mistakes")


# map


def make_map() -> Parser:
    """Return the parser of `rosbridge-sim map ...`."""
    group, add = group_of("map", "Map folders; no server is needed.")

    text = "explain a map: its mistakes, missing parts and contents; or check several"
    parser = add("info", "files.map.show_maps", text)
    about = "a folder of MGeo files, an OpenDRIVE file (.xodr), a folder of such, or a built-in map"
    parser.option("names", "DIR|NAME", about, nargs="+")
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
    parser.option("name", "PAGE", "a page to print, such as tutorial or guides/ci", nargs="?")
    parser.switch("--open", "open the site in a browser, if mkdocs has built it")
    add_json(parser)
    return parser


def _show_docs(options: Options) -> int:
    if options.open:
        if options.name is not None or options.json:
            raise SettingError("docs: --open opens the whole site; expected neither PAGE nor --json with it")
        return run_tool("tools.docs.open_site", options)
    return run_tool(f"tools.docs.{'list_pages' if options.name is None else 'show_page'}", options)
