"""README and documentation against the program: the examples run, and the tables name what there is."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from rosbridge_sim.morai.catalogue import CATALOGUE
from rosbridge_sim.morai.releases import FIELD, MANUAL
from rosbridge_sim.shell.files.catalogue_file import read_catalogue
from rosbridge_sim.world.state import Kind
from tests.cli.tool_fixture import run as run_tool
from tests.conftest import Connect, Serve
from tests.support import PATIENCE, ROOT, ServerProcess, require_node_modules, require_tool

README = (ROOT / "README.md").read_text("utf-8")

PAGES = {"README.md": README} | {
    str(path.relative_to(ROOT)): path.read_text("utf-8") for path in sorted((ROOT / "docs").rglob("*.md"))
}
"""README and the pages of the documentation, by path."""

MAX_README_LINES = 250
"""A reader decides in some minutes; everything longer has a page of its own."""

MARKED = re.compile(r"<!-- run: ([\w-]+) -->\n```(\w+)\n(.*?)```\n(?:\n[^\n#`]+:\n\n```text\n(.*?)```\n)?", re.DOTALL)
"""Mark, language and text of an example, and of the block that says what it prints, where there is one."""

NUMBER = re.compile(r"-?\d+\.\d+")


def example(mark: str) -> str:
    """The one script under `<!-- run: mark -->` in README or in the documentation."""
    (script,) = [text for page in PAGES.values() for name, _, text, _ in MARKED.findall(page) if name == mark]
    assert isinstance(script, str)
    return script


def shown(mark: str) -> str:
    """What the page says that this example prints."""
    (text,) = [text for page in PAGES.values() for name, _, _, text in MARKED.findall(page) if name == mark]
    assert isinstance(text, str)
    assert text, mark
    return text


def figures_masked(text: str) -> str:
    """The text with each figure replaced by its number of decimals, for runs in real time."""
    return NUMBER.sub(lambda match: "#" * len(match[0].partition(".")[2]), text)


def page(name: str) -> str:
    """A page of the documentation."""
    return PAGES[f"docs/{name}"]


def at_port(script: str, port: int) -> str:
    """The script, talking to another port than the one it shows."""
    assert script.count("9090") == 1
    return script.replace("9090", str(port))


def run(command: list[str], cwd: Path) -> str:
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=3 * PATIENCE, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout


def run_python(mark: str, port: int, folder: Path) -> str:
    """What a marked Python program prints when it talks to this port."""
    script = folder / f"{mark}.py"
    script.write_text(at_port(example(mark), port))
    return run([sys.executable, str(script)], folder)


@pytest.mark.client
@pytest.mark.slow
@pytest.mark.parametrize("mark", ["python", "tutorial"])
def test_synchronous_programs_print_what_the_page_says_to_the_last_digit(
    serve: Serve, tmp_path: Path, mark: str
) -> None:
    assert run_python(mark, serve().port, tmp_path) == shown(mark)


@pytest.mark.client
@pytest.mark.slow
def test_the_python_program_in_real_time_prints_lines_as_the_page_says(serve: Serve, tmp_path: Path) -> None:
    printed = run_python("roslibpy-drive", serve().port, tmp_path)
    assert figures_masked(printed) == figures_masked(shown("roslibpy-drive"))
    assert printed.splitlines()[-1].startswith("0.0 m/s")


@pytest.mark.client
@pytest.mark.slow
def test_the_javascript_drives_and_brakes(serve: Serve, tmp_path: Path) -> None:
    script = tmp_path / "drive.mjs"
    script.write_text(at_port(example("node"), serve().port))
    (tmp_path / "node_modules").symlink_to(require_node_modules())
    printed = run([require_tool("node"), "--preserve-symlinks", str(script)], tmp_path)
    assert figures_masked(printed) == figures_masked(shown("node"))
    driving, standing = (float(NUMBER.findall(line)[-1]) for line in printed.splitlines())
    assert (driving > 10.0, standing) == (True, 0.0)


@pytest.mark.slow
def test_the_pytest_example_passes(tmp_path: Path) -> None:
    (tmp_path / "test_brakes.py").write_text(example("pytest"))
    plugins = ["-p", "no:cacheprovider", "-p", "no:asyncio"]  # the example needs neither
    printed = run([sys.executable, "-m", "pytest", "-q", *plugins, "test_brakes.py"], tmp_path)
    assert "1 passed" in printed


def test_each_program_in_the_documentation_has_a_mark_and_each_mark_a_test() -> None:
    marks = [name for text in PAGES.values() for name, *_ in MARKED.findall(text)]
    programs = sum(len(re.findall(r"^```(?:python|js|toml|csv)$", text, re.MULTILINE)) for text in PAGES.values())
    tested = {"python", "node", "tutorial", "roslibpy-drive", "pytest", "simulator", "network", "tools", "catalogue"}
    assert sorted(marks) == sorted({*tested, "status-python", "status-node"})
    assert programs == len(marks) - 1, "all but the commands of `tools`, which are sh"


def test_readme_is_short_enough_to_be_read() -> None:
    assert len(README.splitlines()) <= MAX_README_LINES


SHOWN = "error: Message type morai_msgs/CtrlCmd does not have a field acel (did you mean accel?); it has longlCmdType, "


@pytest.mark.client
@pytest.mark.slow
def test_roslibpy_lines_of_the_readme_show_a_status(server: ServerProcess, tmp_path: Path) -> None:
    script = tmp_path / "status.py"
    script.write_text(at_port(example("status-python"), server.port))
    assert run([sys.executable, str(script)], tmp_path).startswith(SHOWN)


@pytest.mark.client
@pytest.mark.slow
def test_roslib_lines_of_the_readme_show_a_status(server: ServerProcess, tmp_path: Path) -> None:
    script = tmp_path / "status.mjs"
    script.write_text(at_port(example("status-node"), server.port))
    (tmp_path / "node_modules").symlink_to(require_node_modules())
    assert run([require_tool("node"), "--preserve-symlinks", str(script)], tmp_path).startswith(SHOWN)


@pytest.mark.slow
def test_in_process_simulator_of_the_readme_runs(tmp_path: Path) -> None:
    script = tmp_path / "simulator.py"
    script.write_text(example("simulator"))
    out = run([sys.executable, str(script)], tmp_path)
    assert re.fullmatch(r"ws://127\.0\.0\.1:\d+/? has \d+ topics\n", out)


@pytest.mark.slow
async def test_network_settings_of_the_readme_work(serve: Serve, connect: Connect, tmp_path: Path) -> None:
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
    assert (answer["result"], answer["values"]) == (False, "Service /sim/reset does not exist")


@pytest.mark.slow
def test_tool_commands_of_the_readme_work(serve: Serve, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ROSBRIDGE_SIM_URL", serve().url)
    monkeypatch.chdir(tmp_path)  # what they write lies there
    for line in example("tools").splitlines():
        program, *words = shlex.split(line)
        done = run_tool(*words)
        is_pub = "pub" in words  # it has nothing to show, but something to say
        assert (program, done.code, bool(done.out), bool(done.err)) == ("rosbridge-sim", 0, not is_pub, is_pub), done


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


def test_model_table_example_is_read(tmp_path: Path) -> None:
    file = tmp_path / "models.csv"
    file.write_text(example("catalogue"))
    car, fridge = read_catalogue(file).own
    assert (car.name, car.body.wheelbase, fridge.name, fridge.kind) == ("Sonata", 2.84, "Fridge", Kind.OBSTACLE)


def test_every_flag_that_a_page_names_exists() -> None:
    flags = {flag for text in PAGES.values() for flag in re.findall(r"`(--[a-z-]+)", text)}
    assert len(flags) > 15
    commands = [
        ["serve"],
        ["topic", "echo"],
        ["topic", "pub"],
        ["service", "call"],
        ["record"],
        ["tick"],
        ["spawn"],
        ["map", "info"],
        ["docs"],
    ]
    helped = "".join(run([sys.executable, "-m", "rosbridge_sim", *words, "--help"], ROOT) for words in commands)
    helped += "".join(run([sys.executable, f"scripts/soak/{name}.py", "--help"], ROOT) for name in ("fuzz", "mixed"))
    assert sorted(flag for flag in flags if not re.search(rf"(?<!\w){flag}\b", helped)) == []
