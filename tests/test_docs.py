"""Pages in `docs/`, README and CONTRIBUTING: what they name exists, each promise names a test, the site is whole."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path

import pytest

from rosbridge_sim.cli.command_table import TOOLS
from rosbridge_sim.shell.config.loading import read_settings
from rosbridge_sim.shell.monitoring.server_topics import TOPICS
from rosbridge_sim.simulator.sync.barrier_table import BarrierEvent
from rosbridge_sim.simulator.sync.sync_table import SYNC_TABLE
from scripts.check_site import find_loads, find_loads_in_css, find_loads_in_html, find_lost_names
from scripts.docs_pages.barrier import EVENTS as BARRIER_EVENTS
from scripts.docs_pages.barrier import list_barrier_edges
from scripts.docs_pages.fields import SERVER_TOPICS, FieldRow, read_fields
from scripts.docs_pages.rooms import (
    LETTER,
    PACKAGE_ROOMS,
    SHELL_ROOMS,
    SIMULATOR_ROOMS,
    WORLD_ROOMS,
    Picture,
    draw_rooms,
    read_arrows,
)
from scripts.docs_pages.sync_mode import list_edges
from scripts.write_docs import GENERATED
from tests.support import ROOT
from tests.test_layers import ARROWS

DOCS = ROOT / "docs"

PAGES = [ROOT / "README.md", ROOT / "README.ko.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]

NAMED_TEST = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")

LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(#[^)\s]*)?\)")

NAMED_FILE = re.compile(r"`((?:rosbridge_sim|scripts|tests|schemas|docs)/[\w./-]+\.(?:py|md|json|txt|sh))`")

FLAG = re.compile(r"(?<![\w-])--[a-z][a-z-]*[a-z](?!-)")

HELD_BY_TESTS = {
    "differences.md": "The table",
    "modelling.md": "What holds each promise",
    "security.md": "What is promised",
    "traffic.md": "What holds each promise",
}
"""Pages of which a section holds nothing without a test, and that section."""

DEFINED_FLAG = re.compile(r"""(?:add(?:_argument|option)\(\s*(?:"-\w", )?"|^    )(--[a-z-]+)(?:"|\)$)""", re.MULTILINE)
"""Definition of a flag in a script, also in one of bash as a case, or in the pytest plugin."""

OTHER_FLAGS = frozenset(
    [
        *("--directory", "--bind", "--name", "--rm", "--build", "--bundle", "--format", "--outfile"),
        *("--break-system-packages", "--system-site-packages"),
    ]
)
"""Flags of `http.server`, docker, esbuild, pip and venv."""

of_each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())


@cache
def functions_of(path: Path) -> frozenset[str]:
    """Names of the functions in a Python file."""
    return frozenset(re.findall(r"(?m)^\s*(?:async )?def (\w+)", path.read_text("utf-8")))


@cache
def anchors_of(page: Path) -> set[str]:
    """Anchors that the headings of a page make, as most renderers form them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def rows_of(page: Path, section: str) -> list[str]:
    """Rows of all tables in a section of a page, without their heads."""
    text = page.read_text("utf-8").partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    return [row for table in tables for row in table.splitlines()[2:]]


def test_docs_have_pages_and_all_pages_with_promises() -> None:
    assert {page.name for page in PAGES} >= set(HELD_BY_TESTS)


@of_each_page
def test_each_file_that_a_page_names_exists(page: Path) -> None:
    for name in NAMED_FILE.findall(page.read_text("utf-8")):
        assert (ROOT / name).is_file(), name


@of_each_page
def test_each_test_that_a_page_names_exists(page: Path) -> None:
    for file, name in NAMED_TEST.findall(page.read_text("utf-8")):
        assert name in functions_of(ROOT / file), f"{file}::{name}"


@pytest.mark.parametrize("name", HELD_BY_TESTS)
def test_each_row_of_a_table_of_promises_names_a_test(name: str) -> None:
    rows = rows_of(ROOT / "docs" / name, HELD_BY_TESTS[name])
    assert rows
    for row in rows:
        cells = [cell.strip() for cell in row.strip().strip("|").split("|")]
        assert all(cells), row
        assert all(NAMED_TEST.fullmatch(one) for one in cells[-1].split(", ")), row


# What it does not do


