"""Workflows, the compose file and the hooks before a commit: they pass their linters, and fit the project."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from rosbridge_sim.shell.config.loading import read_settings
from rosbridge_sim.shell.websocket.origins import OriginRules
from scripts.try_extras import FIRST_USES
from tests.cpu_time import run
from tests.support import ROOT, miss

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))

BIN = ROOT / ".venv" / "bin"


@cache
def load(path: Path) -> Any:  # noqa: ANN401 - whatever the file holds
    return YAML(typ="safe").load(path.read_text("utf-8"))


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    for program in ("zizmor", "check-jsonschema"):
        if not (BIN / program).exists():
            miss(f"needs {program}: pip install -e '.[lint]' (./scripts/test does it)")
    words = [str(folder / "scripts" / "lint_workflows")]
    return run(words)


MISTAKES = [
    (".github/workflows/tests.yml", "runs-on: ubuntu-latest", "runs-on: 3.5"),
    (".github/workflows/image.yml", "=$GITHUB_REF_NAME", "=${{ github.event.pull_request.title }}"),
    (".github/workflows/release.yml", "pypa/gh-action-pypi-publish@", "stranger/publish@"),
    ("scripts/examples/service_container.yml", "services:", "servicse:"),
    ("docker-compose.yml", "restart:", "restrat:"),
]


@pytest.mark.slow
def test_linters_find_a_mistake_in_each_file(tmp_path: Path) -> None:
    for folder in (".github", "scripts"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    shutil.copy(ROOT / "docker-compose.yml", tmp_path)
    (tmp_path / ".venv").symlink_to(ROOT / ".venv")
    for name, old, new in MISTAKES:
        text = (tmp_path / name).read_text()
        assert old in text
        (tmp_path / name).write_text(text.replace(old, new, 1))
    done = lint(tmp_path)
    assert done.returncode == 1
    assert [name for name, _, _ in MISTAKES if name not in done.stdout + done.stderr] == []


def test_tests_run_on_three_systems_and_every_python_that_is_promised() -> None:
    matrix = load(ROOT / ".github" / "workflows" / "tests.yml")["jobs"]["quick"]["strategy"]["matrix"]
    assert [name.partition("-")[0] for name in matrix["os"]] == ["ubuntu", "windows", "macos"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    promised = re.findall(r":: (3\.\d+)$", "\n".join(project["classifiers"]), re.MULTILINE)
    assert matrix["python"] == promised
    assert f">={promised[0]}" == project["requires-python"]


def test_lowest_declared_versions_and_each_extra_alone_have_a_job() -> None:
    jobs = load(ROOT / ".github" / "workflows" / "tests.yml")["jobs"]
    assert set(jobs["extras"]["strategy"]["matrix"]["extra"]) == set(FIRST_USES)
    install = jobs["lowest"]["steps"][2]["run"]
    assert "--resolution lowest-direct" in install
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert jobs["lowest"]["steps"][1]["with"]["python-version"] == project["requires-python"].removeprefix(">=")


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_each_job_has_an_end_and_only_the_rights_that_it_names(path: Path) -> None:
    workflow = load(path)
    assert workflow["permissions"] == {}
    for job in workflow["jobs"].values():
        assert job["timeout-minutes"] <= 90
        assert job["permissions"]


def test_no_file_links_to_a_page_of_a_package_registry() -> None:
    """The project has no such page."""
    folders = ("rosbridge_sim", "docs", ".github")
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in {".py", ".md", ".yml"}]
    paths += [ROOT / name for name in ("README.md", "Dockerfile", "pyproject.toml", "docker-compose.yml")]
    assert [path for path in paths if re.search(r"https?://(www\.)?pypi\b", path.read_text("utf-8"))] == []


def test_release_is_trusted_without_a_secret() -> None:
    path = ROOT / ".github" / "workflows" / "release.yml"
    assert load(path)["jobs"]["publish"]["permissions"] == {"id-token": "write"}
    assert "secrets." not in path.read_text()


@pytest.mark.parametrize("path", [*WORKFLOWS, ROOT / "docker-compose.yml"], ids=lambda path: path.stem)
def test_programs_of_ours_that_they_start_exist(path: Path) -> None:
    for name in re.findall(r"(?<![\w/])\./([\w./]+)", path.read_text()):
        assert (ROOT / name).is_file(), name


def test_composed_service_is_reached_from_this_machine_alone_and_keeps_its_data() -> None:
    compose = load(ROOT / "docker-compose.yml")
    service = compose["services"]["simulator"]
    assert service["ports"] == ["127.0.0.1:9090:9090"]
    (volume,) = service["volumes"]
    name, folder = volume.split(":")
    assert name in compose["volumes"]
    assert f"VOLUME {folder}\n" in (ROOT / "Dockerfile").read_text()


def test_other_services_read_data_by_the_name_of_the_composed_service() -> None:
    """Prometheus beside it scrapes `simulator:9090`, and a page or websocket-client calls it by that name."""
    ((name, service),) = load(ROOT / "docker-compose.yml")["services"].items()
    settings = read_settings([], {key: str(value) for key, value in service["environment"].items()})
    rules = OriginRules(settings.allow_origin, settings.allow_host)
    assert rules.judge_host([f"{name}:9090"], frozenset()) is None
    assert rules.judge_host(["other:9090"], frozenset()) is not None


def test_hooks_before_a_commit_run_what_ci_runs_and_fetch_nothing() -> None:
    (repo,) = load(ROOT / ".pre-commit-config.yaml")["repos"]
    assert repo["repo"] == "local"
    commands = {" ".join(shlex.split(hook["entry"])).removesuffix(" --force-exclude") for hook in repo["hooks"]}
    script = (ROOT / ".ci" / "run").read_text()
    ci = set(re.findall(r"^(?:check|start_beside) ([^#\n]+?) *(?:#.*)?$", script, re.MULTILINE))
    assert commands == ci
    assert {hook["language"] for hook in repo["hooks"]} == {"system"}
