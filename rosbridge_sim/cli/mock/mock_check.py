"""`mock check`: the mistakes in a mock's file, each with its line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rosbridge_sim.cli.tools.schema import DefinitionSources, open_store, read_texts
from rosbridge_sim.cli.tools.text import put, put_json
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.mock.mock_plan import MockPlan, plan_mock
from rosbridge_sim.shell.mocking.mock_files import DiskMockFiles, read_mock

MAX_SHOWN: Final = 100
"""Mistakes that are shown: a few screens of a terminal."""


def check_files(files: Sequence[str], sources: DefinitionSources, *, is_json: bool) -> int:
    """Print the mistakes of mocks' files, or what is in them.

    Returns:
        1 if a file has mistakes, else 0.

    Raises:
        DocumentError: a setting, or a folder of definitions cannot be used.
    """
    store, texts = open_store(sources), read_texts(sources)
    code = 0
    for file in files:
        path = Path(file)
        plan = None
        try:
            plan, found = plan_mock(read_mock(path), store, DiskMockFiles(path.parent, texts), lambda _text: None)
            mistakes = [mistake.text for mistake in found]
        except DocumentError as error:
            mistakes = [str(error)]
        code = code or int(bool(mistakes))
        if is_json:
            put_json({"file": file, "mistakes": mistakes, "content": {} if plan is None else _count(plan)})
            continue
        for line in mistakes[:MAX_SHOWN]:
            put(safe(line))
        if len(mistakes) > MAX_SHOWN:
            put(f"{safe(file)}: ... and {len(mistakes) - MAX_SHOWN:,} more mistakes")
        if plan is not None:
            content = ", ".join(f"{num:,} {what}" for what, num in _count(plan).items() if num) or "nothing"
            put(f"{safe(file)}: good: {content}")
    return code


def _count(plan: MockPlan) -> dict[str, int]:
    """Return how many things of each kind a mock has."""
    num_recorded = sum(len(recording.tracks) for recording in plan.recordings)
    return {
        "topics": len(plan.document.topics) + num_recorded,
        "subscribers": len(plan.subscribers),
        "services": len(plan.services),
        "actions": len(plan.actions),
        "parameters": len(plan.document.parameters),
        "transforms": len(plan.document.transforms),
        "faults": len(plan.document.faults),
    }
