"""`scenario check`: a report on a scenario file, as text and JSON."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest
from PIL import Image

from rosbridge_sim.cli.files.verdicts import put_verdicts
from tests.cli.tool_fixture import run
from tests.simulator.small_maps import ROADRUNNER
from tests.simulator.story.story_texts import after, event, group, link, routing, speed, story, teleport
from tests.support import ROOT

BUS = " (did you mean Bus?); /sim/catalogue lists all"
CAR = {"UNIQUEID": 7, "DataID": 30200001, "initPosition": {"pos": {"x": 50, "y": 0}}}
SCENE = {
    "version": "1.0",
    "mapInfo": {"mapName": "R_KR_Somewhere"},
    "egoVehicle": {"modelName": "kia k5", "initPosition": {"pos": {"x": 1, "y": 0}}, "gear": 4},
    "vehicleList": [CAR],
    "pedestrianList": [{"pos": {"x": 20, "y": 9}, "speed": 3.6, "movingDistance": 10, "loop": True}],
    "tlList": [{"index": "IntTL13", "state": 1, "deltaTime": 2.5}],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a scenario and a map of the user's."""
    (tmp_path / "mine.json").write_text(json.dumps(SCENE))
    bad = {**SCENE, "vehicleList": [{"initPosition": 1}, CAR], "objectList": [{"pos": {}}]}
    (tmp_path / "bad.json").write_text(json.dumps(bad))
    (tmp_path / "tiny").mkdir()
    for name, content in ROADRUNNER.items():
        (tmp_path / "tiny" / name).write_text(json.dumps(content))
    return tmp_path


def test_scenario_check_describes_a_good_file(folder: Path) -> None:
    done = run("scenario", "check", str(folder / "mine.json"), "--map", str(folder / "tiny"))
    assert (done.code, done.err) == (0, "")
    assert done.lines[0] == f"{folder}/mine.json: 1 remark"
    assert done.lines[1:3] == ["", "remarks:"]
    assert done.lines[3].startswith("  DataID 30200001 (vehicle) is not in the catalogue")
    assert done.lines[4:6] == ["", f"map: R_KR_Somewhere; checked on {folder}/tiny (5 lanes, 4 lights)"]
    assert done.lines[6:10] == ["egoVehicle: 1", "vehicleList: 1", "pedestrianList: 1", "tlList: 1"]
    table = [line.split("  ") for line in done.lines if line.startswith(("egoVehicle ", "vehicleList[0] "))]
    assert [[cell.strip() for cell in row if cell] for row in table] == [
        ["egoVehicle", "2015_Kia_K5", "0", "1.00", "0.00", "0.0", "0", "driven from outside, in drive"],
        ["vehicleList[0]", "Vehicle_30200001 (size by class)", "7", "50.00", "0.00", "0.0", "0", "stands"],
    ]
    assert "path of 2 waypoints, 10 m, repeated" in done.out
    assert "  version (1)" in done.lines


def test_blocks_of_ours_are_a_note_and_no_remark(folder: Path) -> None:
    start = {"initPositionMode": "Link", "initLink": "L2_00"}
    block = {"start_when": {"time": 3}}
    car = {"initPosition": start, "isWaypointMode": False, "rosbridge_sim": block}
    file = folder / "blocks.json"
    file.write_text(json.dumps({"mapInfo": {"mapName": "motorway"}, "vehicleList": [car]}))
    done = run("scenario", "check", str(file), "--strict")
    assert done.lines[:4] == [
        f"{file}: good",
        "",
        "notes:",
        "  rosbridge_sim: blocks: 1, triggers: 1; MORAI SIM ignores this key",
    ]
    assert any(line.endswith("random lanes, at the speed limit, when it is triggered") for line in done.lines)
    block["start_whem"] = block.pop("start_when")
    file.write_text(json.dumps({"mapInfo": {"mapName": "motorway"}, "vehicleList": [car]}))
    done = run("scenario", "check", str(file))
    assert (done.code, done.lines[0]) == (1, f"{file}: 1 mistake")
    assert "(did you mean start_when?)" in done.lines[3]


