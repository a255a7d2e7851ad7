"""A small client for a rosbridge, in a blocking form (`Client`) and one for asyncio (`AsyncClient`).

    from rosbridge_sim.client import Client

    with Client("ws://127.0.0.1:9090") as client:
        client.start_sync()
        print(client.tick(50).ego["position"])

Both have the same methods. The blocking form runs the asyncio form in its own thread, so each method is written only
once; a test checks that their signatures are equal. The `websockets` library sends and receives the frames.
"""

from __future__ import annotations

from rosbridge_sim.client.async_subscription import AsyncSubscription
from rosbridge_sim.client.asynchronous import DEFAULT_URL, AsyncClient
from rosbridge_sim.client.blocking import Client, Subscription
from rosbridge_sim.client.frames import Frame
from rosbridge_sim.client.results import RealTimeFactor, Snapshot, Steps, Tick
from rosbridge_sim.client.simulator_requests import Command, StopCondition
from rosbridge_sim.client.statuses import Status
from rosbridge_sim.errors import (
    AnswerTimeoutError,
    ClientError,
    ConnectError,
    ConnectionLostError,
    OpRefusedError,
    ServiceRefusedError,
)

__all__ = [
    "DEFAULT_URL",
    "AnswerTimeoutError",
    "AsyncClient",
    "AsyncSubscription",
    "Client",
    "ClientError",
    "Command",
    "ConnectError",
    "ConnectionLostError",
    "Frame",
    "OpRefusedError",
    "RealTimeFactor",
    "ServiceRefusedError",
    "Snapshot",
    "Status",
    "Steps",
    "StopCondition",
    "Subscription",
    "Tick",
]
