"""The wheel runs in its own environment, as an ordinary user, as the Dockerfile starts it."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from email import message_from_bytes
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Final
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from rosbridge_sim import __version__
from rosbridge_sim.shell.config.settings import Settings
from scripts.try_extras import FIRST_USES
from tests.conftest import Connect
from tests.support import ROOT, miss, read_line

pytestmark = pytest.mark.slow

MINUTE = 60.0
"""[s]"""

NOBODY = 65_534
"""The ordinary user and group of whoever has the rights to choose one."""


# The Dockerfile


def dockerfile() -> str:
    """Return the Dockerfile with an instruction a line."""
    return (ROOT / "Dockerfile").read_text().replace("\\\n", " ")


def instruction(name: str) -> str:
    """What stands behind an instruction of the Dockerfile that is there once."""
    found = re.findall(rf"^{name}\s+(.*)$", dockerfile(), re.MULTILINE)
    assert len(found) == 1, f"{name}: {found}"
    return str(found[0])


def command_of(text: str) -> list[str]:
    """The words of a CMD in its exec form."""
    words = json.loads(text.removeprefix("CMD "))
    assert isinstance(words, list)
    assert all(isinstance(word, str) for word in words)
    return words


def environment() -> dict[str, str]:
    """The ENV of the image."""
    return dict(word.split("=", 1) for word in instruction("ENV").split())


def health_check() -> list[str]:
    """The words of the health check, without its times."""
    return command_of(re.sub(r"^(--\S+\s+)*", "", instruction("HEALTHCHECK")))


def image_command(*words: str) -> list[str]:
    """What `docker run IMAGE` runs, or `docker run IMAGE words`."""
    return [*command_of(instruction("ENTRYPOINT")), *(words or command_of(instruction("CMD")))]


def test_image_listens_on_all_addresses_at_its_exposed_port_as_an_ordinary_user() -> None:
    settings = environment()
    assert settings["ROSBRIDGE_SIM_HOST"] == "0.0.0.0"  # noqa: S104 - an image is of no use otherwise
    assert settings["ROSBRIDGE_SIM_PORT"] == instruction("EXPOSE") == str(Settings().port)
    assert instruction("USER") not in {"root", "0"}


def test_image_has_a_volume_that_its_user_owns_and_the_server_writes_to() -> None:
    (folder,) = instruction("VOLUME").split()
    assert environment()["ROSBRIDGE_SIM_DATA_DIR"] == folder
    user = instruction("USER")
    (made,) = [line for line in dockerfile().splitlines() if "useradd" in line]
    assert f"--uid {user} " in made
    assert f"install --directory --owner={user} --group={user} {folder}" in made


def test_image_says_what_it_is_in_labels_of_oci() -> None:
    labels = dict(re.findall(r'org\.opencontainers\.image\.(\w+)="([^"]*)"', instruction("LABEL")))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert labels == {
        "title": project["name"],
        "description": project["description"],
        "licenses": project["license"],
        "authors": project["authors"][0]["name"],
        "version": "${VERSION}",
        "revision": "${REVISION}",
    }
    for name in ("VERSION", "REVISION"):
        assert re.search(rf"^ARG {name}=\w+$", dockerfile(), re.MULTILINE)


def test_page_tells_how_to_build_an_image_that_keeps_the_health_check() -> None:
    assert health_check()
    page = (ROOT / "docs" / "operation.md").read_text("utf-8")
    assert "`HEALTHCHECK`" in page
    assert "podman build --format docker" in page  # the OCI format, their default, has no field for it


def test_what_the_image_is_built_from_is_in_its_context() -> None:
    ignore = (ROOT / ".dockerignore").read_text().splitlines()
    copied = [
        word for line in re.findall(r"^COPY (?!--from)(.*) \S+$", dockerfile(), re.MULTILINE) for word in line.split()
    ]
    assert {f"!{word}" for word in copied} <= set(ignore)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert {project["readme"], *project["license-files"]} <= set(copied)


# Licences


LARGE: Final = {"ray", "fast"}
"""Extras of 213 and 411 MB, which not every run of the tests installs."""


def dependencies_of(requirements: Sequence[str], extra: str, found: set[str]) -> set[str]:
    """Return the names of installed packages that requirements lead to; `found` grows."""
    for text in requirements:
        requirement = Requirement(text)
        name = canonicalize_name(requirement.name)
        if name in found or (requirement.marker and not requirement.marker.evaluate({"extra": extra})):
            continue
        try:
            installed = distribution(requirement.name)
        except PackageNotFoundError:
            assert extra in LARGE
            continue
        found.add(name)
        dependencies_of(installed.requires or [], "", found)
    return found


def test_page_of_licences_has_every_dependency_of_users() -> None:
    page = (ROOT / "docs" / "reference" / "licences.md").read_text("utf-8")
    listed = {canonicalize_name(name) for name in re.findall(r"^\| [^|]+ \| \**([\w.-]+)\** \|", page, re.MULTILINE)}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    found = dependencies_of(project["dependencies"], "", set())
    for extra in FIRST_USES.keys() - LARGE:
        dependencies_of(project["optional-dependencies"][extra], extra, found)
    assert found <= listed
    copyleft = {name for name in found if re.search("LGPL|MPL|Mozilla|EPL", licence_of(name))}
    assert copyleft == {canonicalize_name(name) for name in re.findall(r"\| \*\*(.*)\*\* \|", page)}


def licence_of(name: str) -> str:
    """What the metadata of an installed package say of its licence."""
    data = distribution(name).metadata
    classifiers = [text for text in data.get_all("Classifier") or [] if text.startswith("License")]
    named = [(data.get_all(key) or [""])[0][:80] for key in ("License-Expression", "License")]
    return " ".join([*named, *classifiers])


# What the comments of the dependencies say


IMPORTED_AS = {
    "pillow": "PIL",
    "markdown-it-py": "markdown_it",
    "prometheus-client": "prometheus_client",
    "ruamel.yaml": "ruamel",
}


def test_comment_of_a_dependency_names_places_that_import_it() -> None:
    text = (ROOT / "pyproject.toml").read_text("utf-8").partition("\nlint = ")[0]
    rows = re.findall(r'"([\w.-]+)[^"\n]*".*?# (.*)', text)
    assert len(rows) > 15
    for name, comment in rows:
        module = IMPORTED_AS.get(name, name)  # which may be a program: `python -m MODULE`
        pattern = re.compile(rf"^\s*(?:from|import) {module}\b|^_EXTRA: Final = \"{module}\"$", re.MULTILINE)
        for word in re.findall(r"[\w/]+", comment.partition("; ")[0].partition(": ")[0]):
            place = ROOT / "rosbridge_sim" / word
            files = [*place.rglob("*.py")] or [path for path in [place.with_suffix(".py")] if path.is_file()]
            assert not files or any(pattern.search(path.read_text("utf-8")) for path in files), (name, word)
            assert files or "/" not in word, (name, word)


# The wheel


@dataclass(frozen=True)
class Place:
    """A folder that an ordinary user may read, with the wheel installed in an environment there."""

    folder: Path

    @property
    def bin(self) -> Path:
        return self.folder / "env" / "bin"

    @property
    def python(self) -> Path:
        return self.bin / "python3"

    def popen(self, words: Sequence[str], **env: str) -> subprocess.Popen[str]:
        """Start a command there as an ordinary user, with the image's ENV but for what `env` says."""
        own = {"PATH": f"{self.bin}:{os.environ['PATH']}", "PYTHONPYCACHEPREFIX": ""}  # bytecode lies beside its file
        variables = {**os.environ, **environment(), **own, **env}
        user = NOBODY if os.geteuid() == 0 else None
        return subprocess.Popen(
            words,
            cwd=self.folder,
            env={**variables, "HOME": str(self.folder)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            user=user,
            group=user,
            extra_groups=None if user is None else [],
        )

    def run(self, words: Sequence[str], **env: str) -> subprocess.CompletedProcess[str]:
        """The same, to its end."""
        process = self.popen(words, **env)
        out, err = process.communicate(timeout=MINUTE)
        return subprocess.CompletedProcess(words, process.returncode, out, err)


@pytest.fixture(scope="module")
def place() -> Iterator[Place]:
    """The wheel of this checkout, built and installed, with copies of the libraries that it says it needs."""
    folder = Path(tempfile.mkdtemp(prefix="rosbridge-sim-"))
    folder.chmod(0o755)  # pytest's own folders are closed to others
    try:
        place = Place(folder)
        do(python_for_all(place), "-m", "venv", "--without-pip", str(folder / "env"))
        do(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder))
        (wheel,) = folder.glob("*.whl")
        pip = [str(place.python), str(distribution("pip").locate_file("pip")), "--disable-pip-version-check", "--quiet"]
        do(*pip, "install", "--no-deps", "--no-index", "--no-compile", str(wheel))
        (packages,) = folder.glob("env/lib/python3*/site-packages")
        for library in needed_by(wheel):
            copy_files(library, packages)
        copy_bytecode(packages)
        yield place
    finally:
        shutil.rmtree(folder)


