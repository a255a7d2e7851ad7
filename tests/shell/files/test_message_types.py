"""Message types that are kept for the next simulators of a process."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.schema.message_type import LateMessageType
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.message_types import MessageTypes, read_types


def test_types_are_kept_for_each_release_and_generation_of_ros() -> None:
    types = MessageTypes()
    _, first = types.read(Settings())
    assert types.read(Settings(seed=3))[1] is first
    assert types.read(Settings(release="26.R1"))[1] is not first
    assert types.read(Settings(ros=2))[1].ros == 2


def test_types_of_a_users_folder_are_read_anew(tmp_path: Path) -> None:
    folder = tmp_path / "own_msgs" / "msg"
    folder.mkdir(parents=True)
    types, settings = MessageTypes(), Settings(schema_path=(str(tmp_path),))
    for field in ("a", "b"):
        (folder / "One.msg").write_text(f"int32 {field}\n")
        _, store = types.read(settings)
        assert [each.name for each in store.message("own_msgs/One").definition.fields] == [field]


def test_mistake_in_a_users_folder_is_told_when_the_type_is_asked_for(tmp_path: Path) -> None:
    folder = tmp_path / "own_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "One.msg").write_text("own_msgs/Gone gone\n")
    _, store = read_types(Settings(schema_path=(str(tmp_path),)))
    with pytest.raises(TypeNameError, match="unknown type own_msgs/Gone"):
        store.message("own_msgs/One")


@pytest.mark.slow
def test_next_simulator_takes_the_types_of_the_one_before() -> None:
    types = MessageTypes()
    stores = []
    for _ in range(2):
        simulator = Simulator(port=0, page=False)
        simulator.types = types
        with simulator:
            assert simulator.bus is not None
            stores.append(simulator.bus.store)
            types_of_services = [service.type for service in simulator.bus.services.values()]
    assert stores[0] is stores[1]
    is_compiled = [
        type(each) is not LateMessageType for kind in types_of_services for each in (kind.request, kind.response)
    ]
    assert not any(is_compiled), "a start compiles types of services"
    assert stores[0].message("morai_msgs/CtrlCmd") is types.read(Settings())[1].message("morai_msgs/CtrlCmd")
