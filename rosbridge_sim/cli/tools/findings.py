"""The steps of a check in the terminal: `ros1 check` and `ros2 check`."""

from __future__ import annotations

from collections.abc import Sequence

from rosbridge_sim.cli.tools.text import put, put_json
from rosbridge_sim.graph.gateway.finding import Finding


def put_findings(findings: Sequence[Finding], *, is_json: bool) -> int:
    """Print the result of each step, and return the exit code: 0 if all is well, else 1.

    Args:
        findings: in the order of the steps.
        is_json: print a JSON value.
    """
    if is_json:
        put_json([one._asdict() for one in findings])
    else:
        for i, one in enumerate(findings, 1):
            first, *rest = one.text.splitlines()
            put(f"{i}. {one.step}: {'ok' if one.is_good else 'WRONG'}: {first}")
            for line in rest:
                put(f"   {line}")
            if one.advice:
                put(f"   -> {one.advice}")
    return 0 if all(one.is_good for one in findings) else 1
