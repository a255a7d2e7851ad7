"""`spawn`: place an object into a running simulator, and show its number."""

from __future__ import annotations

from collections.abc import Mapping

from rosbridge_sim.cli.tools.text import show
from rosbridge_sim.cli.tools.tool_client import Bridge
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.terminal_text import safe

SERVICE = "/sim/spawn"


async def spawn(bridge: Bridge, request: Mapping[str, object], *, is_json: bool) -> None:
    """Place one object, and show the number that it got.

    Args:
        request: the fields of a `rosbridge_sim_msgs/SpawnObject`.

    Raises:
        RefusedError: the simulator says no, or there is none.
        BridgeError: there is no answer.
    """
    values = await bridge.request(SERVICE, {"objects": [request]})
    ids = values.get("unique_ids")
    if values.get("result") is not True or not isinstance(ids, list):
        text = str(values.get("message", "")).removeprefix("objects[0].")
        raise RefusedError(
            safe(text.replace("; /sim/catalogue lists", "; rosbridge-sim service call /sim/catalogue lists"))
        )
    show(values, " ".join(str(number) for number in ids), is_json=is_json)
