"""The command `rosbridge-sim doctor`."""

from __future__ import annotations

import os
from pathlib import Path

from rosbridge_sim.cli.bridge_flags import DEFAULT_URL, SECONDS, add_token
from rosbridge_sim.cli.command_line import Options, add_json, command_of, run_tool
from rosbridge_sim.link.arguments import PREFIX, Parser
from rosbridge_sim.link.urls import shown_url

PATIENCE = 2.0
"""Default of the longest wait for a frame [s]."""


def make_doctor() -> Parser:
    """Return the parser of `rosbridge-sim doctor`."""
    text = (
        "Check what a rosbridge does. The checks use topics and services of their own, below a random name, so they"
        " are safe with a real robot: they publish, call and change nothing of it."
    )
    end = "The exit code is 1 if it breaks the protocol, or does not do what both releases of rosbridge_suite do."
    parser = command_of("doctor", _run, text, end)
    url = os.environ.get(f"{PREFIX}URL") or DEFAULT_URL
    about = f"any rosbridge, also as {PREFIX}URL [{shown_url(url)}]".replace("%", "%%")
    parser.option("url", "URL", about, nargs="?", default=url)
    add_token(parser)
    about = "longest wait for a frame"
    parser.option("--timeout", "SECONDS", f"{about} [{PATIENCE:g}]", dest="patience", type=SECONDS, default=PATIENCE)
    parser.add_argument("--ros", type=int, choices=(1, 2), help="generation of ROS behind the server [rosapi is asked]")
    parser.repeated("--only", "NAME", "only this section, check, or pattern such as topics/latch*; may be repeated")
    parser.switch("--list", "list all checks with their sources", dest="is_list")
    parser.switch("--hostile", "also send what no honest client sends; a good server keeps serving the others")
    parser.switch("--load", "also measure throughput and send large messages, which slow the server down for others")
    about = "what --json printed in an earlier run: its differences are known, and no faults"
    parser.option("--baseline", "FILE", about, type=Path)
    parser.switch("-v", "--verbose", "all checks, with the frames")
    parser.switch("--markdown", "print Markdown, for an issue", dest="is_markdown")
    parser.option("--junit", "FILE", "write JUnit XML, for CI", dest="junit_path", type=Path)
    add_json(parser)
    return parser


def _run(options: Options) -> int:
    return run_tool(f"doctor.doctor_run.{'list_checks' if options.is_list else 'examine_server'}", options)