def test_misspelt_keys_are_the_first_remarks(folder: Path) -> None:
    car = {**CAR, "velocityTyp": 2, "initPositon": 0, "activeDistance": 9}
    (folder / "typo.json").write_text(json.dumps({**SCENE, "vehicleList": [car, car], "pedestrianlist": []}))
    words = ("scenario", "check", str(folder / "typo.json"), "--map", str(folder / "tiny"))
    done = run(*words, "--strict")
    assert (done.code, done.err, run(*words).code) == (1, "", 0)
    assert done.lines[3:6] == [
        "  vehicleList[].velocityTyp (2 times) is no known key and is ignored; did you mean velocityType?",
        "  vehicleList[].initPositon (2 times) is no known key and is ignored; did you mean initPosition?",
        "  pedestrianlist is no known key and is ignored; did you mean pedestrianList?",
    ]
    assert done.lines[6].startswith("  DataID 30200001")
    assert "  pedestrianlist (1) (did you mean pedestrianList?)" in "\n".join(done.lines).replace("version (1), ", "")


def test_file_whose_only_key_is_misspelt_has_a_mistake_and_the_hint(folder: Path) -> None:
    (folder / "typo.json").write_text(json.dumps({"vehiclelist": [CAR]}))
    done = run("scenario", "check", str(folder / "typo.json"))
    assert done.code == 1
    assert done.lines[0].endswith("typo.json: 1 mistake, 1 remark")
    assert done.lines[3].startswith("  expected a scenario with at least one of mapInfo, egoVehicle, vehicleList,")
    assert done.lines[6] == "  vehiclelist is no known key and is ignored; did you mean vehicleList?"


def test_json_output_holds_the_same_facts(folder: Path) -> None:
    account = run("scenario", "check", str(folder / "mine.json"), "--map", str(folder / "tiny"), "--json").json
    assert (account["is_good"], account["mistakes"], len(account["remarks"])) == (False, [], 1)
    assert account["map"] == {
        "name": "R_KR_Somewhere",
        "is_known": True,
        "checked_on": f"{folder}/tiny",
        "lanes": 5,
        "lights": 4,
    }
    assert account["holds"] == {"egoVehicle": 1, "vehicleList": 1, "pedestrianList": 1, "tlList": 1}
    car = account["items"][1]
    assert (car["at"], car["is_replaced"], car["x"], car["way"]) == ("vehicleList[0]", True, 50.0, "stands")
    assert account["phases"] == [{"intersection": "IntTL13", "phase": 1, "elapsed": 2.5}]
    assert account["passed_over"] == {"version": 1}
    assert account["read"]["egoVehicle.gear"] == 1


def test_file_with_errors_lists_them_all_and_gives_exit_code_1(folder: Path) -> None:
    done = run("scenario", "check", str(folder / "bad.json"), "--map", str(folder / "tiny"))
    assert (done.code, done.err) == (1, "")
    assert done.lines[0] == f"{folder}/bad.json: 3 mistakes, 1 remark"
    at = done.lines.index("mistakes:")
    assert at == 2
    assert done.lines[at + 1 : at + 4] == [
        "  vehicleList[0].initPosition: expected an object, got 1",
        "  objectList[0].pos.x: missing",
        "  objectList[0].pos.y: missing",
    ]
    assert any(line.startswith("vehicleList[1]  ") for line in done.lines), "it keeps its number"


def test_unknown_map_is_an_error(folder: Path) -> None:
    done = run("scenario", "check", str(folder / "mine.json"))
    assert done.code == 1
    assert done.lines[0] == f"{folder}/mine.json: 1 mistake, 1 remark"
    known = "hills, loop, motorway, parking, roundabout, town, track"
    assert done.lines[3].startswith(f"  mapInfo.mapName: no map 'R_KR_Somewhere'; known are {known}")
    assert done.lines[3].endswith("and --map takes a folder or a .xodr file. Roads, links and lights were not checked")


def test_strict_turns_remarks_into_exit_code_1(folder: Path) -> None:
    words = ("scenario", "check", str(folder / "mine.json"), "--map", str(folder / "tiny"))
    assert (run(*words).code, run(*words, "--strict").code) == (0, 1)
    assert run("scenario", "check", "demo", "--strict").code == 0


