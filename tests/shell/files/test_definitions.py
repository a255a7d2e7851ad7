"""Which message definitions are found on the disk, what is refused, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim.errors import DefinitionError, DocumentError
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import MAX_DEFINITION_SIZE, SCHEMAS, Texts, read_definitions
from tests.shell.files.conftest import Lay


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
def test_folder_may_be_a_package_a_set_of_packages_or_a_tree(lay: Lay, layout: str) -> None:
    root = lay({f"shop_msgs/{layout}" if layout.startswith("msg") else layout: "float64 x\n"})
    folder = root / "shop_msgs" if layout.startswith("msg") else root
    assert own(folder) == {("shop_msgs", "msg", "Point"): "float64 x\n"}


def test_messages_and_services_are_read_and_other_files_ignored(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": "int8 a\n", "p/srv/B.srv": "---\n", "p/msg/README.md": "x", "p/CMakeLists.txt": ""})
    assert own(root) == {("p", "msg", "A"): "int8 a\n", ("p", "srv", "B"): "---\n"}


def test_manifest_names_the_package(lay: Lay) -> None:
    root = lay({"my-clone/msg/A.msg": "", "my-clone/package.xml": "<package><name> shop_msgs </name></package>"})
    assert own(root) == {("shop_msgs", "msg", "A"): ""}


def test_user_definition_replaces_a_built_in_one_and_the_last_folder_wins(lay: Lay) -> None:
    root = lay({"a/morai_msgs/msg/CtrlCmd.msg": "int8 a\n", "b/morai_msgs/msg/CtrlCmd.msg": "int8 b\n"})
    texts = read_definitions("22.R2", [root / "a", root / "b"])
    assert texts["morai_msgs", "msg", "CtrlCmd"] == "int8 b\n"
    assert ("morai_msgs", "msg", "EgoVehicleStatus") in texts


def test_user_types_can_be_used(lay: Lay) -> None:
    root = lay({"shop/msg/Basket.msg": "shop/Item[] items\n", "shop/msg/Item.msg": "string name\n"})
    store = Store(read_definitions("22.R2", [root]))
    assert store.message("shop/Basket").encode_json(store.message("shop/Basket").default()) == b'{"items":[]}'


def test_ignored_and_hidden_folders_are_skipped(lay: Lay) -> None:
    root = lay(
        {"p/msg/A.msg": "", "q/msg/A.msg": "", "q/CATKIN_IGNORE": "", "r/COLCON_IGNORE": "", ".git/s/msg/A.msg": ""}
    )
    assert own(root) == {("p", "msg", "A"): ""}


def test_circular_links_end(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": ""})
    (root / "loop").symlink_to(root)
    assert own(root) == {("p", "msg", "A"): ""}


def test_second_definition_of_a_type_in_a_tree_is_ignored_and_logged(
    lay: Lay, caplog: pytest.LogCaptureFixture
) -> None:
    root = lay({"a/p/msg/A.msg": "int8 a\n", "b/p/msg/A.msg": "int8 b\n"})
    assert own(root) == {("p", "msg", "A"): "int8 a\n"}
    assert caplog.messages == [
        f"ignored {root}/b/p/msg/A.msg, because {root}/a/p/msg/A.msg defines the same type; remove one of them"
    ]


def test_old_files_in_latin_1_and_with_a_byte_order_mark_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "p" / "msg"
    folder.mkdir(parents=True)
    (folder / "A.msg").write_bytes(b"float64 angle # [\xb0]\n")
    (folder / "B.msg").write_bytes(b"\xef\xbb\xbffloat64 b\n")
    assert own(tmp_path) == {("p", "msg", "A"): "float64 angle # [°]\n", ("p", "msg", "B"): "float64 b\n"}


def test_error_in_a_definition_names_file_and_line(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": "int8 a\nint8 = 3 = 4\n"})
    with pytest.raises(DefinitionError) as caught:
        own(root)
    assert str(caught.value).startswith(f"{root}/p/msg/A.msg:2:")
    assert caught.value.line == 2


def test_error_in_a_service_names_file_and_line(lay: Lay) -> None:
    root = lay({"p/srv/A.srv": "int8 a\n---\n\nrubbish\n"})
    assert mistake(root).startswith(f"{root}/p/srv/A.srv:4:")


def test_folder_without_definitions_is_refused(lay: Lay) -> None:
    root = lay({"empty/README.md": "", "bad-name/msg/A.msg": "", "file": ""})
    assert mistake(root / "nowhere") == f"{root}/nowhere: expected a folder with ROS packages; there is none"
    assert mistake(root / "file") == f"{root}/file: expected a folder with ROS packages; there is none"
    assert mistake(root / "empty") == (
        f"{root}/empty: expected ROS packages (PACKAGE/msg/Type.msg); found no definition"
    )
    assert "'bad-name' is not a ROS package name" in mistake(root)


def test_oversized_definition_is_refused(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": "#" * (MAX_DEFINITION_SIZE + 1)})
    assert mistake(root) == f"{root}/p/msg/A.msg: expected at most 1,048,576 bytes; it is longer"


def test_file_that_cannot_be_read_is_named(lay: Lay) -> None:
    root = lay({"p/msg/A.msg": ""})
    (root / "p/msg/B.msg").symlink_to(root / "nowhere")
    assert mistake(root) == f"{root}/p/msg/B.msg: cannot be read: No such file or directory"
