"""What we use of the DDS library: the contract of its private parts."""

from __future__ import annotations

import ctypes
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from cyclonedds.__library__ import library_path

from rosbridge_sim.errors import GraphError, PeerError
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.ros2.cdr_types import CdrTypes
from rosbridge_sim.graph.ros2.discovery_info import discovery_type
from rosbridge_sim.graph.ros2.ros2_names import dds_topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.ros2.dds_library import FITTING, DdsDomain, DdsTypes, check_library
from tests.graph.bus_fixture import make_store
from tests.shell.ros2.dds_program import domain_of

ON_LOOPBACK = (
    '<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General></Domain></CycloneDDS>"
)


@pytest.fixture
def domain() -> Iterator[DdsDomain]:
    opened = DdsDomain(domain_of(3), ON_LOOPBACK, b"enclave=/;", is_local=True)
    yield opened
    opened.close()


def test_the_pinned_version_is_the_one_that_is_checked() -> None:
    check_library()
    extras = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    (pinned,) = extras["optional-dependencies"]["ros2"]
    assert pinned.startswith(f"cyclonedds=={FITTING};")


@pytest.mark.usefixtures("domain")
def test_warnings_of_the_library_about_messages_of_others_are_not_written() -> None:
    errors_alone = 3
    assert ctypes.CDLL(str(library_path)).dds_get_log_mask() == errors_alone


def test_bytes_that_are_no_message_are_not_sent(domain: DdsDomain) -> None:
    found = CdrTypes(make_store(), make_store(2)).find("std_msgs/String")
    writer = domain.open_writer("rt/words", DdsTypes().make(found.name, found.definitions), Quality(), b"")
    assert writer.write(b"\0\1\0\0\3\0\0\0ab\0")
    assert not writer.write(b"\0\1\0\0\xff\xff\xff\xffab\0")
    assert not writer.write(b"")
    assert len(writer.key) == len(domain.key) == 16


def test_a_topic_that_nobody_uses_is_forgotten(domain: DdsDomain) -> None:
    found = CdrTypes(make_store(), make_store(2)).find("std_msgs/String")
    data_type = DdsTypes().make(found.name, found.definitions)
    for i in range(3):
        writer = domain.open_writer(f"rt/t{i}", data_type, Quality(), b"")
        reader = domain.open_reader(f"rt/t{i}", data_type, Quality(), b"", lambda: None)
        assert domain.num_topics == 1
        writer.close()
        assert domain.num_topics == 1
        reader.close()
        assert domain.num_topics == 0


def test_the_messages_about_nodes_of_each_distribution_are_types(domain: DdsDomain) -> None:
    for distro in ("humble", "jazzy"):
        DdsTypes().make(*discovery_type(distro))
    types = DdsTypes()
    domain.open_writer("ros_discovery_info", types.make(*discovery_type("humble")), Quality(is_latched=True), b"")


def test_a_name_that_dds_does_not_allow_is_an_error_of_its_own(domain: DdsDomain) -> None:
    found = CdrTypes(make_store(), make_store(2)).find("std_msgs/String")
    with pytest.raises(GraphError, match="the DDS library refuses it"):
        domain.open_writer("rt/a b", DdsTypes().make(found.name, found.definitions), Quality(), b"")


@pytest.mark.long
def test_the_library_takes_every_type_and_its_bytes(domain: DdsDomain) -> None:
    store, types = make_store(), DdsTypes()
    cdr_types = CdrTypes(store, make_store(2))
    for name in store.names("msg"):
        try:
            found = cdr_types.find(name)
        except PeerError:  # tests/graph/ros2/test_cdr_types.py names the only one
            continue
        topic = dds_topic("/" + name.replace("/", "_"))
        writer = domain.open_writer(topic, types.make(found.name, found.definitions), Quality(), b"")
        assert writer.write(found.encode(Message(found.type, found.type.default()))), name
