"""Registrations with a master that does not answer."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import pytest

from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.parameters import Parameters
from rosbridge_sim.graph.ros1.master_parameters import MasterParameters
from rosbridge_sim.graph.ros1.master_view import Registration
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.shell.ros1.registrations import Registrations
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Choices
from tests.shell.ros1.small_ros1 import until

IMU = Registration("Publisher", "/imu")


@pytest.mark.parametrize("is_ending", [False, True])
async def test_a_registration_that_is_broken_off_is_known_at_the_end_alone(*, is_ending: bool) -> None:
    asked: list[asyncio.StreamWriter] = []
    async with await asyncio.start_server(lambda _reader, writer: asked.append(writer), "127.0.0.1", 0) as master:
        uri = f"http://127.0.0.1:{master.sockets[0].getsockname()[1]}"
        choices = Ros1Choices(uri, "/node", "", "127.0.0.1", "127.0.0.1", 1000, Account(1000))
        registrations = Registrations(choices, MasterParameters(Parameters()), OnceLog("test"))
        registrations.uri = registrations.service_uri = "http://127.0.0.1:1/"
        task = asyncio.create_task(registrations.update({IMU: "sensor_msgs/Imu"}))
        await until(lambda: asked)
        registrations.is_ending = is_ending
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        for one in asked:
            one.close()
    assert set(registrations.known) == ({IMU} if is_ending else set())
