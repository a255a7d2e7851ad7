"""`schema ...`: the built-in definitions, and those of the user's folders."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.tool_fixture import run
from tests.support import ROOT

SCHEMAS = ROOT / "schemas"


@pytest.fixture
def own(tmp_path: Path) -> str:
    """A folder with a package of the user's."""
    for kind, name, text in (
        ("msg", "Wheel.msg", "# One of four.\nfloat64 angle  # [rad]\n"),
        ("msg", "Car.msg", "Wheel[4] wheels\nstd_msgs/Header header\n"),
        ("srv", "Wheel.srv", "int8 number\n---\nWheel wheel\nCar car\n"),
        ("action", "Drive.action", "float64 far\n---\nbool is_there\n---\nfloat64 left\n"),
    ):
        (tmp_path / "garage_msgs" / kind).mkdir(parents=True, exist_ok=True)
        (tmp_path / "garage_msgs" / kind / name).write_text(text)
    return str(tmp_path)


# list


def test_list_shows_the_types_of_one_package() -> None:
    done = run("schema", "list", "std_srvs")
    assert (done.code, done.err) == (0, "")
    assert done.lines[0].split() == ["TYPE", "KIND"]
    assert ["std_srvs/SetBool", "srv"] in [line.split() for line in done.lines]


def test_list_without_a_package_shows_standard_and_built_in_types() -> None:
    types = [(one["type"], one["kind"]) for one in run("schema", "list", "--json").json]
    assert types == sorted(types)
    wanted = {("sensor_msgs/Imu", "msg"), ("morai_msgs/CtrlCmd", "msg"), ("rosapi/Topics", "srv")}
    assert wanted <= set(types)


def test_list_shows_types_of_the_users_folders(own: str, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = {"garage_msgs/Car": "msg", "garage_msgs/Drive": "action"}
    entries = run("schema", "list", "garage_msgs", "--schema-path", own, "--json").json
    assert wanted.items() <= {one["type"]: one["kind"] for one in entries}.items()
    monkeypatch.setenv("ROSBRIDGE_SIM_SCHEMA_PATH", own)
    monkeypatch.setenv("ROSBRIDGE_SIM_PORT", "none of our business")
    assert run("schema", "list", "garage_msgs", "--json").json == entries


@pytest.mark.parametrize(
    ("words", "code", "line"),
    [
        (("list", "std_srv"), 1, "no package std_srv is known (did you mean std_srvs?)"),
        (("list", "--schema-path", "/nowhere"), 2, "/nowhere: expected a folder with ROS packages; there is none"),
        (("list", "--release", "0.R0"), 2, "--release: expected 22.R2"),
        (("list", "--ros", "3"), 2, "--ros: expected"),
        (("show", "CtrlCmmd"), 1, "no type CtrlCmmd is known (did you mean CtrlCmd?)"),
        (("show", "std_msgs/Sting"), 1, "no type std_msgs/Sting is known (did you mean std_msgs/String?)"),
        (("show", "std_msgs/srv/String"), 1, "no type std_msgs/srv/String is known"),
        (("show", "a/b/c/d"), 1, "a/b/c/d is not a valid type string"),
        (("show", "$"), 1, "no type $ is known"),
    ],
)
def test_usage_error_is_one_line(words: tuple[str, ...], code: int, line: str) -> None:
    done = run("schema", *words)
    assert (done.code, done.out) == (code, "")
    assert done.complaint.startswith(line)


# show


@pytest.mark.parametrize("name", ["campaign", "contract", "mock", "scenario", "sensor_noise", "sensors", "signal_plan"])
def test_file_prints_the_json_schema_of_a_kind_of_files(name: str) -> None:
    done = run("schema", "file", name)
    schema = json.loads(done.out)
    assert (done.code, done.err) == (0, "")
    assert schema["$schema"].endswith("2020-12/schema")
    assert schema["properties"]


def test_file_of_another_kind_is_refused_with_the_nearest_one() -> None:
    done = run("schema", "file", "../scenaro")
    assert done.code != 0
    assert "expected one of campaign, contract, mock, scenario," in done.err
    assert "did you mean scenario?" in run("schema", "file", "scenaro").err
    assert len(run("schema", "file", "a" * 3_000).err) < 250


@pytest.mark.parametrize("name", ["CtrlCmd", "morai_msgs/CtrlCmd", "morai_msgs/msg/CtrlCmd", "morai_msg/CtrlCmd"])
def test_show_prints_the_definition_unchanged(name: str) -> None:
    text = (SCHEMAS / "morai_msgs/22.R2/msg/CtrlCmd.msg").read_text()
    assert run("schema", "show", name).out == text
    account = run("schema", "show", name, "--json").json
    assert account == {"type": "morai_msgs/CtrlCmd", "kind": "msg", "text": text.rstrip("\n")}


@pytest.mark.parametrize("path", sorted(SCHEMAS.glob("std_srvs/srv/*.srv")), ids=lambda path: path.stem)
def test_show_prints_request_and_response_of_a_service(path: Path) -> None:
    shown = run("schema", "show", f"std_srvs/{path.stem}").lines
    assert [line for line in shown if line] == [line for line in path.read_text().splitlines() if line]


def test_show_prints_goal_result_and_feedback_of_an_action(own: str) -> None:
    done = run("schema", "show", "garage_msgs/Drive", "--schema-path", own)
    assert done.out == "float64 far\n---\nbool is_there\n---\nfloat64 left\n"


def test_standard_messages_follow_the_ros_version(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "uint32 seq" in run("schema", "show", "std_msgs/Header").out
    flagged = run("schema", "show", "std_msgs/Header", "--ros", "2").out
    monkeypatch.setenv("ROSBRIDGE_SIM_ROS", "2")
    assert flagged == run("schema", "show", "std_msgs/Header").out
    assert "seq" not in flagged


def test_full_text_contains_each_nested_type_once(own: str) -> None:
    done = run("schema", "show", "garage_msgs/srv/Wheel", "--full", "--schema-path", own)
    parts = done.out.split("=" * 80 + "\n")
    assert parts[:3] == [
        "int8 number\n---\nWheel wheel\nCar car\n",
        "MSG: garage_msgs/Wheel\n# One of four.\nfloat64 angle  # [rad]\n",
        "MSG: garage_msgs/Car\nWheel[4] wheels\nstd_msgs/Header header\n",
    ]
    assert [part.partition("\n")[0] for part in parts[3:]] == ["MSG: std_msgs/Header"]


def test_ambiguous_name_shows_all_matching_types(own: str) -> None:
    done = run("schema", "show", "Wheel", "--schema-path", own)
    assert [line for line in done.lines if line.startswith("[")] == [
        "[garage_msgs/msg/Wheel]",
        "[garage_msgs/srv/Wheel]",
    ]
    accounts = run("schema", "show", "Wheel", "--schema-path", own, "--json").json
    assert [account["kind"] for account in accounts] == ["msg", "srv"]


# typescript


def test_typescript_has_the_types_of_the_users_folder(own: str) -> None:
    done = run("schema", "typescript", "garage_msgs", "--schema-path", own, "--ros", "2")
    assert (done.code, done.err) == (0, "")
    assert "  export interface Car {" in done.lines
    assert "    wheels: Wheel[];" in done.lines


def test_typescript_of_an_unknown_package_names_a_near_one() -> None:
    done = run("schema", "typescript", "morai_msg")
    assert (done.code, done.err) == (1, "rosbridge-sim: no package morai_msg is known (did you mean morai_msgs?)\n")
