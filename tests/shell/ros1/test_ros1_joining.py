"""Addresses of a node of ROS 1, and settings that cannot be used."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.ros1 import ros1_joining
from rosbridge_sim.shell.ros1.ros1_joining import choose, find_service_text
from tests.shell.ros1.small_ros1 import SmallMaster


@pytest.fixture
async def master() -> AsyncIterator[SmallMaster]:
    master = await SmallMaster().start()
    yield master
    master.server.stop()


async def test_a_node_on_loopback_is_named_by_it(master: SmallMaster, caplog: pytest.LogCaptureFixture) -> None:
    settings = Settings(ros1_master=master.uri, ros1_namespace="/one")
    choices = await choose(settings, {})
    assert (choices.shown_host, choices.host, choices.name) == ("127.0.0.1", "127.0.0.1", "/one/rosbridge_sim")
    assert (await choose(settings, {"ROS_HOSTNAME": "localhost"})).shown_host == "localhost"
    assert not caplog.records
    assert (await choose(settings, {"ROS_IP": "192.0.2.7"})).shown_host == "127.0.0.1"
    assert "ROS_IP is 192.0.2.7, and this node listens on loopback alone" in caplog.text


async def test_variables_name_a_node_that_listens_beyond(master: SmallMaster) -> None:
    settings = Settings(ros1_master=master.uri, ros1_host="0.0.0.0")  # noqa: S104 - nothing listens
    assert (await choose(settings, {"ROS_IP": "192.0.2.7"})).shown_host == "192.0.2.7"
    assert (await choose(settings, {})).shown_host == "127.0.0.1", "from where the master is reached"


async def test_a_remote_master_needs_the_flag() -> None:
    settings = Settings(ros1_master="http://192.0.2.7:11311")
    with pytest.raises(DocumentError, match=r"on another machine, whose nodes cannot reach .* --ros1-host 192"):
        await choose(settings, {})


async def test_the_master_of_the_variable(master: SmallMaster) -> None:
    settings = Settings(ros1_master="env")
    assert (await choose(settings, {"ROS_MASTER_URI": master.uri})).master == master.uri
    for environment in ({}, {"ROS_MASTER_URI": "robot"}):
        with pytest.raises(DocumentError, match="ROS_MASTER_URI: expected http://HOST:PORT"):
            await choose(settings, environment)


async def test_a_token_needs_a_word_more(master: SmallMaster, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"ros1-master: expected no --token.*--ros1-without-token allows it"):
        await Simulator(port=0, world=False, token="a" * 20, ros1_master=master.uri).start()
    options = {"token": "a" * 20, "ros1_without_token": True, "data_dir": tmp_path}
    async with Simulator(port=0, world=False, ros1_master=master.uri, **options):  # type: ignore[arg-type] # of several types
        assert "/rosapi/topics" in master.services


@pytest.mark.parametrize(
    "options",
    [{"ros1_master": "robot:11311"}, {"ros1_master": "http://robot"}, {"ros1_name": ""}, {"ros1_name": "a b"}],
)
def test_settings_that_are_no_addresses_or_names_are_refused(options: dict[str, str]) -> None:
    with pytest.raises(SettingError, match="expected"):
        Simulator(port=0, **options)  # type: ignore[arg-type] # as above


def test_definitions_of_an_installation(tmp_path: Path) -> None:
    (tmp_path / "robots" / "srv").mkdir(parents=True)
    (tmp_path / "robots" / "srv" / "Arm.srv").write_text("---\n")
    environment = {"ROS_PACKAGE_PATH": f"/nowhere:{tmp_path}"}
    assert find_service_text("robots/Arm", environment) == "---\n"
    assert find_service_text("robots/Leg", environment) is None
    assert find_service_text("../etc/Arm", environment) is None
    assert ros1_joining.is_local("localhost")
