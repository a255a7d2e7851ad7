"""Roles: `follow WAY`, where the one way that roslibpy knows is the `service`."""

from __future__ import annotations

import math
import threading
from typing import Any

import roslibpy
import roslibpy.tf

from tests.end_to_end.clients.program import PATIENCE, run, say


def follow(ros: roslibpy.Ros, way: str) -> None:
    """Drive until the transforms say that the car has moved a metre; where it was, and where its middle was first."""
    assert way == "service"
    client = roslibpy.tf.TFClient(ros, "/map", translation_threshold=0.1, rate=20.0)
    places: list[list[float]] = []
    centers: list[list[float]] = []
    has_moved = threading.Event()

    def note(transform: dict[str, Any]) -> None:
        shift, rotation = transform["translation"], transform["rotation"]
        places.append([*(shift[axis] for axis in "xyz"), *(rotation[part] for part in "xyzw")])
        if math.dist(places[0][:2], places[-1][:2]) > 1.0:
            has_moved.set()

    # `subscribe` adds a frame, then looks whether a request for all frames is due. The library's own thread may send
    # that request in between; then a second one follows, whose first answer tells all places anew, moved or not.
    client.republisher_update_requested = True
    client.subscribe("vehicle_center", lambda transform: centers.append(list(transform["translation"].values())))
    client.subscribe("/base_link", note)
    client.update_goal()
    controls = roslibpy.Topic(ros, "/ctrl_cmd", "morai_msgs/CtrlCmd")
    controls.advertise()
    for _ in range(int(PATIENCE / 0.05)):
        if places:
            controls.publish(roslibpy.Message({"longlCmdType": 1, "accel": 0.6}))
        if has_moved.wait(0.05):
            break
    controls.publish(roslibpy.Message({"longlCmdType": 1, "brake": 1.0}))
    controls.unadvertise()
    client.dispose()
    ros.get_nodes()  # answered after all that was sent before; roslibpy cannot read the time of ROS 2
    say(places=places, first_center=centers[0])


run(follow=follow)
