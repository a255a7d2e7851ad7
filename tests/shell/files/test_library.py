"""What is found on the disk, what is refused, and what is said of it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rosbridge_sim.errors import DefinitionError, DocumentError
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.library import DATA, MAX_DEFINITION_SIZE, SCHEMAS, DiskLibrary, Texts, read_definitions

Lay = Callable[[dict[str, str]], Path]


@pytest.fixture
def lay(tmp_path: Path) -> Lay:
    """Lays files out in a folder of the test's own."""

    def write(files: dict[str, str]) -> Path:
        for name, text in files.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return tmp_path

    return write


def own(folder: Path) -> Texts:
    """What a folder of the user's adds."""
    builtin = read_definitions("22.R2")
    return {key: text for key, text in read_definitions("22.R2", [folder]).items() if builtin.get(key) != text}


def mistake(folder: Path) -> str:
    with pytest.raises(DocumentError) as caught:
        own(folder)
    text = str(caught.value)
    assert "\n" not in text
    return text


# Definitions


def test_built_in_definitions_are_those_of_the_release() -> None:
    texts = read_definitions("22.R2")
    assert ("morai_msgs", "msg", "CtrlCmd") in texts
    assert ("morai_msgs", "srv", "MoraiWaitForTickSrv") in texts
    assert {package for package, _, _ in texts} >= {"morai_msgs", "rosapi"}
    assert not any(package[0].isdigit() for package, _, _ in texts)
    of_the_release = [path for path in SCHEMAS.rglob("*") if not {"24.R2", "26.R1"} & set(path.parts)]
    assert len(texts) == sum(path.suffix in {".msg", ".srv", ".action"} for path in of_the_release)


@pytest.mark.parametrize(
    "layout",
    [
        "msg/Point.msg",
        "shop_msgs/msg/Point.msg",
        "src/vendor/shop_msgs/msg/Point.msg",
        "shop_msgs/22.R2/msg/Point.msg",
    ],
)
def test_folder_may_be_a_package_or_hold_packages_or_be_a_tree(lay: Lay, layout: str) -> None:
    root = lay({f"shop_msgs/{layout}" if layout.startswith("msg") else layout: "float64 x\n"})
    folder = root / "shop_msgs" if layout.startswith("msg") else root
    assert own(folder) == {("shop_msgs", "msg", "Point"): "float64 x\n"}