def do(*words: str, cwd: Path = ROOT) -> None:
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=10 * MINUTE, check=False)
    assert done.returncode == 0, f"{' '.join(words)}:\n{done.stdout}{done.stderr}"


def python_for_all(place: Place) -> str:
    """A Python of our version that an ordinary user may run: not every one lies where others may look."""
    candidates = [str(Path(sys.executable).resolve()), "/usr/bin/python3", "/usr/local/bin/python3"]
    for python in filter(os.path.exists, candidates):
        code = f"import sys, venv; sys.exit(sys.version_info[:2] != {sys.version_info[:2]})"
        if place.run(["env", python, "-c", code]).returncode == 0:
            return python
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    return miss(f"needs a Python {version} with its venv module that an ordinary user may run")


def needed_by(wheel: Path) -> Iterator[Distribution]:
    """What is installed here of that which a wheel needs, and of that which this needs in turn."""
    with ZipFile(wheel) as archive:
        metadata = message_from_bytes(archive.read(f"rosbridge_sim-{__version__}.dist-info/METADATA"))
    waiting, seen = list(metadata.get_all("Requires-Dist", [])), set()
    while waiting:
        requirement = Requirement(waiting.pop())
        if requirement.name in seen or (requirement.marker and not requirement.marker.evaluate({"extra": ""})):
            continue
        seen.add(requirement.name)
        found = distribution(requirement.name)
        assert requirement.specifier.contains(found.version), f"{requirement}; {found.version} is installed"
        waiting += found.requires or []
        yield found


