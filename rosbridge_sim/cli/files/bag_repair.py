"""`bag repair`: make a bag without an end readable."""

from __future__ import annotations

from pathlib import Path

from rosbridge_sim.cli.tools.text import show
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.shell.bags.repair import Recovered, repair, repaired_name


def repair_bag(file: str, output: str | None, *, is_json: bool) -> None:
    """Write the complete parts of a bag into a new one, and print what was found.

    Args:
        output: the new bag; None uses the default name.

    Raises:
        DocumentError: the bag cannot be read, or the new one cannot be written.
    """
    target = repaired_name(Path(file)) if output is None else Path(output)
    found = repair(Path(file), target)
    show(
        {
            "file": str(target),
            "messages": found.num_messages,
            "start": found.start_ns / 1e9,
            "end": found.end_ns / 1e9,
            "damaged_chunks": found.num_damaged,
            "lost_bytes": found.num_lost_bytes,
            "lost_topics": list(found.lost_topics),
            "was_complete": found.is_complete,
        },
        f"{safe(str(target))}: {_account(found)}",
        is_json=is_json,
    )


def _account(found: Recovered) -> str:
    parts = [f"{found.num_messages:,} messages from {found.start_ns / 1e9:.2f} s to {found.end_ns / 1e9:.2f} s"]
    if found.num_damaged:
        parts.append(f"{found.num_damaged:,} damaged chunks skipped")
    if found.lost_topics:
        parts.append(f"without a readable definition: {', '.join(map(safe, found.lost_topics))}")
    if found.num_lost_bytes:
        parts.append(f"{found.num_lost_bytes:,} bytes at the end were not a complete chunk")
    if found.is_complete and len(parts) == 1:
        parts.append("nothing was missing")
    return "; ".join(parts)