DENIALS = (
    ("README.md", "What it is not"),
    ("docs/modelling.md", "What is not simulated"),
    ("docs/security.md", "What is not promised"),
    ("docs/guides/page.md", "What it does not do"),
    ("docs/guides/ros2.md", "What does not"),
)
"""Pages and sections whose lists say what is not there."""

LIMITS = re.compile(r"^\*\*(?:Limits of validity|What is not moved)\.\*\* ((?:.+\n)+)", re.MULTILINE)

NO_DENIALS = ("Contacts with them are told", "`tests/world/test_ego_drives.py` holds its bits")
"""Beginnings of sentences among the limits that tell what is there."""


def plain(text: str) -> str:
    """A text of a page on one line, without emphasis and the targets of links."""
    return " ".join(re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text.replace("**", "")).split())


def denials() -> list[str]:
    """First sentences of the lists of what is not there, and all sentences of the limits of validity."""
    found = []
    for name, section in DENIALS:
        text = (ROOT / name).read_text("utf-8").partition(f"\n## {section}\n")[2].partition("\n## ")[0]
        found += [
            re.split(r"[.;](?:\s|$)", plain(one))[0] for one in re.findall(r"^- (.*\n(?:  .*\n)*)", text, re.MULTILINE)
        ]
    for limits in LIMITS.findall((DOCS / "modelling.md").read_text("utf-8")):
        found += [one for one in re.split(r"\.(?:\s|$)", plain(limits)) if one and not one.startswith(NO_DENIALS)]
    return found


def test_each_statement_on_what_is_not_there_has_a_test_or_is_called_untestable() -> None:
    rows = [
        [cell.strip() for cell in row.strip("|").split(" | ")]
        for row in rows_of(DOCS / "differences.md", "What it does not do")
    ]
    for row in rows:
        assert len(row) == 3, row
        assert row[2] == "untestable" or all(NAMED_TEST.fullmatch(one) for one in row[2].split(", ")), row
    assert sorted(row[0] for row in rows) == sorted(denials())


@of_each_page
def test_each_link_of_a_page_has_a_target(page: Path) -> None:
    for target, anchor in LINK.findall(page.read_text("utf-8")):
        linked = page.parent / target if target else page
        assert linked.exists(), target
        assert not anchor or anchor[1:] in anchors_of(linked), anchor


def help_of(words: list[str], command: Callable[[list[str]], object]) -> str:
    """Help of a command, and of the commands below it."""
    out = io.StringIO()
    with redirect_stdout(out), pytest.raises(SystemExit):
        command([*words, "--help"])
    text = out.getvalue()
    below = re.findall(r"^    ([a-z]+) ", text.partition("\ncommands:\n")[2], re.MULTILINE)
    return text + "".join(help_of([*words, name], command) for name in below)


@cache
def known_flags() -> frozenset[str]:
    """Flags in the help of all commands, and those that scripts and the pytest plugin define."""
    helped = help_of([], lambda words: read_settings(words, {}))
    helped += "".join(help_of([], run) for run in TOOLS.values())
    sources = [*(ROOT / "scripts").rglob("*.py"), ROOT / "rosbridge_sim/pytest_plugin.py", ROOT / "scripts/test"]
    defined = {flag for path in sources for flag in DEFINED_FLAG.findall(path.read_text("utf-8"))}
    return frozenset(FLAG.findall(helped)) | defined


@of_each_page
def test_flags_named_by_a_page_exist(page: Path) -> None:
    named = {flag.replace("--no-", "--", 1) for flag in FLAG.findall(page.read_text("utf-8"))}
    assert sorted(named - known_flags() - OTHER_FLAGS) == []


# The site


def test_each_page_is_in_the_navigation_once() -> None:
    nav = (ROOT / "mkdocs.yml").read_text("utf-8").partition("\nnav:\n")[2]
    named = re.findall(r"(\S+\.md)$", nav, re.MULTILINE)
    assert sorted(named) == sorted(page.relative_to(DOCS).as_posix() for page in PAGES if DOCS in page.parents)


@pytest.mark.slow
@pytest.mark.parametrize("name", GENERATED)
def test_generated_file_is_what_the_script_writes(name: str) -> None:
    assert (DOCS / name).read_text("utf-8") == GENERATED[name](), "run python scripts/write_docs.py"