def copy_files(found: Distribution, packages: Path) -> None:
    """Copy a library into another folder of packages, without its programs and its tests."""
    for file in found.files or []:
        if not {"..", "tests"} & {*file.parts}:
            source, target = Path(str(file.locate())), packages / file
            target.parent.mkdir(parents=True, exist_ok=True)
            link(source, target)
            copy_compiled(source, target)


def link(source: Path, target: Path) -> None:
    """Copy a file that nobody will change; some are listed twice."""
    if target.exists():
        return
    try:
        target.hardlink_to(source)
    except OSError:  # on another disk
        shutil.copy2(source, target)


def copy_compiled(source: Path, target: Path) -> None:
    """Copy the bytecode of a module that was imported here: a start compiles without it for seconds."""
    if source.suffix == ".py" and (compiled := Path(importlib.util.cache_from_source(source))).is_file():
        (target.parent / "__pycache__").mkdir(exist_ok=True)
        link(compiled, target.parent / "__pycache__" / compiled.name)


def copy_bytecode(packages: Path) -> None:
    """Copy that of the package, for the files of the wheel that have the bytes of the checkout."""
    for source in (ROOT / "rosbridge_sim").rglob("*.py"):
        target = packages / source.relative_to(ROOT)
        if target.is_file() and target.read_bytes() == source.read_bytes():
            shutil.copystat(source, target)  # bytecode is that of a file of the same size and time
            copy_compiled(source, target)


@pytest.mark.long
def test_pip_finds_all_that_the_wheel_needs(place: Place, tmp_path: Path) -> None:
    (wheel,) = place.folder.glob("*.whl")
    do(sys.executable, "-m", "venv", str(tmp_path))
    do(str(tmp_path / "bin" / "pip"), "--disable-pip-version-check", "--quiet", "install", str(wheel))
    do(str(tmp_path / "bin" / "rosbridge-sim"), "serve", "--print-config")


def test_wheel_contains_all_data_files(place: Place) -> None:
    (wheel,) = place.folder.glob("*.whl")
    assert f"-{__version__}-py3-none-any" in wheel.name
    (package,) = place.folder.glob("env/lib/python3*/site-packages/rosbridge_sim")
    for folder, at in (
        (ROOT / "schemas", package / "schemas"),
        (ROOT / "docs", package / "docs"),
        (ROOT / "rosbridge_sim" / "data", package / "data"),
    ):
        wanted = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
        assert wanted
        assert sorted(str(path.relative_to(at)) for path in at.rglob("*") if path.is_file()) == wanted
    assert (package / "py.typed").is_file()
    assert place.run([str(place.bin / "rosbridge-sim"), "docs", "tutorial"]).stdout.startswith("# Tutorial\n")


