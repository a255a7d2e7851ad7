"""The committed definitions: all of them parse and compile, and release 22.R2 is what the simulator speaks."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.definitions.parse import Definition, parse_action, parse_message, parse_service
from rosbridge_sim.schema.definitions.standard import standard_names
from rosbridge_sim.schema.store import Store
from tests.schema.strategies import SCHEMAS, read_texts, shared_store
from tests.schema.type_factory import compile_all

FILES = sorted(path for path in SCHEMAS.rglob("*") if path.suffix in {".msg", ".srv", ".action"})

RELEASES = {"22.R2": (52, 12), "26.R1": (91, 19)}
"""How many messages and services each release of MORAI's has."""


def release(name: str) -> list[str]:
    """`msg Name type:field ...` or `srv Name type:field --- type:field`, in wire order, as the release has it."""
    return (Path(__file__).parent / f"morai_{name}.txt").read_text().splitlines()


SERVICES = (Path(__file__).parent / "standard_services.txt").read_text().splitlines()
"""`pkg/Name type:field ... --- type:field` of services of ROS's own packages, constants as `type:NAME=value`.

Sources: Debian's packages of ROS 1 definitions and PyPI's wheels of ROS 2 Kilted, which agree where both have a
service. The three of composition_interfaces are in neither, so nothing confirms them.
"""


def read(path: Path) -> tuple[Definition, ...]:
    name = f"{path.relative_to(SCHEMAS).parts[0]}/{path.stem}"
    text = path.read_text()
    if path.suffix == ".msg":
        return (parse_message(name, text),)
    return parse_service(name, text) if path.suffix == ".srv" else parse_action(name, text)


def test_every_definition_file_starts_with_a_comment_and_is_tidy() -> None:
    for path in FILES:
        text = path.read_text()
        assert text.startswith("# "), path
        assert text.isascii(), path
        assert text.endswith("\n"), path
        assert path.parent.name == path.suffix[1:]
        assert [line for line in text.splitlines() if line != line.rstrip() or "\t" in line] == [], path
        assert read(path), path


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("name", RELEASES)
def test_every_definition_compiles(name: str, ros: Generation) -> None:
    texts = read_texts(name)
    store = Store(texts, ros=ros)
    compile_all(store, texts)
    assert len(store.names("msg")) > 180
    others = [path for path in FILES if "morai_msgs" in path.parts and name not in path.parts]
    assert len(texts) == len(FILES) - len(others)


def test_every_field_of_the_simulators_own_types_has_a_comment() -> None:
    for path in (path for path in FILES if "morai_msgs" in path.parts):
        lines = path.read_text().splitlines()[1:]
        assert all("  # " in line for line in lines if line not in {"", "---"}), path.name


@pytest.mark.parametrize("name", RELEASES)
def test_a_release_has_its_messages_and_services(name: str) -> None:
    names = [" ".join(line.split()[:2]) for line in release(name)]
    assert tuple(sum(one.startswith(kind) for one in names) for kind in ("msg", "srv")) == RELEASES[name]
    found = [f"{kind} {short}" for package, kind, short in read_texts(name) if package == "morai_msgs"]
    assert sorted(found) == sorted(names)


@pytest.mark.parametrize("name", RELEASES)
def test_a_release_has_its_fields_in_wire_order(name: str) -> None:
    for line in release(name):
        kind, short, *expected = line.split()
        found: list[str] = []
        for definition in read(SCHEMAS / "morai_msgs" / name / kind / f"{short}.{kind}"):
            found += ["---"] if definition.name.endswith("Response") and kind == "srv" else []
            for field in definition.fields:
                type_name = field.full_type.removeprefix("morai_msgs/").replace("std_msgs/Header", "Header")
                found.append(f"{type_name}:{field.name}")
            assert not definition.constants, line
        assert found == expected, line


def test_standard_services_are_as_published() -> None:
    for line in SERVICES:
        name, *expected = line.split()
        package, _, short = name.partition("/")
        found: list[str] = []
        for definition in read(SCHEMAS / package / "srv" / f"{short}.srv"):
            found += ["---"] if definition.name.endswith("Response") else []
            found += [f"{each.type}:{each.name}={each.value}" for each in definition.constants]
            for field in definition.fields:
                found.append(f"{field.full_type}:{field.name}" + ("" if field.default is None else f"={field.default}"))
        assert found == expected, name


@pytest.mark.parametrize("ros", [1, 2])
def test_standard_services_have_the_types_of_either_generation(ros: Generation) -> None:
    for line in SERVICES:
        assert shared_store(ros).service(line.split()[0]).response.default() is not None


@pytest.mark.parametrize("ros", [1, 2])
def test_our_standard_messages_equal_those_of_rosbags(ros: Generation) -> None:
    ours, theirs = shared_store(ros), Store({}, ros=ros)
    standard = {*standard_names(1), *standard_names(2)} & {f"{package}/{name}" for package, _, name in read_texts()}
    assert len(standard) > 15
    for name in standard:
        definition = theirs.message(name).definition
        assert ours.message(name).definition.fields == definition.fields, name
        constants = {(c.type, c.name, c.value) for c in ours.message(name).definition.constants}
        assert constants == {(c.type, c.name, c.value) for c in definition.constants}, name