def test_topics_of_the_server_are_all_described() -> None:
    assert set(SERVER_TOPICS) == set(TOPICS)


def test_field_is_read_from_its_line_with_unit_frame_and_remark() -> None:
    text = "# Head.\n\nfloat64 x  # forward, in the vehicle's frame [m]\nint32 count\nint32 ONE=1  # a constant\n"
    assert read_fields(text) == [
        FieldRow("x", "float64", "m", "vehicle", "forward, in the vehicle's frame"),
        FieldRow("count", "int32", "", "", ""),
    ]


@pytest.mark.parametrize("name", ["fields_22.md", "fields_26.md"])
def test_topic_with_the_type_name_of_a_service_shows_fields_of_the_message(name: str) -> None:
    text = (DOCS / "reference" / name).read_text("utf-8")
    topics = text.partition("\n## Topics that the simulator publishes\n")[2].partition("\n## Services\n")[0]
    assert "### /sim/state_hash\n" in topics
    assert "(response)" not in topics


@pytest.mark.parametrize("picture", [PACKAGE_ROOMS, SHELL_ROOMS, SIMULATOR_ROOMS, WORLD_ROOMS])
def test_arrows_between_rooms_are_those_that_are_permitted(picture: Picture) -> None:
    def name(room: str) -> str:  # as the picture has it
        inside = room.removeprefix(picture.folder).lstrip(".")
        return inside.partition(".")[0] or "."

    rooms = [room for room in ARROWS if f"{room}.".startswith(f"{picture.folder}.".lstrip("."))]
    permitted = {(name(room), name(target)) for room in rooms for target in ARROWS[room] if target in rooms}
    shown = {pair for pair in permitted if picture.rooms.keys() >= {*pair} and pair[0] != pair[1]}
    assert read_arrows(ROOT / "rosbridge_sim", picture) == shown


@pytest.mark.parametrize("picture", [PACKAGE_ROOMS, SHELL_ROOMS, SIMULATOR_ROOMS, WORLD_ROOMS])
def test_words_about_a_room_are_within_its_box(picture: Picture) -> None:
    drawing = draw_rooms(ROOT / "rosbridge_sim", picture)
    boxes = re.findall(r'<rect x="\S+" y="(\S+)" width="(\S+)" height="(\S+)".*/>\n((?:<text.*\n?)+)', drawing)
    assert len(boxes) == len(picture.rooms)
    for y, width, height, texts in boxes:
        lines = re.findall(r'y="(\S+)" .*>(.+)</text>', texts)
        assert all(float(y) + 14 < float(at) < float(y) + float(height) - 4 for at, _ in lines)
        assert all(len(line) * LETTER < float(width) for _, line in lines)


@pytest.mark.parametrize("picture", [PACKAGE_ROOMS, SHELL_ROOMS, SIMULATOR_ROOMS, WORLD_ROOMS])
def test_each_arrow_leads_from_a_room_down_to_another(picture: Picture) -> None:
    drawing = draw_rooms(ROOT / "rosbridge_sim", picture)
    places = [(at[0], at[0] + size[0], at[1], at[1] + size[1]) for at, size, _ in picture.rooms.values()]
    arrows = re.findall(r'd="M(\S+),(\S+) Q\S+ (\S+),(\S+)"', drawing)
    assert arrows
    for x1, y1, x2, y2 in (map(float, arrow) for arrow in arrows):
        assert any(left < x1 < right and bottom == y1 for left, right, _, bottom in places)
        assert any(left < x2 < right and top == y2 for left, right, top, _ in places)
        assert y2 > y1


@pytest.mark.parametrize("picture", [PACKAGE_ROOMS, SHELL_ROOMS, SIMULATOR_ROOMS, WORLD_ROOMS])
def test_words_in_a_box_name_all_rooms_that_it_imports(picture: Picture) -> None:
    arrows = read_arrows(ROOT / "rosbridge_sim", picture)
    drawing = draw_rooms(ROOT / "rosbridge_sim", picture)
    boxes = re.findall(r"<rect .*/>\n((?:<text.*\n?)+)", drawing)
    for room, texts in zip(picture.rooms, boxes, strict=True):
        words = " ".join(re.findall(r">([^<]+)</text>", texts)).partition("imports: ")[2]
        if not words.startswith("all rooms below"):
            named = set(words.replace("files beside the rooms", ".").split(", ")) - {"no other room"}
            assert named == {target for source, target in arrows if source == room}


