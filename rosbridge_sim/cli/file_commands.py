"""The commands that read files and need no server: `rosbridge-sim schema|bag|scenario|map|docs ...`."""

from __future__ import annotations

from collections.abc import Sequence

from rosbridge_sim.cli.command_line import (
    Options,
    add_definitions,
    add_json,
    command_of,
    definition_sources_of,
    group_of,
    run_command,
)
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

# schema


def run_schema(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim schema ...`."""
    group, add = group_of("schema", "Message, service and action definitions on this machine; no server is needed.")

    parser = add("list", _list_types, "list all known types")
    parser.add_argument("package", metavar="PACKAGE", nargs="?", help="only the types of this package")
    _add_folders(parser)

    parser = add("show", _show_type, "print the definition of a type")
    parser.add_argument("type", metavar="TYPE", help="pkg/Type, or Type of any package")
    parser.add_argument("--full", action="store_true", help="with the definitions of all types in it")
    _add_folders(parser)

    parser = add("typescript", _write_typescript, "print TypeScript declarations of a package, for roslib.js")
    parser.add_argument("package", metavar="PACKAGE", help="such as morai_msgs")
    _add_choice(parser)
    return run_command(group, argv)


def _add_folders(parser: Parser) -> None:
    add_json(parser)
    _add_choice(parser)


def _add_choice(parser: Parser) -> None:
    add_definitions(parser)
    parser.add_argument("--ros", metavar="1|2", help="ROS generation of the standard messages")


def _list_types(options: Options) -> int:
    from rosbridge_sim.cli.tools import schema  # noqa: PLC0415

    return schema.list_types(options.package, definition_sources_of(options), is_json=options.json)


def _show_type(options: Options) -> int:
    from rosbridge_sim.cli.tools import schema  # noqa: PLC0415

    return schema.show_type(options.type, definition_sources_of(options), is_full=options.full, is_json=options.json)


def _write_typescript(options: Options) -> int:
    from rosbridge_sim.cli.tools import schema  # noqa: PLC0415

    return schema.write_typescript(options.package, definition_sources_of(options))


# interface


def run_interface(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim interface ...`."""
    from rosbridge_sim.cli.tools import schema  # noqa: PLC0415

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
        parser = add(
            command, lambda o: schema.list_interfaces(o.command, o.package, o.kinds, definition_sources_of(o)), text
        )
        if command == "package":
            parser.add_argument("package", metavar="PACKAGE")
        parser.set_defaults(package=None, kinds=None)
        for kind in schema.KINDS:
            parser.add_argument(
                f"-{kind[0]}", f"--only-{kind}s", action="append_const", const=kind, dest="kinds", help=f"only {kind}s"
            )
        _add_choice(parser)

    for command, run, text in (
        ("show", schema.show_interface, "print a definition, with the fields of the messages in it"),
        ("proto", schema.show_prototype, "print a message, request or goal with its default values"),
    ):
        parser = add(command, lambda o, run=run: run(o.type, definition_sources_of(o)), text)
        parser.add_argument("type", metavar="TYPE", help="pkg/Type, pkg/msg/Type, or Type of any package")
        _add_choice(parser)
    return run_command(group, argv)


# scenario


def run_scenario(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim scenario ...`."""
    group, add = group_of("scenario", "Scenario files; no server is needed.")

    parser = add(
        "check",
        _check_scenario,
        "explain a scenario file: its mistakes, its contents, and the keys that are used; or check several",
    )
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="FILE.json, the name of a scenario as for a server, or a folder of scenarios",
    )
    parser.add_argument("--map", metavar="NAME|DIR", help="map to check it on [the map in the scenario]")
    parser.add_argument(
        "--scenario-path", action="append", default=[], metavar="DIR", help="folder with scenarios; may be repeated"
    )
    parser.add_argument(
        "--catalogue", metavar="FILE", help="your own table of models, *.toml or *.csv, as for serve; lengths in metres"
    )
    _add_picture(parser)
    _add_strict(parser)
    add_json(parser)
    return run_command(group, argv)


def _add_picture(parser: Parser) -> None:
    parser.add_argument("--picture", metavar="FILE.png", help="also draw a picture; FILE.jpg is possible, too")


def _add_strict(parser: Parser) -> None:
    parser.add_argument(
        "--strict", action="store_true", help="exit with code 1 for remarks, too, not only for mistakes"
    )


def _check_scenario(options: Options) -> int:
    from rosbridge_sim.cli.files import scenario_report as scenario  # noqa: PLC0415

    library, own_map = scenario.open_library(options.map, tuple(options.scenario_path), options.catalogue)
    return scenario.check_scenarios(
        options.files, library, own_map, options.picture, is_json=options.json, is_strict=options.strict
    )


# map


def run_map(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim map ...`."""
    group, add = group_of("map", "Map folders; no server is needed.")

    parser = add("info", _show_map, "explain a map: its mistakes, missing parts and contents; or check several")
    parser.add_argument(
        "maps",
        metavar="DIR|NAME",
        nargs="+",
        help="a folder of MGeo files, a folder of such, or a built-in map",
    )
    _add_picture(parser)
    _add_strict(parser)
    add_json(parser)
    return run_command(group, argv)


def _show_map(options: Options) -> int:
    from rosbridge_sim.cli.files import map as map_tool  # noqa: PLC0415

    return map_tool.show_maps(options.maps, options.picture, is_json=options.json, is_strict=options.strict)


# docs


def run_docs(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim docs ...`."""
    parser = command_of(
        "docs",
        _show_docs,
        "List the documentation pages in the package, or print one of them.",
    )
    parser.add_argument("page", metavar="PAGE", nargs="?", help="a page to print, such as tutorial or guides/ci")
    parser.add_argument("--open", action="store_true", help="open the site in a browser, if mkdocs has built it")
    add_json(parser)
    return run_command(parser, argv)


def _show_docs(options: Options) -> int:
    from rosbridge_sim.cli.tools import docs  # noqa: PLC0415

    if options.open:
        if options.page is not None or options.json:
            raise SettingError("docs: --open opens the whole site; expected neither PAGE nor --json with it")
        return docs.open_site()
    if options.page is None:
        return docs.list_pages(is_json=options.json)
    return docs.show_page(options.page, is_json=options.json)
