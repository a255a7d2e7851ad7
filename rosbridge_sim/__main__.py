"""The command line: `rosbridge-sim [serve] [flags]` and `attach URL`; the other commands are in `cli/`.

A user's mistake gives one line on stderr and exit code 2. An internal error gives a traceback and exit code 1.
"""

from __future__ import annotations

import sys

if sys.version_info < (3, 11):  # noqa: UP036 - pip refuses an older Python, `python -m` in a checkout does not
    sys.exit(
        f"rosbridge-sim: expected Python 3.11 or newer; this is {sys.version.split()[0]} ({sys.executable}):"
        " install a newer one and start with it"
    )

import gc
import os
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.suggestions import hint

if TYPE_CHECKING:
    from rosbridge_sim.serving import ServerCommand


def main() -> int:
    """Run the command that the command line names; return the exit code."""
    argv = sys.argv[1:]
    name = argv.pop(0) if argv and not argv[0].startswith("-") else "serve"
    commands = _SERVERS
    if name not in commands:
        from rosbridge_sim.cli.command_table import TOOLS  # noqa: PLC0415 - not needed by serve

        commands = {**_SERVERS, **TOOLS}
    if name == "ros2" and argv and argv[0] != "check" and argv[0] in commands.keys() | _ABSENT.keys():
        name = argv.pop(0)
    name = _SAME_AS.get(name, name)
    if name == "mock" and argv[:1] == ["run"]:
        name = f"mock {argv.pop(0)}"
    try:
        if name in _ABSENT:
            raise SettingError(f"{name}: {_ABSENT[name]}")
        if name not in commands:
            raise SettingError(f"no such command: {name}{hint(name, commands)}; --help lists them")
        code = commands[name](argv)
        sys.stdout.flush()
    except DocumentError as error:
        for line in str(error).splitlines():  # a settings file may have several mistakes
            print(f"rosbridge-sim: {line}", file=sys.stderr)  # noqa: T201 - output for people, not a log line
        return 2
    except OSError as error:
        from rosbridge_sim.cli.command_line import OUTPUT_LOST, drop_output  # noqa: PLC0415 - not needed by serve

        if error.errno not in OUTPUT_LOST or error.filename is not None:
            raise
        drop_output()
        text = f"rosbridge-sim: the output cannot be written: {os.strerror(error.errno).lower()}"
        print(text, file=sys.stderr)  # noqa: T201 - as above
        return 2
    return code


# The commands


def _serve(argv: Sequence[str], command: ServerCommand = "serve") -> int:
    """Run a server, or print what was asked for."""
    gc.disable()  # the objects of the start stay, and to go through them takes a tenth of it; `serve` enables it
    try:
        from rosbridge_sim.serving import serve  # noqa: PLC0415 - not needed by the tools

        return serve(argv, command)
    finally:
        gc.enable()


_SERVERS: dict[str, Callable[[Sequence[str]], int]] = {
    "serve": _serve,
    "attach": partial(_serve, command="attach"),
    "mock run": partial(_serve, command="mock run"),
}

_SAME_AS = {
    **{f"ros{name}": name for name in ("topic", "service", "node", "param", "action", "bag")},
    **dict.fromkeys(("rosmsg", "rossrv", "msg", "srv"), "interface"),
}
"""Name of a tool of ROS -> the command here. The words of `ros2` are commands here, too."""

_STARTS = "there are no packages of ROS to start; start your program itself, with the URL of rosbridge-sim serve"
_REACHES_NOT = "a rosbridge gives no access to it; rosbridge-sim service call calls a node's services"

_ABSENT = {
    **dict.fromkeys(("run", "launch", "rosrun", "roslaunch"), _STARTS),
    **dict.fromkeys(("roscore", "rosmaster", "daemon"), "none is needed; rosbridge-sim serve is the server"),
    **dict.fromkeys(("lifecycle", "component"), _REACHES_NOT),
    "roswtf": "doctor checks a rosbridge; ros1 check and ros2 check tell why nodes see none",
    **dict.fromkeys(("pkg", "rospack"), "packages have only types here; rosbridge-sim interface packages lists them"),
}
"""Tool of ROS that has no meaning here -> the reason, and what does its work."""


if __name__ == "__main__":
    sys.exit(main())
