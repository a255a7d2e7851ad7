"""Role: `branch [PREFIX]`, where PREFIX stands before the names of types: `srv/` in ROS 2.

The tools of time in a client library: step, snapshot, restore, state hash and score.
"""

from __future__ import annotations

from typing import Any

import roslibpy

from tests.end_to_end.clients.program import PATIENCE, run, say

STEP = {
    "user_id": "program",
    "n": 30,
    "commands": [{"ego": 0, "commands": [{"longlCmdType": 1, "accel": 0.8}]}],
    "topics": ["/Ego_topic"],
}


def branch(ros: roslibpy.Ros, prefix: str = "") -> None:
    """Drive, save, go on, and go on from there twice more: from the name and from the bytes."""

    def call(name: str, kind: str, **request: object) -> Any:  # noqa: ANN401 - of any service
        service = roslibpy.Service(ros, name, kind)
        return service.call(roslibpy.ServiceRequest(request), timeout=PATIENCE)

    def ask(name: str, **request: object) -> Any:  # noqa: ANN401 - of any service
        kind = "".join(word.capitalize() for word in name.split("_"))
        return call(f"/sim/{name}", f"rosbridge_sim_msgs/{prefix}{kind}", **request)

    def mode(*, is_on: bool) -> None:
        request = {"user_id": "program", "start_sync_mode": is_on, "time_step": 20}
        call("/SyncModeCmd", f"morai_msgs/{prefix}MoraiSyncModeCmdSrv", request=request)

    def go_on() -> list[Any]:
        done = ask("step", **STEP)
        return [done["result"], done["steps"], done["frame"], done["topics"][0]["message"], ask("state_hash")["hash"]]

    mode(is_on=True)
    ask("reset", seed=0)
    ask("score", reset=False)
    go_on()
    saved = ask("snapshot", id="here", with_data=True)
    first = go_on()
    restored = [ask("restore", user_id="program", **which)["message"] for which in ({"id": "nowhere"}, {"id": "here"})]
    by_name = go_on()
    restored.append(ask("restore", user_id="program", data=saved["data"])["message"])
    by_bytes = go_on()
    names = [one["id"] for one in ask("snapshots", remove=[])["snapshots"]]
    ask("snapshots", remove=["here"])
    score = ask("score", reset=True)["scores"][0]
    mode(is_on=False)
    say(first=first, by_name=by_name, by_bytes=by_bytes, restored=restored, names=names, distance=score["distance"])


run(branch=branch)
