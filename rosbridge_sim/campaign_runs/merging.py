"""Merging folders of results of one campaign, such as those of its shards."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from rosbridge_sim.campaign_runs.results_folder import ResultsFolder, read_text_of, run_folder
from rosbridge_sim.campaigns.run_results import Result
from rosbridge_sim.errors import DocumentError, file_errors


def merge_folders(folders: Sequence[ResultsFolder], into: ResultsFolder) -> list[Result]:
    """Write the results of some folders into a new one, with the files that are kept.

    Args:
        folders: at least one.
        into: a folder without results; the caller closes it.

    Returns:
        All results, in the order of the table.

    Raises:
        DocumentError: they are not of one campaign, two differ about a run, or the disk takes no more.
    """
    job, _ = read_text_of(folders[0].path)
    found: dict[int, tuple[Result, Path]] = {}
    for folder in folders:
        if read_text_of(folder.path)[0].text != job.text:
            raise DocumentError(f"{folder.title}: expected results of the same campaign as {folders[0].title}")
        for result in folder.results():
            there = found.setdefault(result.run.number, (result, folder.path))
            if _decided(there[0]) != _decided(result):
                raise DocumentError(f"{folder.title}: run {result.run.number} ended in another way than in {there[1]}")
    into.begin(job, is_resumed=False)
    results = [found[number] for number in sorted(found)]
    for result, path in results:
        source, target = run_folder(path, result.run.number), run_folder(into.path, result.run.number)
        kept = [file for file in source.iterdir() if file.name in result.files] if source.is_dir() else []
        with file_errors(target, "written"):
            for file in kept:
                target.mkdir(parents=True, exist_ok=True)
                shutil.copy2(file, target / file.name)
        if trouble := into.append(result):
            raise DocumentError(f"{into.path}: results could not be written: {trouble}")
    return [result for result, _ in results]


def _decided(result: Result) -> tuple[object, ...]:
    """Return the parts of a result that are equal on every machine that drives the run."""
    return result.run, result.verdict, result.reason, result.scores, result.state_hash
