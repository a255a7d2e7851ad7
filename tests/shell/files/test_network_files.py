"""Scenarios' network settings on the disk: where they are looked for, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.config.loading import read_settings
from rosbridge_sim.shell.files.network_files import DiskNetworks
from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice, NetworkSettings

TEXT = '[services]\n"/sim/reset" = { on = false }\n'
SETTINGS = NetworkSettings(services={"/sim/reset": InterfaceChoice(is_on=False)})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The folder of networks in a data folder."""
    (tmp_path / "data" / "Network").mkdir(parents=True)
    return tmp_path / "data" / "Network"


@pytest.mark.parametrize("name", ["rush hour", "rush hour.json", "town/rush hour", "town\\rush hour.json"])
def test_network_files_are_found_by_the_last_part_of_the_scenario_name(folder: Path, name: str) -> None:
    (folder / "rush hour.toml").write_text(TEXT)
    assert DiskNetworks(folder.parent).network(name) == SETTINGS


def test_missing_network_file_and_missing_folder_are_fine(folder: Path) -> None:
    assert DiskNetworks(folder.parent).network("demo") is None
    assert DiskNetworks(folder / "nowhere").network("demo") is None
    (folder / "demo.toml").mkdir()
    assert DiskNetworks(folder.parent).network("demo") is None


@pytest.mark.parametrize(
    "name", ["", "..", "../x", "../../etc/x", "/etc/x", "a/b/c", "a\0b", "x" * 300, "한" * 84, "town/.."]
)
def test_name_outside_the_folder_is_refused(folder: Path, name: str) -> None:
    (folder.parent / "x.toml").write_text(TEXT)
    with pytest.raises(DocumentError, match="is not a scenario's name"):
        DiskNetworks(folder.parent).network(name)


def test_link_outside_the_folder_is_refused(folder: Path) -> None:
    (folder.parent / "x.toml").write_text(TEXT)
    (folder / "x.toml").symlink_to(folder.parent / "x.toml")
    with pytest.raises(DocumentError, match=r"'x\.toml' leads out of .*Network"):
        DiskNetworks(folder.parent).network("x")


def test_error_in_a_network_file_names_its_line(folder: Path) -> None:
    (folder / "x.toml").write_text(TEXT + '"/SyncModeCmd" = { of = true }\n')
    with pytest.raises(DocumentError, match=r'x\.toml:3: services\."/SyncModeCmd"\.of: expected one of name, on'):
        DiskNetworks(folder.parent).network("x")


MORAI_TEXT = """{"egoNetworkData": [{"UNIQUEID": 0, "listEgoNetworkInfo": [
  {"PUBSUB_TYPE": 278, "Division_TYPE": 1,
   "config": {"commType": 3, "pubFrequency": 20, "rosConfig": {"Topic": "/things"}}},
  {"PUBSUB_TYPE": 772, "Division_TYPE": 1, "config": {"commType": 1}}]}]}"""


@pytest.mark.parametrize("ending", ["_MN.json", ".json"])
def test_network_file_of_morai_is_read_if_there_is_no_own_one(
    folder: Path, ending: str, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / f"demo{ending}").write_text(MORAI_TEXT)
    network = DiskNetworks(folder.parent).network("demo")
    assert network == NetworkSettings(publishers={"/Object_topic": InterfaceChoice("/things", rate=20.0)})
    assert "not used here: type 772 by UDP" in caplog.text
    (folder / "demo.toml").write_text(TEXT)
    assert DiskNetworks(folder.parent).network("demo") == SETTINGS


def test_config_may_be_a_network_file_of_morai(folder: Path) -> None:
    (folder / "demo.json").write_text(MORAI_TEXT)
    settings = read_settings(["--config", str(folder / "demo.json"), "--rate", "/Ego_topic=5"], {})
    assert settings.publishers["/Object_topic"].name == "/things"
    assert settings.publishers["/Ego_topic"].rate == 5.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "demo.json:1:2: not valid JSON"),
        ("[" * 100_000, "not valid JSON"),
        ("{}", "expected a network file of MORAI with a list egoNetworkData"),
        (MORAI_TEXT.replace("/things", "two words"), r"egoNetworkData\[0\].listEgoNetworkInfo\[0\]: expected the name"),
    ],
)
def test_json_that_is_no_network_file_is_one_line(folder: Path, text: str, words: str) -> None:
    (folder / "demo.json").write_text(text)
    with pytest.raises(DocumentError, match=words):
        DiskNetworks(folder.parent).network("demo")