def test_each_of_several_files_gets_its_own_verdict(folder: Path) -> None:
    (folder / "deep" / "er").mkdir(parents=True)
    for path in ("deep/one.json", "deep/er/never.json"):
        (folder / path).write_text(json.dumps({"egoVehicle": None}))
    (folder / "torn.json").write_text("{")
    strays = [{"initPosition": {"pos": {"x": 10 * i, "y": 50}}} for i in range(9)]
    (folder / "strays.json").write_text(json.dumps({"vehicleList": strays}))
    done = run("scenario", "check", str(folder), "demo", "--map", str(folder / "tiny"))
    assert (done.code, done.err) == (1, "")
    files = [line.partition(": ")[0] for line in done.lines if not line.startswith(" ")]
    assert files[:4] == [f"{folder}/{name}.json" for name in ("bad", "deep/one", "mine", "strays")]
    assert done.lines[0].endswith("/bad.json: 3 mistakes, 1 remark")
    assert done.lines[1] == "  mistake: vehicleList[0].initPosition: expected an object, got 1"
    assert f"{folder}/deep/one.json: good" in done.lines
    at = done.lines.index(f"{folder}/strays.json: 9 remarks")
    assert done.lines[at + 6] == "  ... and 4 remarks more; rosbridge-sim scenario check shows all"
    assert done.lines[-1] == "6 files: 1 good, 3 with remarks, 2 with mistakes"
    good = run("scenario", "check", "demo", "town", "--json")
    assert good.code == 0
    assert [json.loads(line)["file"].rpartition("/")[2] for line in good.lines] == ["demo.json", "town.json"]


def test_unreadable_file_among_several_is_an_error_of_that_file_only(folder: Path) -> None:
    done = run("scenario", "check", str(folder / "gone.json"), "demo")
    assert (done.code, done.err) == (1, "")
    assert done.lines[0] == f"{folder}/gone.json: 1 mistake"
    assert done.lines[1] == f"  mistake: {folder}/gone.json: cannot be read: No such file or directory"
    assert done.lines[-1] == "2 files: 1 good, 1 with mistakes"


def test_scenario_name_takes_precedence_over_a_folder_of_that_name(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / "town").mkdir()
    assert run("scenario", "check", "town").lines[0].endswith("town.json: good")
    assert run("scenario", "check", "./town").complaint.startswith("./town: expected a folder with scenarios")
    assert run("scenario", "check", "tiny", "--strict").code == 2, "files of a map are no scenarios"


def test_non_finite_and_huge_numbers_in_keys_without_effect_are_accepted(folder: Path) -> None:
    car = {**CAR, "latBiasMode": 10**40, "destinationMode": float("nan")}
    (folder / "odd.json").write_text(json.dumps({"vehicleList": [car], "pedspawnPointList": [10**40, float("inf")]}))
    account = run("scenario", "check", str(folder / "odd.json"), "--json").json
    assert account["items"][0]["without_effect"] == ["latBiasMode", "destinationMode"]
    assert account["without_effect"] == {
        "vehicleList[].latBiasMode": 1,
        "vehicleList[].destinationMode": 1,
        "pedspawnPointList": 1,
    }


class Terminal(io.StringIO):
    """A terminal that keeps what is shown."""

    def isatty(self) -> bool:
        return True


