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
    parser.add_argument("url", metavar="URL", nargs="?", default=url, help=about)
    add_token(parser)
    about = "longest wait for a frame"
    parser.add_argument(
        "--timeout", dest="patience", type=SECONDS, default=PATIENCE, metavar="SECONDS", help=f"{about} [{PATIENCE:g}]"
    )
    parser.add_argument("--ros", type=int, choices=(1, 2), help="generation of ROS behind the server [rosapi is asked]")
    about = "only this section, check, or pattern such as topics/latch*; may be repeated"
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help=about)
    parser.add_argument("--list", dest="is_list", action="store_true", help="list all checks with their sources")
    about = "also send what no honest client sends; a good server keeps serving the others"
    parser.add_argument("--hostile", action="store_true", help=about)
    about = "also measure throughput and send large messages, which slow the server down for others"
    parser.add_argument("--load", action="store_true", help=about)
    about = "what --json printed in an earlier run: its differences are known, and no faults"
    parser.add_argument("--baseline", type=Path, metavar="FILE", help=about)
    parser.add_argument("-v", "--verbose", action="store_true", help="all checks, with the frames")
    parser.add_argument("--markdown", dest="is_markdown", action="store_true", help="print Markdown, for an issue")
    parser.add_argument("--junit", dest="junit_path", type=Path, metavar="FILE", help="write JUnit XML, for CI")
    add_json(parser)
    return parser


def _run(options: Options) -> int:
    return run_tool(f"doctor.doctor_run.{'list_checks' if options.is_list else 'examine_server'}", options)
