"""`rosbridge-sim campaign ...`: many drives, judged; no server is needed."""

from __future__ import annotations

import argparse
import os
import re

from rosbridge_sim.cli.command_line import add_json, group_of, make_number
from rosbridge_sim.link.arguments import Parser


def make_campaign() -> Parser:
    """Return the parser of `rosbridge-sim campaign ...`."""
    group, add = group_of("campaign", "Many drives with parameters, drivers and limits; no server is needed.")

    parser = add("run", "campaigns.campaign_run.run", "drive all runs of a campaign, and write tables and a report")
    _add_file(parser)
    parser.option("-o", "--output", "DIR", "folder of the results, or an address such as s3://bucket/night [NAME_runs]")
    num = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    about = "processes that drive [the number of cores]"
    parser.option("--jobs", "N", about, type=make_number(1, 1_000, "a whole number from 1 to 1,000", int), default=num)
    parser.option(
        "--retry-killed",
        "N",
        "times that a run is driven again whose worker was killed from outside, as without memory [1]",
        dest="num_retries",
        type=make_number(0, 100, "a whole number from 0 to 100", int),
        default=1,
    )
    parser.option("--shard", "I/N", "drive every N-th run alone, from run I on; `merge` joins them", type=_read_shard)
    parser.switch("--resume", "go on with the results that are there", dest="is_resumed")
    parser.switch("--dry-run", "list the runs, and drive none", dest="is_dry")
    parser.option("--ray", "ADDRESS|local", "drive on a Ray cluster; needs the extra rosbridge-sim[ray]")
    add_json(parser)

    parser = add(
        "check", "campaigns.campaign_run.check", "explain a campaign's file: its mistakes, and what it would drive"
    )
    _add_file(parser)
    add_json(parser)

    parser = add("list", "campaigns.campaign_results.list_runs", "list the runs of a folder of results")
    _add_folder(parser)
    parser.add_argument(
        "--verdict", choices=("pass", "fail", "error", "skipped", "flaky"), help="only the runs with this verdict"
    )
    add_json(parser)

    parser = add(
        "show",
        "campaigns.campaign_results.show",
        "explain one run: parameters, verdict, scores, files, the driver's output",
    )
    _add_run(parser)

    parser = add(
        "repeat", "campaigns.campaign_run.repeat", "drive one run again, and say whether it ends in the same state"
    )
    _add_run(parser)

    parser = add(
        "report", "campaigns.campaign_results.report", "write tables and report.html of a folder of results anew"
    )
    _add_folder(parser)

    parser = add(
        "merge", "campaigns.campaign_run.merge", "join folders of results of one campaign, such as those of its shards"
    )
    parser.option("folders", "DIR", "folders of results", nargs="+")
    parser.option("-o", "--output", "DIR", "new folder of the results", required=True)
    add_json(parser)

    parser = add(
        "compare",
        "campaigns.campaign_results.compare",
        "list what changed between two folders of results, regressions first",
    )
    parser.option("before", "BEFORE", "folder of results")
    parser.option("after", "AFTER", "folder of results of the same campaign, or of one like it")
    parser.switch("--allow-missing", "runs of BEFORE that AFTER does not have are no failure", dest="may_lack")
    add_json(parser)
    return group


def _read_shard(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise argparse.ArgumentTypeError(f"expected I/N with I from 1 to N, such as 3/50; got {text!r}")
    return int(found[1]), int(found[2])


def _add_file(parser: Parser) -> None:
    parser.option("file", "FILE.toml", "file of the campaign")


def _add_folder(parser: Parser) -> None:
    parser.option("folder", "DIR", "folder of results")


def _add_run(parser: Parser) -> None:
    _add_folder(parser)
    parser.option("number", "RUN", "number of the run", type=make_number(1, 100_000, "the number of a run", int))
    add_json(parser)