def test_pictures_show_all_rooms() -> None:
    folders = {path.parent.name for path in (ROOT / "rosbridge_sim").glob("*/__init__.py")}
    assert PACKAGE_ROOMS.rooms.keys() == folders
    for picture in (SHELL_ROOMS, SIMULATOR_ROOMS, WORLD_ROOMS):
        there = {room.partition(".")[2] for room in ARROWS if room.startswith(f"{picture.folder}.")}
        assert picture.rooms.keys() == {".", *there}


def test_diagram_of_the_barrier_has_an_arrow_for_each_change_of_state() -> None:
    numbers = re.findall(r">(\d+)</text>", (DOCS / "images" / "barrier.svg").read_text("utf-8"))
    assert sorted(map(int, numbers)) == list(range(1, len(list_barrier_edges()) + 1))
    assert set(BARRIER_EVENTS) == set(BarrierEvent)


def test_diagram_has_an_arrow_for_each_change_of_state() -> None:
    changes = {
        (state, outcome.state)
        for state, outcomes in SYNC_TABLE.items()
        for outcome in outcomes.values()
        if outcome.state is not state
    }
    assert set(list_edges()) == changes
    numbers = re.findall(r">(\d+)</text>", (DOCS / "images" / "sync_mode.svg").read_text("utf-8"))
    assert sorted(map(int, numbers)) == list(range(1, len(changes) + 1))


@pytest.mark.parametrize(
    "text",
    [
        '<script src="https://cdn.example/a.js"></script>',
        '<link rel="stylesheet" href="//fonts.example/a.css">',
        '<link rel="preconnect" href="https://fonts.example">',
        '<img src="http://example/a.png">',
        '<img srcset="a.png 1x, https://example/b.png 2x">',
        '<p style="background: url(https://example/a.png)">',
        "<style>@import 'https://example/a.css';</style>",
        '<svg><image xlink:href="https://example/a.png"/></svg>',
        '<iframe src="HTTPS://example"></iframe>',
    ],
)
def test_load_from_another_host_is_found(text: str) -> None:
    assert len(find_loads_in_html(text)) == 1


@pytest.mark.parametrize(
    "text",
    [
        '<a href="https://example">a link that a person clicks</a>',
        '<link rel="canonical" href="https://example/page">',
        '<script src="assets/a.js"></script>',
        '<img src="data:image/png;base64,AAAA">',
        "<p>https://example in a text, and url(https://example) too</p>",
    ],
)
def test_what_a_browser_does_not_load_is_no_load(text: str) -> None:
    assert find_loads_in_html(text) == []


def test_loads_of_a_style_sheet_are_found() -> None:
    assert find_loads_in_css("@font-face { src: url(//fonts.example/a.woff2) } a { background: url(b.png) }") == [
        "//fonts.example/a.woff2"
    ]


def test_all_files_of_a_site_are_read(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "index.html").write_text("<p>whole</p>")
    (tmp_path / "a" / "b.html").write_text('<img src="https://example/c.png">')
    (tmp_path / "a" / "d.css").write_text("@import url('https://example/e.css');")
    assert list(find_loads(tmp_path)) == [
        "a/b.html: loads https://example/c.png",
        "a/d.css: loads https://example/e.css",
    ]


@pytest.mark.parametrize(
    ("separator", "lost"),
    [
        (r"[\s\-/`,.]+", []),
        (r"[\s\-]+", ["search: expected topics.html among the results of 'Ego_topic', got none there"]),
    ],
)
def test_search_that_keeps_slashes_in_words_is_told(tmp_path: Path, separator: str, lost: list[str]) -> None:
    text = "<p>The ego is on <code>/Ego_topic</code>, 50 Hz.</p>"
    parts = [{"location": "topics.html#egos", "title": "Egos", "text": text}]
    (tmp_path / "search").mkdir()
    index = {"config": {"separator": separator}, "docs": parts}
    (tmp_path / "search" / "search_index.json").write_text(json.dumps(index))
    assert list(find_lost_names(tmp_path, {"Ego_topic": "topics.html"})) == lost
