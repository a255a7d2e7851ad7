"""Formats of scenarios and maps that are not read are called by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.files.other_formats import find_other_format, find_other_formats

XOSC = '<?xml version="1.0"?>\n<!-- <a licence> -->\n<OpenSCENARIO>\n</OpenSCENARIO>'
XODR = "\ufeff<OpenDRIVE><header/></OpenDRIVE>"
NET = '<net version="1.16"/>'


@pytest.mark.parametrize(
    ("name", "content", "form"),
    [
        ("a.xosc", XOSC, "OpenSCENARIO"),
        ("a.json", XOSC, "OpenSCENARIO"),
        ("a.txt", XODR, "OpenDRIVE"),
        ("a.xml", NET, "SUMO net"),
        ("a.net.xml", "", "SUMO net"),
        ("A.XODR", "", "OpenDRIVE"),
        ("a.osm", "<osm/>", "OpenStreetMap"),
        ("a.xml", "<html>", "XML"),
        ("a.xosc", "<", "OpenSCENARIO"),
        ("a.xosc", '{"egoVehicle": 1}', ""),
        ("a.json", "", ""),
        ("demo", "", ""),
        ("a.xodrx", "", ""),
    ],
)
def test_format_is_known_by_content_and_else_by_name(name: str, content: str, form: str) -> None:
    assert find_other_format(name, content.encode()) == form


def test_formats_of_a_folder_are_listed_with_an_example(tmp_path: Path) -> None:
    assert find_other_formats(tmp_path / "gone") == find_other_formats(tmp_path) == ""
    for name in ("b.net.xml", "a.net.xml", "c.xodr", "d.json", "e.osm", "f.xosc"):
        (tmp_path / name).touch()
    assert find_other_formats(tmp_path) == "OpenStreetMap is not read (e.osm); SUMO net is not read (a.net.xml)"


def test_scenario_or_map_in_another_format_is_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "routes.rou.xml"
    path.write_text(NET)
    (tmp_path / "x.json").write_text(NET)
    expected = "expected a scenario of MORAI SIM in JSON, or of OpenSCENARIO"
    library = DiskLibrary([tmp_path])
    for name in (str(path), str(tmp_path / "x.json")):
        with pytest.raises(DocumentError, match=f"{name}: SUMO .* is not read; {expected}"):
            library.opening_file(name)
    for name, form in (("gone.osc", "OpenSCENARIO 2"), ("x", "SUMO net")):
        with pytest.raises(DocumentError, match=f"{form} is not read; {expected}"):
            library.scenario(name)
    (tmp_path / "road.json").write_text(XODR)
    with pytest.raises(DocumentError, match=f"OpenDRIVE is a map, which --map takes; {expected}"):
        library.scenario("road")
    with pytest.raises(DocumentError, match=r"^map 'Town01.osm': OpenStreetMap is not read; expected a folder of MGeo"):
        library.map("Town01.osm")
    for name, content, said in (
        ("a.net.xml", NET, "SUMO net is not read"),
        (
            "a.zip",
            "PK",
            r"expected a folder of MGeo files or an OpenDRIVE .*, or one of hills, .*; got a file",
        ),
    ):
        (tmp_path / name).write_text(content)
        with pytest.raises(DocumentError, match=f"{name}: {said}"):
            DiskLibrary(own_map=str(tmp_path / name)).map("any")
