"""`mock fault`: switch the faults of a running mock, and list them."""

from __future__ import annotations

from collections.abc import Sequence

from rosbridge_sim.cli.tools.text import put_json, put_table
from rosbridge_sim.cli.tools.tool_client import Bridge
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.mock.mock_control import SET_FAULT


async def switch_fault(bridge: Bridge, name: str | None, words: Sequence[str], *, is_json: bool) -> None:
    """Switch a fault, and print all faults.

    Args:
        name: of the fault; None to switch none.
        words: `on`, `off`, or the rule of a new fault, which is on; none for `on`.

    Raises:
        RefusedError: there is no such fault, the rule has a mistake, or no mock runs there.
    """
    rule = "" if list(words) in ([], ["on"], ["off"]) else " ".join(words)
    request = {"name": name or "", "active": list(words) != ["off"], "rule": rule}
    answer = await bridge.request(SET_FAULT, request)
    if answer.get("success") is not True:
        raise RefusedError(safe(str(answer.get("message") or f"{SET_FAULT} refuses without a reason")))
    faults = answer.get("faults") or []
    if is_json:
        put_json(faults)
        return
    put_table(
        ("FAULT", "KIND", "DIRECTION", "NOW", "COUNT", "NAMES", "CLIENTS"),
        [
            (
                *map(safe, (one["name"], one["kind"], one["direction"])),
                "on" if one["active"] else "off",
                str(one["count"]),
                *(safe(" ".join(one[key]) or "all") for key in ("patterns", "clients")),
            )
            for one in faults
        ],
    )