def test_progress_is_shown_on_the_terminal_when_output_is_redirected(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    reports = {
        "a\x1b[2J.json": {"file": "a", "mistakes": [], "remarks": ["odd"]},
        "b.json": {"file": "b", "mistakes": [], "remarks": []},
    }
    assert put_verdicts("scenario check", list(reports), reports.__getitem__, is_json=True, is_strict=False) == 0
    clear = "\r\x1b[K"
    assert terminal.getvalue() == f"{clear}[1/2] a\\x1b[2J.json{clear}[2/2] b.json{clear}"
    assert put_verdicts("scenario check", list(reports), reports.__getitem__, is_json=True, is_strict=True) == 1


def test_a_scenario_is_found_by_name(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own_map = ("--map", str(folder / "tiny"))
    assert run("scenario", "check", "mine", "--scenario-path", str(folder), *own_map).code == 0
    monkeypatch.setenv("ROSBRIDGE_SIM_SCENARIO_PATH", str(folder))
    monkeypatch.setenv("ROSBRIDGE_SIM_PORT", "none of our business")
    assert run("scenario", "check", "bad").code == 1


@pytest.mark.parametrize(
    "path", sorted((ROOT / "rosbridge_sim/data/scenarios").glob("*.json")), ids=lambda path: path.stem
)
def test_built_in_scenarios_have_no_errors(path: Path) -> None:
    account = run("scenario", "check", path.stem, "--json").json
    assert (account["is_good"], account["mistakes"], account["remarks"]) == (True, [], [])
    assert account["passed_over"] == {}


@pytest.mark.slow
def test_picture_shows_all_entities(folder: Path) -> None:
    path = folder / "mine.png"
    for own_map in ([], ["--map", str(folder / "tiny")]):  # an unknown map is bare ground
        done = run("scenario", "check", str(folder / "mine.json"), *own_map, "--picture", str(path))
        assert (done.code, done.err) == (0 if own_map else 1, "")
        with Image.open(path) as image:
            shown = {colour for _, colour in image.getcolors(2**20) or []}
        for colour in ("#e0007a", "#6a3fb5", "#e06c00"):
            assert tuple(bytes.fromhex(colour[1:])) in shown, colour


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"", "expected a JSON document, got nothing"),
        (b" \n", "expected a JSON document, got nothing"),
        (b"\x7fELF\x02\x00\x00", "expected a JSON document, got a binary file"),
        (json.dumps(SCENE).encode("utf-16"), "expected UTF-8, got UTF-16; save the file as UTF-8"),
        (
            '{"mapInfo": {"mapName": "caf\xe9"}}'.encode("latin-1"),
            "{}:1:29: not UTF-8: byte 0xe9; save the file as UTF-8",
        ),
        (b"[1, 2]", "expected an object, got a list of 2"),
        (b'"hi"', "expected an object, got 'hi'"),
        (b"[" * 100_000, "not JSON: nested too deeply"),
        (b'{"egoVehicle": [1]}', "egoVehicle: expected an object, got a list of 1"),
        (b'{"vehicleList": {"a": 1}}', "vehicleList: expected a list, got an object"),
        (
            b'{"egoVehicle": {"initPosition": {"pos": {"x": "one", "y": "2.5"}}}}',
            "egoVehicle.initPosition.pos.x: expected a number, got 'one'",
        ),
        (
            b'{"egoVehicle": {"initPosition": {"pos": {"x": 1, "y": 2}, "initPositionMode": "Absolut"}}}',
            "egoVehicle.initPosition.initPositionMode: expected Absolute or Link, got 'Absolut'",
        ),
        (
            b'{"egoVehicle": {"initPosition": {"pos": {"x": 1, "y": 2}}, "modelName": "Buss"}}',
            f"egoVehicle.modelName: expected one of the catalogue's vehicles, got 'Buss'{BUS}",
        ),
    ],
)
def test_silly_file_gives_one_readable_line(content: bytes, line: str, tmp_path: Path) -> None:
    path = tmp_path / "silly.json"
    path.write_bytes(content)
    done = run("scenario", "check", str(path))
    assert (done.code, done.err) == (1, "")
    assert done.lines[0] == f"{path}: 1 mistake"
    assert done.lines[3] == f"  {line.format(path)}"


def test_file_that_is_too_long_is_not_parsed(tmp_path: Path) -> None:
    path = tmp_path / "huge.json"
    path.write_bytes(b'{"vehicleList": [' + b" " * 2**25 + b"]}")
    account = run("scenario", "check", str(path), "--json")
    assert account.code == 1
    report = json.loads(account.out)
    assert (report["mistakes"], report["holds"]) == (["expected at most 33,554,432 bytes, got 33,554,451"], {})


