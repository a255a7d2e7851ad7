"""The committed definitions: all of them parse and compile, and release 22.R2 is what the simulator speaks."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim.schema.parse import Definition, parse_action, parse_message, parse_service
from rosbridge_sim.schema.store import Store
from tests.schema.strategies import SCHEMAS, read_texts, shared_store

FILES = sorted(path for path in SCHEMAS.rglob("*") if path.suffix in {".msg", ".srv", ".action"})

RELEASE = (Path(__file__).parent / "morai_22.R2.txt").read_text().splitlines()
"""`msg Name type:field ...` or `srv Name type:field --- type:field`, in wire order, as the release has it."""


def read(path: Path) -> tuple[Definition, ...]:
    name = f"{path.relative_to(SCHEMAS).parts[0]}/{path.stem}"
    text = path.read_text()
    if path.suffix == ".msg":
        return (parse_message(name, text),)
    return parse_service(name, text) if path.suffix == ".srv" else parse_action(name, text)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_starts_with_what_it_is_and_is_tidy(path: Path) -> None:
    text = path.read_text()
    assert text.startswith("# ")
    assert text.isascii()
    assert text.endswith("\n")
    assert path.parent.name == path.suffix[1:]
    assert all(line == line.rstrip() and "\t" not in line for line in text.splitlines())
    assert read(path)


def test_every_definition_compiles() -> None:
    store = Store(read_texts())
    store.verify()
    assert len(store.names("msg")) > 180
    assert len(read_texts()) == len(FILES)


def test_every_field_of_the_simulator_says_what_it_is() -> None:
    for path in (path for path in FILES if "morai_msgs" in path.parts):
        lines = path.read_text().splitlines()[1:]
        assert all("  # " in line for line in lines if line not in {"", "---"}), path.name


def test_the_release_has_its_messages_and_services() -> None:
    assert len([line for line in RELEASE if line.startswith("msg ")]) == 52
    assert len([line for line in RELEASE if line.startswith("srv ")]) == 12
    names = sorted(f"{line.split()[0]} {line.split()[1]}" for line in RELEASE)
    assert sorted(f"{kind} {name}" for package, kind, name in read_texts() if package == "morai_msgs") == names


@pytest.mark.parametrize("line", RELEASE, ids=lambda line: str(line.split()[1]))
def test_the_release_has_its_fields_in_wire_order(line: str) -> None:
    kind, name, *expected = line.split()
    found: list[str] = []
    for definition in read(SCHEMAS / "morai_msgs" / "22.R2" / kind / f"{name}.{kind}"):
        found += ["---"] if definition.name.endswith("Response") and kind == "srv" else []
        for field in definition.fields:
            short = field.full_type.removeprefix("morai_msgs/").replace("std_msgs/Header", "Header")
            found.append(f"{short}:{field.name}")
        assert not definition.constants
    assert found == expected


@pytest.mark.parametrize(
    "name", ["std_msgs/Header", "geometry_msgs/TransformStamped", "rosgraph_msgs/Clock", "geometry_msgs/Twist"]
)
def test_standard_messages_of_ours_are_those_of_rosbags(name: str) -> None:
    theirs = Store({}).message(name).definition
    assert shared_store().message(name).definition.fields == theirs.fields
    for field in theirs.fields:
        if "/" in field.type:
            test_standard_messages_of_ours_are_those_of_rosbags(field.type)
