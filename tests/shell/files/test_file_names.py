"""Which texts name one file."""

from __future__ import annotations

import pytest

from rosbridge_sim.shell.files.file_names import is_plain_name

DEVICES = ["con", "NUL.json", "Com1", "lpt9.tar.gz", "aux .json", "com\u00b2"]
CUT = ["name.", "name ", "a. ."]


@pytest.mark.parametrize("name", [*DEVICES, *CUT])
def test_names_with_a_meaning_on_windows_are_refused_there_alone(name: str) -> None:
    assert is_plain_name(name, is_windows=False)
    assert not is_plain_name(name, is_windows=True)


@pytest.mark.parametrize("name", ["console", "nullable.json", ".hidden", "한글", "a b.json", "com", "com10"])
def test_names_that_only_look_like_devices_are_taken_everywhere(name: str) -> None:
    assert is_plain_name(name, is_windows=True)


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "a\\b", "a:b", "a\0", "a\nb", "a?"])
def test_what_is_no_name_is_refused_everywhere(name: str) -> None:
    assert not is_plain_name(name, is_windows=False)
    assert not is_plain_name(name, is_windows=True)
