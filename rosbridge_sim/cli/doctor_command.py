"""The command `rosbridge-sim doctor`."""

from __future__ import annotations

from pathlib import Path

from rosbridge_sim.cli.bridge_flags import DEFAULT_URL, SECONDS, add_token
from rosbridge_sim.cli.command_line import Options, add_json, command_of, run_tool
from rosbridge_sim.link.arguments import Parser

PATIENCE = 2.0
"""Default of the longest wait for a frame [s]."""


def make_doctor() -> Parser:
    """Return the parser of `rosbridge-sim doctor`."""
    text = (
        "Check what a rosbridge does, with its own topics and services below a name that nobody else has. "
        "Safe with a real robot: nothing of its own is published, called or changed."
    )
    end = "Exit code 1: it breaks the protocol, or what both releases of rosbridge_suite do."
    parser = command_of("doctor", _run, text, end)
    parser.add_argument("url", metavar="URL", nargs="?", default=DEFAULT_URL, help=f"any rosbridge [{DEFAULT_URL}]")
    add_token(parser)
    about = "longest wait for a frame"
    parser.add_argument(
        "--timeout", dest="patience", type=SECONDS, default=PATIENCE, metavar="SECONDS", help=f"{about} [{PATIENCE:g}]"
    )
    parser.add_argument("--ros", type=int, choices=(1, 2), help="the server's ROS [as it tells]")
    about = "only this section, check, or pattern such as topics/latch*; may be repeated"
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help=about)
    parser.add_argument("--list", dest="is_list", action="store_true", help="list all checks with their sources")
    about = "also send what no honest client sends; a good server lives on"
    parser.add_argument("--hostile", action="store_true", help=about)
    about = "also measure throughput and send large messages, which slow the server down for others"
    parser.add_argument("--load", action="store_true", help=about)
    about = "its output of --json; the same differences are no faults"
    parser.add_argument("--baseline", type=Path, metavar="FILE", help=about)
    parser.add_argument("-v", "--verbose", action="store_true", help="all checks, with the frames")
    parser.add_argument("--markdown", dest="is_markdown", action="store_true", help="print Markdown, for an issue")
    parser.add_argument("--junit", dest="junit_path", type=Path, metavar="FILE", help="write JUnit XML, for CI")
    add_json(parser)
    return parser


def _run(options: Options) -> int:
    return run_tool(f"doctor.doctor_run.{'list_checks' if options.is_list else 'examine_server'}", options)
