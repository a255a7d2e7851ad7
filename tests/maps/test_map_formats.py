from __future__ import annotations

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.map_formats import FORMATS, MAP_FILES, choose_format, find_map_mistakes, is_map, read_map
from tests.simulator.small_maps import ROADRUNNER, read


def test_files_of_a_folder_choose_the_format() -> None:
    for each in FORMATS:
        assert choose_format(each.needed[-1:]) is each
        assert is_map({"readme.txt", each.needed[0]})
        assert set(each.needed) <= set(each.files) <= set(MAP_FILES)


def test_folder_without_a_file_of_any_format_is_no_map() -> None:
    assert not is_map({"readme.txt"})
    with pytest.raises(DocumentError, match=r"node_set\.json is missing"):
        read_map({"readme.txt": b""}, "maps/x")
    assert find_map_mistakes({"readme.txt": b""}, "maps/x") != []


def test_digest_of_a_map_follows_its_content() -> None:
    one, same = read(ROADRUNNER), read(ROADRUNNER)
    assert one is not same
    assert one.digest == same.digest
