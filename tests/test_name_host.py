"""The page of a package index: links and addresses name the repository."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from scripts.name_host import absolute_links, main, name_host
from tests.support import ROOT

URL = "https://host.example/owner/name"


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for name in ("README.md", "README.ko.md", "CHANGELOG.md", "CONTRIBUTING.md", "LICENSE", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    for name in ("docs", "scripts", "rosbridge_sim"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def test_every_link_of_the_readme_works_on_the_page_of_an_index(copy: Path) -> None:
    before = re.findall(r"\]\(([^)]+)\)", (copy / "README.md").read_text("utf-8"))
    name_host(copy, URL, "v1.2.3")
    after = re.findall(r"\]\(([^)]+)\)", (copy / "README.md").read_text("utf-8"))
    assert len(after) == len(before)
    assert [link for link in after if not link.startswith("https://") and not link.startswith("#")] == []
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", (copy / "README.md").read_text("utf-8"))
    assert pictures
    assert all(link.startswith(f"{URL}/raw/v1.2.3/docs/") for link in pictures)


def test_project_gets_its_addresses(copy: Path) -> None:
    before = tomllib.loads((copy / "pyproject.toml").read_text("utf-8"))
    name_host(copy, URL, "v1.2.3")
    after = tomllib.loads((copy / "pyproject.toml").read_text("utf-8"))
    assert after["project"].pop("urls")["Source"] == URL
    assert after == before


def test_link_to_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"README\.md: expected a file, got docs/none\.md"):
        absolute_links("[words](docs/none.md)", tmp_path, URL, "v1")


def test_addresses_of_others_and_places_of_the_page_stay() -> None:
    text = "[a](https://other.example/x) [b](#place)"
    assert absolute_links(text, ROOT, URL, "v1") == text


@pytest.mark.parametrize("words", [[], [URL], ["owner/name", "v1"]])
def test_wrong_arguments_are_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    assert capsys.readouterr().err.startswith("name_host.py: expected")
