"""Tables of README and documentation against the program: they name what there is, and the README stays short."""

from __future__ import annotations

import re

from rosbridge_sim.morai.releases import FIELD, MANUAL
from rosbridge_sim.scenarios.catalogue import CATALOGUE
from rosbridge_sim.world.state.world import Kind
from tests.conftest import Connect
from tests.support import ROOT, ServerProcess

README = (ROOT / "README.md").read_text("utf-8")

PAGES = {"README.md": README} | {
    str(path.relative_to(ROOT)): path.read_text("utf-8") for path in sorted((ROOT / "docs").rglob("*.md"))
}
"""README and the pages of the documentation, by path."""

MAX_README_LINES = 250
"""A reader decides in some minutes; everything longer has a page of its own."""


def page(name: str) -> str:
    """A page of the documentation."""
    return PAGES[f"docs/{name}"]


def test_readme_is_short_enough_to_be_read() -> None:
    assert len(README.splitlines()) <= MAX_README_LINES


def rows(header: str) -> list[list[str]]:
    """The cells of the table with that header, without its first two lines."""
    (text,) = [text for text in PAGES.values() if header in text]
    lines = text[text.index(header) :].splitlines()[2:]
    table = lines[: next(i for i, line in enumerate([*lines, ""]) if not line.startswith("|"))]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in table]


def names_in(cell: str) -> list[str]:
    return re.findall(r"`(/[\w/]+)`", cell)


async def test_tables_of_topics_and_services_are_complete(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    node = await client.values("/rosapi/node_details", {"node": "/morai_sim"})
    out: set[str] = set()
    into: set[str] = set()
    types: dict[str, str] = {}
    for names, type_name, direction, _ in rows("| topic | type |"):
        for name in names_in(names):
            types[name] = type_name.strip("`")
            for way in direction.split(", "):
                {"in": into, "out": out}[way].add(name)
    assert out == set(node["subscribing"])
    assert into == set(node["publishing"])
    for name, type_name in types.items():
        assert await client.values("/rosapi/topic_type", {"topic": name}) == {"type": type_name}
    services = {names_in(name)[0]: type_name.strip("`") for name, type_name, _ in rows("| service | type |")}
    assert set(services) == set(node["services"])
    for name, type_name in services.items():
        assert await client.values("/rosapi/service_type", {"service": name}) == {"type": type_name}


def test_table_of_profiles_is_correct() -> None:
    says = {row[1].split()[0].strip("`")[2:].replace("-", "_"): row[2:] for row in rows("| what | flag | `manual`")}
    words = {0: "all", 20: "the 20 nearest"}
    for i, profile in enumerate((MANUAL, FIELD)):
        is_so = {name: getattr(profile, name) for name in says}
        told = {name: words.get(value, str(value).replace("-", ", ")) for name, value in is_so.items()}
        assert {name: cells[i] for name, cells in says.items()} == told


def test_table_of_the_catalogue_is_complete() -> None:
    scenarios = page("reference/scenarios.md")
    lists = scenarios[scenarios.index("## The catalogue") :]
    kinds = {"vehicles": Kind.VEHICLE, "pedestrians": Kind.PEDESTRIAN, "obstacles": Kind.OBSTACLE}
    for label, kind in kinds.items():
        text = lists[lists.index(f"- {label}:") :].partition("\n- ")[0].partition("\n\n")[0]
        assert re.findall(r"`([^`]+)`", text) == [model.name for model in CATALOGUE if model.kind is kind]