def test_wheel_names_its_licence_and_holds_the_text(place: Place) -> None:
    (wheel,) = place.folder.glob("*.whl")
    with ZipFile(wheel) as archive:
        about = f"rosbridge_sim-{__version__}.dist-info"
        metadata = message_from_bytes(archive.read(f"{about}/METADATA"))
        text = archive.read(f"{about}/licenses/LICENSE").decode()
    assert (metadata["License-Expression"], metadata["License-File"]) == ("Apache-2.0", "LICENSE")
    assert metadata["Author"] == "The rosbridge_sim authors"
    assert metadata["Keywords"]
    assert "Typing :: Typed" in metadata.get_all("Classifier", [])
    assert "Copyright 2026 The rosbridge_sim authors" in text
    assert text.count("\n") > 200, "the whole text"


# The sdist


def names_in_git() -> set[str]:
    """Return all files of the checkout but those that git ignores; `safe.directory` is for one of another user."""
    if not (ROOT / ".git").exists():
        miss("needs a checkout: in an unpacked sdist nothing says which files belong to it")
    words = ["git", "-c", "safe.directory=*", "ls-files", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=MINUTE, check=True)
    return {name for name in done.stdout.splitlines() if (ROOT / name).exists()}


def test_sdist_is_complete_and_gives_the_same_wheel(place: Place) -> None:
    target = place.folder / "sdist"
    do(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(target))
    (sdist,) = target.iterdir()
    with tarfile.open(sdist) as archive:
        archive.extractall(target, filter="data")
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert names == names_in_git() - {".gitignore"} | {"PKG-INFO"}
    assert names > {
        "LICENSE",
        ".dockerignore",
        "Dockerfile",
        "docs/operation.md",
        "tests/test_packaging.py",
        "scripts/serve",
    }
    (unpacked,) = (path for path in target.iterdir() if path.is_dir())
    do(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(target), cwd=unpacked)
    (again,) = target.glob("*.whl")
    (wheel,) = place.folder.glob("*.whl")
    with ZipFile(wheel) as first, ZipFile(again) as second:
        contents = [{name: archive.read(name) for name in archive.namelist()} for archive in (first, second)]
    assert contents[0] == contents[1]


def user_of(process: subprocess.Popen[str]) -> int:
    return Path(f"/proc/{process.pid}").stat().st_uid


async def test_image_command_serves_is_healthy_and_stops(place: Place, connect: Connect) -> None:
    loopback = {"ROSBRIDGE_SIM_HOST": "127.0.0.1", "ROSBRIDGE_SIM_PORT": "0"}
    process = place.popen(image_command(), **loopback)
    try:
        line = read_line(process)
        match = re.fullmatch(r"rosbridge-sim listening on (ws://127\.0\.0\.1:(\d+))\n", line)
        assert match, f"{line!r}, and then {process.communicate(timeout=MINUTE)}"
        url, port = match.groups()
        assert user_of(process) != 0

        health = place.run(health_check(), ROSBRIDGE_SIM_PORT=port)
        assert (health.returncode, health.stderr) == (0, "")

        client = await connect(url)
        answer = await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        assert answer["time_step"] == 20
        answer = await client.ask("/SyncModeWaitForTick", user_id="me", frame=answer["frame"] + 1)
        assert answer["tick_status"] is True
        await client.close()

        process.terminate()
        _, err = process.communicate(timeout=MINUTE)
        assert process.returncode == 0, err
        assert "Traceback" not in err
        with socket.socket() as silent:  # nobody else gets its port
            silent.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            silent.bind(("127.0.0.1", int(port)))
            assert place.run(health_check(), ROSBRIDGE_SIM_PORT=port).returncode != 0
    finally:
        process.kill()
        process.communicate()


def test_arguments_of_docker_run_are_flags(place: Place) -> None:
    done = place.run(image_command("--seed", "77", "--print-config"))
    assert done.returncode == 0, done.stderr
    assert "\nseed = 77\n" in done.stdout
    assert 'host = "0.0.0.0"\n' in done.stdout


def test_installed_package_is_the_imported_one(place: Place) -> None:
    code = "import rosbridge_sim; print(rosbridge_sim.__version__, rosbridge_sim.Simulator().settings.port)"
    done = place.run(["python3", "-c", code])
    assert done.stdout == f"{__version__} 9090\n", done.stderr


# The checkout


def test_scripts_serve_passes_its_arguments_on() -> None:
    done = subprocess.run(
        [ROOT / "scripts" / "serve", "--seed", "77", "--print-config"],
        capture_output=True,
        text=True,
        timeout=10 * MINUTE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "\nseed = 77\n" in done.stdout