def test_messages_and_services_are_both_read_and_other_files_are_not(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": "int8 a\n", "p/srv/B.srv": "---\n", "p/msg/README.md": "x", "p/CMakeLists.txt": ""})
    assert own(root) == {("p", "msg", "A"): "int8 a\n", ("p", "srv", "B"): "---\n"}


def test_manifest_names_the_package(lay: Lay) -> None:
    root = lay({"my-clone/msg/A.msg": "", "my-clone/package.xml": "<package><name> shop_msgs </name></package>"})
    assert own(root) == {("shop_msgs", "msg", "A"): ""}


def test_own_definition_replaces_a_built_in_one_and_the_last_folder_wins(lay: Lay) -> None:
    root = lay({"a/morai_msgs/msg/CtrlCmd.msg": "int8 a\n", "b/morai_msgs/msg/CtrlCmd.msg": "int8 b\n"})
    texts = read_definitions("22.R2", [root / "a", root / "b"])
    assert texts["morai_msgs", "msg", "CtrlCmd"] == "int8 b\n"
    assert ("morai_msgs", "msg", "EgoVehicleStatus") in texts


def test_own_types_can_be_used(lay: Lay) -> None:
    root = lay({"shop/msg/Basket.msg": "shop/Item[] items\n", "shop/msg/Item.msg": "string name\n"})
    store = Store(read_definitions("22.R2", [root]))
    assert store.message("shop/Basket").encode_json(store.message("shop/Basket").default()) == b'{"items":[]}'


def test_marked_and_hidden_folders_are_passed_over(lay: Lay) -> None:
    root = lay(
        {"p/msg/A.msg": "", "q/msg/A.msg": "", "q/CATKIN_IGNORE": "", "r/COLCON_IGNORE": "", ".git/s/msg/A.msg": ""}
    )
    assert own(root) == {("p", "msg", "A"): ""}


def test_links_in_a_circle_end(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": ""})
    (root / "loop").symlink_to(root)
    assert own(root) == {("p", "msg", "A"): ""}


def test_second_definition_of_a_type_in_one_tree_is_ignored_and_told(
    lay: Lay, caplog: pytest.LogCaptureFixture
) -> None:
    root = lay({"a/p/msg/A.msg": "int8 a\n", "b/p/msg/A.msg": "int8 b\n"})
    assert own(root) == {("p", "msg", "A"): "int8 a\n"}
    assert caplog.messages == [f"{root}/b/p/msg/A.msg: ignored, since {root}/a/p/msg/A.msg defines the same type"]


def test_old_files_in_latin_1_and_with_a_byte_order_mark_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "p" / "msg"
    folder.mkdir(parents=True)
    (folder / "A.msg").write_bytes(b"float64 angle # [\xb0]\n")
    (folder / "B.msg").write_bytes(b"\xef\xbb\xbffloat64 b\n")
    assert own(tmp_path) == {("p", "msg", "A"): "float64 angle # [°]\n", ("p", "msg", "B"): "float64 b\n"}


def test_mistake_in_a_definition_is_told_with_file_and_line(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": "int8 a\nint8 = 3 = 4\n"})
    with pytest.raises(DefinitionError) as caught:
        own(root)
    assert str(caught.value).startswith(f"{root}/p/msg/A.msg:2:")
    assert caught.value.line == 2


def test_mistake_in_a_service_is_told_with_file_and_line(lay: Lay) -> None:
    root = lay({"p/srv/A.srv": "int8 a\n---\n\nrubbish\n"})
    assert mistake(root).startswith(f"{root}/p/srv/A.srv:4:")


def test_folder_that_does_not_help_is_refused(lay: Lay) -> None:
    root = lay({"empty/README.md": "", "bad-name/msg/A.msg": "", "file": ""})
    assert mistake(root / "nowhere") == f"{root}/nowhere: expected a folder with ROS packages; there is none"
    assert mistake(root / "file") == f"{root}/file: expected a folder with ROS packages; there is none"
    assert mistake(root / "empty") == (
        f"{root}/empty: expected ROS packages (PACKAGE/msg/Type.msg); found no definition"
    )
    assert "'bad-name' is no name of a ROS package" in mistake(root)


def test_definition_beyond_all_measure_is_refused(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": "#" * (MAX_DEFINITION_SIZE + 1)})
    assert mistake(root) == f"{root}/p/msg/A.msg: expected at most 1,048,576 bytes; it is longer"


def test_file_that_cannot_be_read_is_named(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": ""})
    (root / "p/msg/B.msg").symlink_to(root / "nowhere")
    assert mistake(root) == f"{root}/p/msg/B.msg: cannot be read: No such file or directory"


# Scenarios


@pytest.fixture
def demo() -> str:
    return (DATA / "scenarios" / "demo.json").read_text()


def test_built_in_scenario_is_found_with_and_without_suffix() -> None:
    library = DiskLibrary()
    assert library.scenario("demo").name == library.scenario("demo.json").name == "demo"
    assert "demo" in library.scenario_names()


def test_scenario_is_found_in_the_folders_first_and_in_their_order(lay: Lay, demo: str) -> None:
    root = lay({"a/mine.json": demo, "b/mine.json": "broken", "b/other.json": demo})
    library = DiskLibrary([root / "a", root / "b"])
    library.scenario("mine")
    library.scenario("other.json")
    with pytest.raises(DocumentError, match=r"b/mine\.json"):
        DiskLibrary([root / "b", root / "a"]).scenario("mine")


def test_scenario_is_found_below_its_map(lay: Lay, demo: str) -> None:
    root = lay({"Seoul/one.json": demo, "Busan [old]/two.json": demo})
    library = DiskLibrary([root])
    for name in ("one", "one.json", "Seoul/one", "Seoul\\one.json", "Busan [old]/two", "two"):
        library.scenario(name)
    with pytest.raises(DocumentError, match="no scenario 'Seoul/two'; known are Busan"):
        library.scenario("Seoul/two")


def test_scenario_of_two_maps_is_told(lay: Lay, demo: str, caplog: pytest.LogCaptureFixture) -> None:
    root = lay({"A/one.json": demo, "B/one.json": "broken"})
    DiskLibrary([root]).scenario("one")
    assert caplog.messages == [f"{root}/A/one.json of several scenarios named one.json; MAP/NAME asks for one map's"]


@pytest.mark.parametrize(
    "name",
    [
        "",
        ".",
        "..",
        "../secret",
        "..\\secret",
        "a/../../secret",
        "/etc/passwd",
        "C:\\secret",
        "a/b/c",
        "a//b",
        "a\0b",
        "a\nb",
        "*",
        "x" * 300,
        "한" * 84,
        "한" * 86 + "/x",
        "x" * 199 + "é" * 28 + ".json",
    ],
)
def test_name_that_leads_out_is_refused(lay: Lay, demo: str, name: str) -> None:
    root = lay({"in/mine.json": demo, "secret.json": demo})
    with pytest.raises(DocumentError, match="is no name of a scenario") as caught:
        DiskLibrary([root / "in"]).scenario(name)
    assert "\n" not in str(caught.value)


def test_link_that_leads_out_is_refused(lay: Lay, demo: str) -> None:
    root = lay({"in/mine.json": demo, "out/secret.json": demo})
    (root / "in/link.json").symlink_to(root / "out/secret.json")
    (root / "in/linked").symlink_to(root / "out")
    (root / "in/alias.json").symlink_to(root / "in/mine.json")
    library = DiskLibrary([root / "in"])
    for name in ("link", "secret", "linked/secret"):
        with pytest.raises(DocumentError, match="leads out of --scenario-path"):
            library.scenario(name)
    library.scenario("alias")


def test_unknown_scenario_is_told_with_the_known_ones(lay: Lay, demo: str) -> None:
    root = lay({"mine.json": demo, "Seoul/one.json": demo})
    with pytest.raises(DocumentError, match="no scenario 'nothing'; known are Seoul/one, mine, demo") as caught:
        DiskLibrary([root]).scenario("nothing")
    assert str(caught.value).endswith(", town, and --scenario-path takes a folder")


def test_person_who_starts_the_server_may_name_any_file(lay: Lay, demo: str, monkeypatch: pytest.MonkeyPatch) -> None:
    root = lay({"mine.json": demo, "sub/other": demo})
    monkeypatch.chdir(root)
    library = DiskLibrary()
    for name in ("mine.json", str(root / "mine.json"), "sub/../mine.json", "./sub/other", "demo", "demo.json"):
        library.opening_scenario(name)
    with pytest.raises(DocumentError, match=r"nowhere/x\.json: cannot be read: No such file"):
        library.opening_scenario("nowhere/x.json")
    with pytest.raises(DocumentError, match=r"no scenario 'x\.json'"):
        library.opening_scenario("x.json")


def test_clients_may_load_the_file_that_the_server_was_started_with(lay: Lay, demo: str) -> None:
    empty = json.dumps({"mapInfo": {"mapName": "track"}})
    root = lay({"at/mine.json": demo, "at/other.json": demo, "at/plain": demo, "in/mine.json": empty})
    library = DiskLibrary()
    with pytest.raises(DocumentError, match="no scenario 'mine'"):
        library.scenario("mine")
    library.opening_scenario(str(root / "at/mine.json"))
    assert [library.scenario(name).egos != () for name in ("mine", "mine.json")] == [True, True]
    for name in ("other", "at/mine"):
        with pytest.raises(DocumentError, match=f"no scenario '{name}'; known are mine, demo"):
            library.scenario(name)
    library.opening_scenario(str(root / "at/plain"))
    assert library.scenario("plain").egos != ()
    # A folder that is given for clients comes first.
    library = DiskLibrary([root / "in"])
    library.opening_scenario(str(root / "at/mine.json"))
    assert library.scenario("mine").egos == ()


def test_missing_scenario_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="expected a folder with scenarios; there is none"):
        DiskLibrary([tmp_path / "nowhere"])


# Maps


def test_built_in_map_is_found() -> None:
    assert DiskLibrary().map("track").name == "track"


@pytest.mark.parametrize("name", ["", "..", "nothing", "../maps/track", "/etc", "한" * 86, "a\0b"])
def test_unknown_map_is_told_with_the_known_ones(name: str) -> None:
    with pytest.raises(DocumentError, match=r"no map .*; known are loop, town, track"):
        DiskLibrary().map(name)


def test_own_map_stands_in_for_every_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(DATA / "maps" / "track", tmp_path / "Seoul")
    monkeypatch.chdir(tmp_path)
    for own_map in (str(tmp_path / "Seoul"), "./Seoul", "Seoul"):
        assert DiskLibrary(own_map=own_map).map("anything").name == "Seoul"
    assert DiskLibrary(own_map="track").map("anything").name == "track"
    with pytest.raises(DocumentError, match="no map 'Busan'"):
        DiskLibrary(own_map="Busan").map("track")


def test_map_without_its_files_is_told(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"global_info\.json is missing"):
        DiskLibrary(own_map=str(tmp_path)).map("track")
