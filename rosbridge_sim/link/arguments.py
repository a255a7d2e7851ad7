"""Parsing of command lines: errors as one readable line, and the layout of `--help`."""

from __future__ import annotations

import argparse
import re
import shutil
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NoReturn

from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.urls import hide_in_words
from rosbridge_sim.suggestions import hint

PREFIX = "ROSBRIDGE_SIM_"
"""Prefix of all environment variables of this package."""


def layout(prog: str) -> argparse.HelpFormatter:
    """Return the formatter of all help texts."""
    return argparse.HelpFormatter(prog, max_help_position=28, width=min(shutil.get_terminal_size().columns, 110))


class Parser(argparse.ArgumentParser):
    """A parser that raises an error; the library's own would print its usage and exit.

    Attributes:
        absent: command of the tools of ROS that is missing on purpose -> the reason, and what does its work.
    """

    absent: Mapping[str, str] = MappingProxyType({})

    def option(self, *words: str, **more: Any) -> None:  # noqa: ANN401 - as `add_argument` takes them
        """Add a flag with a value, or a word: its names, the sign of its value, and the help."""
        *names, sign, text = words
        self.add_argument(*names, metavar=sign, help=text, **more)

    def repeated(self, *words: str, **more: Any) -> None:  # noqa: ANN401 - as above
        """Add a flag that may be given several times: its names, the sign of a value, and the help."""
        self.option(*words, action="append", default=[], **more)

    def switch(self, *words: str, **more: Any) -> None:  # noqa: ANN401 - as above
        """Add a flag without a value: its names, and the help."""
        *names, text = words
        self.add_argument(*names, action="store_true", help=text, **more)

    def error(self, message: str) -> NoReturn:
        """Report a mistake. The library calls this.

        Args:
            message: the library's error text.

        Raises:
            SettingError: always.
        """
        message = _without_values(message.removeprefix("argument "))
        if unknown := _UNKNOWN_COMMAND.fullmatch(message):
            known = re.findall(r"[\w-]+", unknown["known"])
            if unknown["name"] in self.absent:
                raise SettingError(f"{self.prog.partition(' ')[2]} {unknown['name']}: {self.absent[unknown['name']]}")
            message = f"no such command: {unknown['name']}{hint(unknown['name'], known)}; expected {', '.join(known)}"
        elif message.startswith((_STRANGE_WORDS, _MISSING_WORDS)):
            message += f"; see {self.prog} --help"
        raise SettingError(message)


_UNKNOWN_COMMAND = re.compile(r"COMMAND: invalid choice: '?(?P<name>.*?)'? \(choose from (?P<known>.+)\)", re.DOTALL)
"""Text of the library for a word that is no command; its quotes differ between releases of Python."""

_STRANGE_WORDS = "unrecognized arguments: "
_MISSING_WORDS = "the following arguments are required: "


def _without_values(message: str) -> str:
    """Return a message of the library without values that may be secrets; of unknown words, only the flags."""
    if message.startswith(_STRANGE_WORDS):
        words = message.removeprefix(_STRANGE_WORDS).split()
        flags = [word.partition("=")[0] for word in words if word.startswith("-")]
        message = _STRANGE_WORDS + " ".join(flags or words)
    return hide_in_words(message)
