"""`rosbridge-sim doctor`: what a rosbridge server does, check by check.

The checks are those of `rosbridge_sim/doctor/checks/`, and those of the connection itself in `connection_checks.py`.
Each check has connections of its own, and names of its own below a random prefix, so several run at a time, and
nothing of the server's own graph is published or called but the services of rosapi that read.
"""

from __future__ import annotations

import asyncio
import fnmatch
import json
import secrets
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from rosbridge_sim.cli.doctor import connection_checks
from rosbridge_sim.cli.doctor.examined_server import NO_CONNECTION, ExaminedServer
from rosbridge_sim.cli.tools.text import put, put_json, put_lines, put_progress, put_table, write_file
from rosbridge_sim.doctor.check import Check, prepared, read_checks
from rosbridge_sim.doctor.check_report import Report, junit, markdown, read_baseline, terminal_lines, to_json
from rosbridge_sim.doctor.examination import CheckResult, Verdict, examine
from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.link.urls import full_url
from rosbridge_sim.suggestions import hint

CHECKS_AT_ONCE = 4
"""Checks that run at a time: rosbridge_suite uses a thread for each connection and each call."""

SECTIONS = (
    *("connection", "framing", "topics", "flow", "services", "actions", "params", "rosapi", "status"),
    *("encodings", "conversion", "large", "hostile", "timing", "load"),
)
"""Sections in the order of the report."""


def all_checks(*, is_hostile: bool, is_load: bool) -> list[Check]:
    """Return the checks in the order of the report.

    Args:
        is_hostile: with those that send what no honest client sends.
        is_load: with those that take much of the server's time.
    """
    found = [*connection_checks.CHECKS]
    for path in files("rosbridge_sim.doctor").joinpath("checks").iterdir():
        if path.name.endswith(".jsonl"):
            found += read_checks(path.read_text(encoding="utf-8"))
    chosen = [
        one for one in found if (is_hostile or not one.is_hostile) and (is_load or one.section not in {"load", "large"})
    ]
    return sorted(chosen, key=lambda one: SECTIONS.index(one.section))


def chosen_checks(checks: Sequence[Check], patterns: Sequence[str]) -> list[Check]:
    """Return the checks that patterns name: a section, an id, or a pattern of ids; all if there are no patterns.

    Raises:
        SettingError: a pattern names none.
    """
    if not patterns:
        return list(checks)
    chosen: set[str] = set()
    for pattern in patterns:
        ids = {one.id for one in checks if one.section == pattern or fnmatch.fnmatchcase(one.id, pattern)}
        if not ids:
            known = [*SECTIONS, *(one.id for one in checks)]
            raise SettingError(f"--only: no check is called {pattern!r}{hint(pattern, known)}; --list lists them")
        chosen |= ids
    return [one for one in checks if one.id in chosen]


def list_checks(only: Sequence[str], *, is_json: bool) -> None:
    """Print all checks with their sources."""
    checks = chosen_checks(all_checks(is_hostile=True, is_load=True), only)
    if is_json:
        put_json([{"id": one.id, "says": one.says, "source": one.source} for one in checks])
    else:
        put_table(("check", "what", "source"), [(one.id, one.says, one.source) for one in checks])


async def examine_server(
    url: str,
    *,
    token: str | None,
    patience: float,
    only: Sequence[str],
    ros: int | None,
    hostile: bool,
    load: bool,
    is_json: bool,
    is_markdown: bool,
    verbose: bool,
    junit_path: Path | None,
    baseline: Path | None,
) -> int:
    """Run the checks and print the report.

    Args:
        url: URL of the server, or `HOST[:PORT]`.
        token: token of the server; None sends none.
        patience: longest wait for a frame [s].
        only: patterns of checks, see `chosen_checks`.
        ros: 1 or 2; None finds it out.
        hostile: with the checks that send what no honest client sends.
        load: with the checks that take much of the server's time.
        is_json: print JSON.
        is_markdown: print Markdown.
        verbose: print all checks and their frames.
        junit_path: file for JUnit XML; None writes none.
        baseline: report of an earlier run, whose differences are known; None knows none.

    Returns:
        0 if there is no fault, else 1.

    Raises:
        BridgeError: there is no connection.
        DocumentError: the baseline cannot be read, or a file cannot be written.
    """
    checks = chosen_checks(all_checks(is_hostile=hostile, is_load=load), only)
    known = {} if baseline is None else _read_known(baseline)
    server = ExaminedServer(full_url(url), token, patience, f"/doctor_{secrets.token_hex(3)}")
    try:
        await server.find_out(ros)
        outcomes = await _examine_all(server, checks)
    finally:
        await server.close()
    report = Report(server.name, outcomes, known)
    if is_json:
        put(json.dumps(to_json(report)))  # some checks send integers beyond 64 bits
    elif is_markdown:
        put_lines(markdown(report))
    else:
        put_lines("\n".join(terminal_lines(report, is_verbose=verbose)))
    if junit_path is not None:
        write_file(junit_path, junit(report))
    return 1 if report.faults else 0


async def _examine_all(server: ExaminedServer, checks: Sequence[Check]) -> list[CheckResult]:
    """Run checks, several at a time; those of times, load and hostile input alone and last."""
    outcomes: dict[str, CheckResult] = {}
    room = asyncio.Semaphore(CHECKS_AT_ONCE)

    async def run(check: Check) -> None:
        async with room:
            outcomes[check.id] = await _examine(server, check)
            put_progress(f"{len(outcomes)} of {len(checks)} checks")

    alone = [one for one in checks if one.section in {"large", "timing", "load", "hostile"}]
    together = [one for one in checks if one not in alone]
    async with asyncio.TaskGroup() as group:
        for check in together:
            group.create_task(run(check))
    for check in alone:
        await run(check)
    put_progress("")
    return [outcomes[check.id] for check in checks]


async def _examine(server: ExaminedServer, check: Check) -> CheckResult:
    why = await server.why_not_applicable(check)
    if why:
        return CheckResult(check, Verdict.NOT_APPLICABLE, why)
    prefix = f"{server.prefix}/{server.count()}"
    try:
        if not check.steps:
            return await connection_checks.run(check, server, prefix)
        async with server.clients() as clients:
            return await examine(prepared(check, prefix, server.ros), clients, server.ros)
    except NO_CONNECTION as error:  # it takes no more connections
        return CheckResult(check, Verdict.DEVIATES, server.why_not(error))


def _read_known(path: Path) -> dict[str, str]:
    try:
        return read_baseline(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DocumentError(f"--baseline: {path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise DocumentError(f"--baseline: {path}: {error}") from None
