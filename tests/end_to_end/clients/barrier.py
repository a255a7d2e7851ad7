"""Role `member ID NUM_MEMBERS NUM_FRAMES`: tick together with others until the world has moved so far, then leave."""

from __future__ import annotations

import threading
from typing import Any

import roslibpy

from tests.end_to_end.clients.program import PATIENCE, run, say


def member(ros: roslibpy.Ros, user_id: str, num_members: str, num_frames: str) -> None:
    """Join, wait until all have joined, tick, and leave."""
    seen: list[dict[str, Any]] = []
    are_all_here = threading.Event()

    def on_barrier(barrier: dict[str, Any]) -> None:
        seen.append(barrier)
        if len(barrier["members"]) == int(num_members):
            are_all_here.set()

    roslibpy.Topic(ros, "/sim/barrier", "rosbridge_sim_msgs/Barrier").subscribe(on_barrier)
    join = roslibpy.Service(ros, "/sim/barrier/join", "rosbridge_sim_msgs/BarrierJoin")
    leave = roslibpy.Service(ros, "/sim/barrier/leave", "rosbridge_sim_msgs/BarrierLeave")
    tick = roslibpy.Service(ros, "/SyncModeWaitForTick", "morai_msgs/MoraiWaitForTickSrv")
    terms = {"user_id": user_id, "deadline_s": PATIENCE}  # nobody is late, however busy the machine
    joined = join.call(roslibpy.ServiceRequest(terms), timeout=PATIENCE)
    assert are_all_here.wait(PATIENCE)
    frames: list[int] = [joined["frame"]]
    while frames[-1] < joined["frame"] + int(num_frames):
        request = {"user_id": user_id, "frame": frames[-1] + 1}
        answer = tick.call(roslibpy.ServiceRequest({"request": request}), timeout=PATIENCE)["response"]
        assert answer["tick_status"], answer
        frames.append(answer["frame"])
    left = leave.call(roslibpy.ServiceRequest({"user_id": user_id}), timeout=PATIENCE)
    say(
        joined=joined["result"],
        frames=frames,
        left=left["result"],
        groups=list(dict.fromkeys(len(barrier["members"]) for barrier in seen)),
    )


if __name__ == "__main__":
    run(member=member)
