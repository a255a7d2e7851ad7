"""JUnit XML, which CI shows: one suite of cases."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from typing import Final

from rosbridge_sim.records import Record


class Case(Record):
    """A case of a suite.

    Attributes:
        group: section, topic or the like.
        name: name of the case in it.
        failure: what is wrong; empty if nothing is.
        skipped: why it was not tested; empty if it was.
    """

    group: str
    name: str
    failure: str = ""
    skipped: str = ""


def write_suite(name: str, cases: Sequence[Case]) -> str:
    """Return the XML of a suite."""
    failures, skipped = sum(bool(one.failure) for one in cases), sum(bool(one.skipped) for one in cases)
    numbers = f'tests="{len(cases)}" failures="{failures}" skipped="{skipped}"'
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', f'<testsuite name="{_quoted(name)}" {numbers}>']
    for one in cases:
        head = f'  <testcase classname="{_quoted(one.group)}" name="{_quoted(one.name)}"'
        if one.failure:
            lines.append(f'{head}><failure message="{_quoted(one.failure)}"/></testcase>')
        elif one.skipped:
            lines.append(f'{head}><skipped message="{_quoted(one.skipped)}"/></testcase>')
        else:
            lines.append(f"{head}/>")
    return "\n".join([*lines, "</testsuite>", ""])


_NOT_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def _quoted(text: str) -> str:
    return html.escape(_NOT_XML.sub("?", text))
