"""Examples of README and documentation: each one runs as it stands there, and prints what the page says.

A mark above the code block, `<!-- run: NAME -->`, gives an example its name. A line that ends with a colon and a block
`text` below it say what it prints. A program without a mark fails a test here, and so does a mark without a test.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import threading
import tomllib
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import NamedTuple

import pytest

from rosbridge_sim.campaigns.campaign import check_search, read_campaign
from rosbridge_sim.cli.contracts.contract_run import read_contract
from rosbridge_sim.client import Client
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.signal_plan_file import set_signal_plan
from rosbridge_sim.shell.config.loading import read_settings
from rosbridge_sim.shell.files.catalogue_file import read_catalogue
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.files.noise_file import read_sensor_noise
from rosbridge_sim.shell.files.rig_file import read_sensors
from rosbridge_sim.world.state.world import Kind
from scripts.draw_docs import read_own_scenario
from tests import fork_server
from tests.cli.tool_fixture import run as run_tool
from tests.conftest import Connect, Serve
from tests.cpu_time import run as run_to_end
from tests.end_to_end.test_browser import open_browser, page_at, until
from tests.support import ROOT, ServerProcess, require_node_modules, require_tool

PAGES = [ROOT / "README.md", *sorted(set((ROOT / "docs").rglob("*.md")) - set((ROOT / "docs" / "ko").rglob("*.md")))]
"""Pages with examples; the Korean ones show the same programs, see `test_korean_pages.py`."""

MARKED = re.compile(r"<!-- run: ([\w-]+) -->\n```(\w+)\n(.*?)```\n(?:\n[^\n#`]+:\n\n```text\n(.*?)```\n)?", re.DOTALL)
"""Mark, language and text of an example, and of the block that says what it prints, where there is one."""

STORY = re.compile(r"<!-- story: .+? -->\n```\w+\n.*?```", re.DOTALL)
"""Stories of `guides/write_scenario.md`, which tests/simulator/story/test_guide_stories.py tells."""

PROGRAM = re.compile(r"^```(?:python|js|html|toml|csv|json)$", re.MULTILINE)
"""Start of a block that must have a mark."""

NUMBER = re.compile(r"-?\d+\.\d+")

EXACT = ("python", "tutorial", "drive", "messages", "step", "score", "barrier")
"""Programs in Python that print the same on every machine, since the world waits for them or no figure is printed."""

TESTS = ("first-test", "fixtures", "unittest", "brakes", "mocks")
"""Files of tests for pytest."""

OTHERS = (
    "node",
    "page",
    "step-node",
    "scene-node",
    "roslibpy-drive",
    "status-python",
    "status-node",
    "simulator",
    "network",
    "tools",
    "doctor",
    "contract",
    "contract-file",
    "signal-plan",
    *(f"web-app-{name}" for name in ("mock", "page", "config", "setup", "spec", "pytest")),
    "catalogue",
    "scenario-ego",
    "scenario-vehicles",
    "scenario-people",
    "scenario-lights",
    "scenario-traffic",
    "scenario-settings",
    "scenario-drive",
    "population",
    "park",
    "sensors",
    "noise",
    "campaign-drivers",
    "campaign-limits",
    "campaign-over-time",
    "campaign-search",
)
"""Examples that have a test of their own here."""


class Example(NamedTuple):
    """An example, as a page shows it."""

    language: str
    script: str
    printed: str


class QuietHandler(SimpleHTTPRequestHandler):
    """A server of files that prints no line for each request."""

    def log_message(self, *_: object) -> None:
        """Say nothing."""


def read_examples() -> dict[str, list[Example]]:
    """Examples of all pages by their mark."""
    examples: dict[str, list[Example]] = {}
    for path in PAGES:
        for mark, *parts in MARKED.findall(path.read_text("utf-8")):
            examples.setdefault(mark, []).append(Example(*parts))
    return examples


def example(mark: str) -> str:
    """The script of the one example with this mark."""
    (found,) = read_examples()[mark]
    return found.script


def shown(mark: str) -> str:
    """What the page says that this example prints."""
    (found,) = read_examples()[mark]
    assert found.printed, mark
    return found.printed


def figures_masked(text: str) -> str:
    """The text with each figure replaced by its number of decimals, for runs in real time."""
    return NUMBER.sub(lambda match: "#" * len(match[0].partition(".")[2]), text)


def at_port(script: str, port: int) -> str:
    """The script, talking to another port than the one it shows."""
    assert script.count("9090") == 1
    return script.replace("9090", str(port))


def run_program(command: list[str], cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """A program that has ended."""
    env = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    return run_to_end(command, cwd=cwd, env=env)


def run(command: list[str], cwd: Path, **variables: str) -> str:
    """Output of a program; it must write nothing to stderr."""
    return output_of(run_program(command, cwd, **variables))


def output_of(done: subprocess.CompletedProcess[str]) -> str:
    """Output of a program that has ended well and said nothing else."""
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    return done.stdout


def run_strictly(script: str, folder: Path) -> str:
    """Output of a Python program in which each warning is an error."""
    return output_of(fork_server.run(["-c", "import warnings; warnings.simplefilter('error')\n" + script], cwd=folder))


def run_python(mark: str, port: int, folder: Path) -> str:
    """What a marked Python program prints when it talks to this port."""
    script = folder / f"{mark}.py"
    script.write_text(at_port(example(mark), port))
    return output_of(fork_server.run([script], cwd=folder))


def node_command(mark: str, port: int, folder: Path) -> list[str]:
    """Command that runs a marked JavaScript program, which talks to this port."""
    script = folder / f"{mark}.mjs"
    script.write_text(at_port(example(mark), port))
    (folder / "node_modules").symlink_to(require_node_modules())
    return [require_tool("node"), "--preserve-symlinks", str(script)]


def run_node(mark: str, port: int, folder: Path) -> str:
    """What a marked JavaScript program prints when it talks to this port."""
    return run(node_command(mark, port, folder), folder)


# Drives


@pytest.mark.client
@pytest.mark.slow
@pytest.mark.parametrize("mark", EXACT)
def test_program_prints_what_the_page_says_to_the_last_digit(serve: Serve, tmp_path: Path, mark: str) -> None:
    assert run_python(mark, serve().port, tmp_path) == shown(mark)


@pytest.mark.slow
def test_objects_come_and_go_in_the_town_as_the_page_says(serve: Serve, tmp_path: Path) -> None:
    port = serve("--scenario", "town", "--start", "sync").port
    assert run_python("population", port, tmp_path) == shown("population")


@pytest.mark.slow
def test_ego_parks_and_leaves_without_a_collision_as_the_page_says(serve: Serve, tmp_path: Path) -> None:
    port = serve("--scenario", "parking", "--start", "sync").port
    assert run_python("park", port, tmp_path) == shown("park")


@pytest.mark.client
@pytest.mark.slow
def test_roslibpy_drive_in_real_time_prints_lines_as_the_page_says(serve: Serve, tmp_path: Path) -> None:
    printed = run_python("roslibpy-drive", serve().port, tmp_path)
    assert figures_masked(printed) == figures_masked(shown("roslibpy-drive"))
    assert printed.splitlines()[-1].startswith("0.0 m/s")


@pytest.mark.client
@pytest.mark.slow
def test_javascript_drive_brakes_and_prints_lines_as_the_page_says(serve: Serve, tmp_path: Path) -> None:
    printed = run_node("node", serve().port, tmp_path)
    assert figures_masked(printed) == figures_masked(shown("node"))
    driving, standing = (float(NUMBER.findall(line)[-1]) for line in printed.splitlines())
    assert (driving > 10.0, standing) == (True, 0.0)


@pytest.mark.client
@pytest.mark.slow
def test_steps_from_javascript_print_what_the_page_says(serve: Serve, tmp_path: Path) -> None:
    assert run_node("step-node", serve().port, tmp_path) == shown("step-node")


@pytest.mark.client
@pytest.mark.slow
def test_scene_from_javascript_prints_what_the_page_says(serve: Serve, tmp_path: Path) -> None:
    assert run_node("scene-node", serve().port, tmp_path) == shown("scene-node")


SHOWN = "error: Message type morai_msgs/CtrlCmd does not have a field acel (did you mean accel?); it has longlCmdType, "


@pytest.mark.client
@pytest.mark.slow
def test_roslibpy_lines_show_a_status(server: ServerProcess, tmp_path: Path) -> None:
    assert run_python("status-python", server.port, tmp_path).startswith(SHOWN)


@pytest.mark.client
@pytest.mark.slow
def test_roslib_lines_show_a_status(server: ServerProcess, tmp_path: Path) -> None:
    assert run_node("status-node", server.port, tmp_path).startswith(SHOWN)


@pytest.mark.client
@pytest.mark.slow
@pytest.mark.parametrize("mark", ["node", "step-node", "scene-node", "status-node"])
def test_javascript_that_finds_no_server_ends_with_a_sentence(tmp_path: Path, mark: str) -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))  # it does not listen, so connections are refused
        done = run_program(node_command(mark, silent.getsockname()[1], tmp_path), tmp_path)
    assert (done.returncode, done.stderr) == (1, "no connection: is the server running?\n")


@pytest.mark.client
@pytest.mark.slow
async def test_web_page_drives_the_car_and_shows_its_speed(serve: Serve, tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text(at_port(example("page"), serve().port))
    shutil.copy(require_node_modules() / "roslib1" / "build" / "roslib.min.js", tmp_path)
    handler = partial(QuietHandler, directory=tmp_path)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as site:
        serving = threading.Thread(target=site.serve_forever, args=(0.01,))
        serving.start()
        try:
            url = f"http://127.0.0.1:{site.server_port}/"
            async with open_browser() as browser, page_at(url, tmp_path, browser) as page:
                await until(page, "at('speed') === '0.0 km/h'")
                await page.click("#drive")
                await until(page, "parseFloat(at('speed')) > 10")
                await page.click("#brake")
                await until(page, "at('speed') === '0.0 km/h'")
        finally:
            site.shutdown()
            serving.join()


# In a process of the user's


@pytest.mark.slow
@pytest.mark.parametrize("mark", TESTS)
def test_tests_on_the_pages_pass(mark: str, tmp_path: Path) -> None:
    (tmp_path / "test_page.py").write_text(example(mark))
    words = ["-m", "pytest", "-q", "-W", "error", "--strict-markers", "-p", "rosbridge_sim.pytest_plugin"]
    words += ["-p", "pytest_asyncio.plugin", "-o", "asyncio_mode=auto"]
    words += ["-o", "asyncio_default_fixture_loop_scope=function", "."]
    env = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    printed = output_of(fork_server.run(words, cwd=tmp_path, env=env))
    assert re.search(r"^\d passed in", printed, re.MULTILINE), printed


@pytest.mark.slow
def test_simulator_without_pytest_runs(tmp_path: Path) -> None:
    printed = run_strictly(example("simulator"), tmp_path)
    assert re.fullmatch(r"<Simulator ws://\S+ scenario='demo' seed=0 running> has \d+ topics\n", printed)


WITHOUT_SERVER = (
    "worlds",
    "gymnasium",
    "own-reward",
    "own-observation",
    "several-egos",
    "copied-environment",
    "cleanrl",
)
"""Programs in Python that need no server."""

WITH_TORCH = ("stable-baselines3",)
"""Programs that need torch; see `environments/test_training_with_torch.py`."""


@pytest.mark.slow
@pytest.mark.parametrize("mark", WITHOUT_SERVER)
def test_program_without_a_server_prints_what_the_page_says(tmp_path: Path, mark: str) -> None:
    if mark != "worlds":
        pytest.importorskip("pettingzoo", reason="the extra rosbridge-sim[gym]")
    assert run_strictly(example(mark), tmp_path) == shown(mark)


# Files and commands


@pytest.mark.slow
async def test_network_settings_work(serve: Serve, connect: Connect, tmp_path: Path) -> None:
    file = tmp_path / "car.toml"
    file.write_text(example("network"))
    client = await connect(serve("--config", str(file)).url)
    await client.send("subscribe", topic="/car/state")
    await client.send("publish", topic="/car/drive", msg={"longlCmdType": 2, "velocity": 30.0})
    moving = await client.message_where("/car/state", lambda status: status["velocity"]["x"] > 0.5)
    following = await client.message("/car/state")
    assert following["header"]["seq"] - moving["header"]["seq"] == 5, "every fifth frame is 10 Hz"
    node = await client.values("/rosapi/node_details", {"node": "/morai_sim"})
    for gone in ("/Ego_topic", "/CollisionData", "/ctrl_cmd", "/sim/reset"):
        assert gone not in node["publishing"] + node["subscribing"] + node["services"]
    answer = await client.call("/sim/reset", {"seed": 1})
    assert answer["result"] is False
    assert answer["values"].startswith("Service /sim/reset does not exist")


@pytest.mark.slow
def test_tool_commands_work(serve: Serve, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ROSBRIDGE_SIM_URL", serve().url)
    monkeypatch.chdir(tmp_path)  # what they write lies there
    for line in example("tools").splitlines():
        program, *words = shlex.split(line)
        done = run_tool(*words)
        is_pub = "pub" in words  # it has nothing to show, but something to say
        assert (program, done.code, bool(done.out), bool(done.err)) == ("rosbridge-sim", 0, not is_pub, is_pub), done


@pytest.mark.slow
def test_doctor_examines_a_server(serve: Serve) -> None:
    for line in example("doctor").splitlines():
        _, *words = shlex.split(line.replace("$ROSBRIDGE_SIM_URL", serve().url))
        done = run_tool(*words)
        assert (done.code, done.err) == (0, "")
        assert "topics/latch" in done.out or "conform" in done.out


@pytest.mark.slow
def test_contract_of_a_server_is_kept(serve: Serve, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    # Rates are those of a busy machine, which may pause in one of the two: any rate is accepted.
    flags = {"record": ("--duration", "0.5", "--tolerance", "1000"), "check": ("--duration", "2")}
    for line in example("contract").splitlines():
        _, *words = shlex.split(line.replace("$ROSBRIDGE_SIM_URL", serve().url))
        done = run_tool(*words, *flags[words[1]])
        assert done.code == 0, done
    assert "testsuite" in (tmp_path / "contract.xml").read_text()


def test_contract_of_a_robot_is_read(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(example("contract-file"))
    contract = read_contract(str(file))
    assert list(contract.topics) == ["/odom", "/scan", "/cmd_vel"]
    assert contract.topics["/scan"].fields["ranges[]"].nan


def test_model_table_is_read(tmp_path: Path) -> None:
    file = tmp_path / "models.csv"
    file.write_text(example("catalogue"))
    car, fridge = read_catalogue(file).own
    assert (car.name, car.body.wheelbase, fridge.name, fridge.kind) == ("Sonata", 2.84, "Fridge", Kind.OBSTACLE)


def test_noise_of_a_file_is_read(tmp_path: Path) -> None:
    file = tmp_path / "noise.json"
    file.write_text(example("noise"))
    noise = read_sensor_noise(str(file))
    assert noise is not None
    assert (noise.gps.horizontal.wander, noise.lidar.range, noise.radar.clutter) == (2.1, 0.015, 1.0)


@pytest.mark.slow
def test_scenario_that_grows_step_by_step_is_good_after_each_and_drives_as_the_page_says(tmp_path: Path) -> None:
    file = tmp_path / "crossing.json"
    scenario: dict[str, object] = {}
    for step in ("ego", "vehicles", "people", "lights", "traffic"):
        scenario |= json.loads(example(f"scenario-{step}"))
        file.write_text(json.dumps(scenario))
        done = run_tool("scenario", "check", str(file))
        assert (done.code, done.err, done.lines[0]) == (0, "", f"{file}: good"), step
    assert scenario == read_own_scenario()  # of the picture
    (tmp_path / "crossing.toml").write_text(example("scenario-settings"))
    settings = read_settings(["--config", str(tmp_path / "crossing.toml")], {})
    assert (settings.weather, settings.traffic, settings.sensors) == ("dusk", 40, "camera")
    assert run_strictly(example("scenario-drive"), tmp_path) == shown("scenario-drive")


def test_sensors_of_a_file_are_read(tmp_path: Path) -> None:
    file = tmp_path / "sensors.toml"
    file.write_text(example("sensors"))
    rig = read_sensors(str(file))
    assert [(spec.frame_id, spec.topic) for spec in rig] == [
        ("gps_link", "/gps"),
        ("imu_link", "/imu"),
        ("Camera-1", "/image_jpeg/compressed"),
        ("Camera-2", "/image_jpeg/compressed"),
        ("velodyne", "/lidar3D"),
        ("radar", "/radar"),
    ]


def test_drivers_limits_and_search_of_a_campaign_are_read() -> None:
    drivers = read_campaign(tomllib.loads(f'scenario = "town"\nseconds = 8\n{example("campaign-drivers")}'), "drivers")
    assert {name: (one.batch, one.real_time) for name, one in drivers.drivers.items()} == {
        "mine": (0, False),
        "fast": (64, False),
        "learned": (0, False),
        "stack": (0, False),
        "slow": (0, True),
    }
    limits = read_campaign(tomllib.loads(f'scenario = "town"\n{example("campaign-limits")}'), "limits")
    assert {each.topic for each in limits.fields} == {"/Ego_topic", "/planner/state"}
    assert list(limits.limits.python) == ["mine"]
    over_time = read_campaign(tomllib.loads(f'scenario = "town"\n{example("campaign-over-time")}'), "over time")
    assert {*over_time.limits.always, *over_time.limits.end} == {"fast", "smooth", "planned"}
    ranges = "[parameters]\ngap = { low = 5, high = 36, num = 32 }\n"
    search = read_campaign(tomllib.loads(f'scenario = "town"\nseconds = 8\n{ranges}{example("campaign-search")}'), "s")
    check_search(search)
    assert search.document.search is not None
    assert search.document.search.budget == 200


def test_signal_plan_of_the_guide_names_a_junction_of_a_map() -> None:
    """It is read to the first thing that the built-in map lacks: the names in it are those of a map of the reader."""
    with pytest.raises(DocumentError, match=r"plan\.json: junctions\.26: .*IntTL0"):
        set_signal_plan(DiskLibrary().map("track"), example("signal-plan").encode(), "plan.json")


def test_each_program_has_a_mark_and_each_mark_a_test() -> None:
    examples = read_examples()
    assert sorted(examples) == sorted([*EXACT, *TESTS, *OTHERS, *WITHOUT_SERVER, *WITH_TORCH])
    assert [mark for mark, found in examples.items() if len(found) > 1] == []
    programs = sum(len(PROGRAM.findall(STORY.sub("", path.read_text("utf-8")))) for path in PAGES)
    assert programs == len(examples) - 4, "all but `tools`, `doctor` and `contract`, which are sh, and `contract-file`"


# Promises of the page about the client


def test_table_of_client_methods_is_complete() -> None:
    text = (ROOT / "docs/client.md").read_text("utf-8")
    cells = re.findall(r"^\|([^|]+)\|", text[text.index("## Methods") :], re.MULTILINE)
    named = set(re.findall(r"`(\w+)", " ".join(cells)))
    methods = {name for name in vars(Client) if not name.startswith("_")}
    assert named >= methods - {"close", "run", "url", "timeout", "is_connected"}