def test_picture_that_cannot_be_drawn_is_told(tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text("{")
    done = run("scenario", "check", str(tmp_path / "bad.json"), "--picture", str(tmp_path / "x.png"))
    assert (done.code, done.complaint) == (1, "--picture: nothing is drawn, because the file has mistakes")
    (tmp_path / "node_set.json").write_text("1")
    done = run("map", "info", str(tmp_path), "--picture", str(tmp_path / "x.png"))
    assert (done.code, done.complaint) == (1, "--picture: nothing is drawn, because the map has mistakes")


def test_scenario_in_another_format_is_refused_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "a.rou.xml").write_text("<routes/>")
    done = run("scenario", "check", str(tmp_path / "a.rou.xml"))
    assert (done.code, done.out) == (2, "")
    assert done.complaint.startswith(f"{tmp_path}/a.rou.xml: SUMO routes is not read; expected a scenario of MORAI")
    done = run("scenario", "check", str(tmp_path))
    assert (done.code, done.out) == (2, "")
    assert done.complaint.endswith("; there is none; SUMO routes is not read (a.rou.xml)")


def test_a_story_is_checked_with_its_lines_and_its_places(tmp_path: Path) -> None:
    file = tmp_path / "mine.xosc"
    clothoid = routing("<RandomRouteAction/>")
    events = event("turn", clothoid, after(1)), event("brake", speed(0), after(2))
    file.write_text(
        story({"Ego": teleport(link("L1_00", 20)), "Car": teleport(link("L1_00", 50))}, group("Car", *events))
    )
    done = run("scenario", "check", str(file), "--json")
    account = json.loads(done.out)
    assert (done.code, account["mistakes"]) == (1, ["mine.xosc: line 9: RandomRouteAction is not supported"])
    done = run("scenario", "check", str(file), "--json", "--lenient", "--map", "track")
    account = json.loads(done.out)
    assert (done.code, account["mistakes"], account["ego"]) == (0, [], "Ego")
    assert account["remarks"] == ["mine.xosc: line 9: RandomRouteAction is not supported; left out"]
    assert account["holds"]["Event"] == 1
    assert [(item["at"], item["x"]) for item in account["items"]] == [("Ego", 20.0), ("Car", 50.0)]
    done = run("scenario", "check", str(file), "--lenient", "--map", "track")
    assert "ego: Ego, driven by your program (by the file with --ego story); moved by the story, without" in done.out
    file.write_text(story({"Ego": teleport(link("nowhere", 20))}))
    done = run("scenario", "check", str(file))
    assert "LinkPosition: the map has no link 'nowhere'" in done.out


def test_truncated_file_is_reported_with_line_and_column(folder: Path) -> None:
    (folder / "torn.json").write_text('{"egoVehicle": 1,\n}')
    done = run("scenario", "check", str(folder / "torn.json"))
    assert (done.code, done.err) == (1, "")
    assert done.lines[0] == f"{folder}/torn.json: 1 mistake"
    assert done.lines[3] == f"  {folder}/torn.json:1:17: not JSON: trailing comma"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ((), "scenario: expected a command: check; see rosbridge-sim scenario --help"),
        (("check",), "the following arguments are required: FILE"),
        (
            ("check", "nowhere"),
            "no scenario 'nowhere'; known are demo, hills, loop, motorway, parking, roundabout, rush_hour, town",
        ),
        (("check", "./nowhere.json"), "nowhere.json: cannot be read: No such file or directory"),
        (
            ("check", "demo", "--map", "nowhere"),
            "no map 'nowhere'; known are hills, loop, motorway, parking, roundabout, town, track",
        ),
        (("check", "demo", "--picture", "demo"), "--picture: expected a file such as MAP.png or MAP.jpg; got 'demo'"),
        (("check", "demo", "--scenario-path", "/nowhere"), "/nowhere: expected a folder with scenarios"),
        (("check", "demo", "town", "--picture", "x.png"), "--picture: expected a single scenario to draw, got 2"),
        (
            ("check", "/dev"),
            "/dev: expected a folder with scenarios (*.json or *.xosc, in it or in its subfolders); there is none",
        ),
        (("check", "demo", "--catalogue", "/nowhere.csv"), "/nowhere.csv: cannot be read: No such file or directory"),
    ],
)
def test_usage_error_is_one_line_and_exit_code_2(words: tuple[str, ...], line: str) -> None:
    done = run("scenario", *words)
    assert (done.code, done.out) == (2, "")
    assert done.complaint.startswith(line)
