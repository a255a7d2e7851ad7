"""The compiler of the loops, their cache, and what a process says about them."""

from __future__ import annotations

import os
import re
import select
import subprocess
import sys
from pathlib import Path

import pytest

from rosbridge_sim.shell.kernels.backend import VARIABLE, find_compiler
from rosbridge_sim.shell.kernels.compiler import (
    NoKernelsError,
    cache_folder,
    compile_library,
    is_whole,
    library_path,
    load_library,
    read_source,
)
from tests import fork_server
from tests.support import PATIENCE
from tests.world.kernels.compiled_loops import compiler, library, needs_compiler


def test_compiler_is_that_of_the_variable() -> None:
    assert find_compiler({VARIABLE: "ccache cc"}) == ("ccache", "cc")
    assert find_compiler({VARIABLE: "none"}) == ()
    assert find_compiler({VARIABLE: "cc 'without an end"}) == ("cc 'without an end",)


def test_another_source_or_compiler_is_another_library(tmp_path: Path) -> None:
    path = library_path("a", ["cc"], tmp_path)
    assert path == library_path("a", ["cc"], tmp_path)
    assert len({path, library_path("b", ["cc"], tmp_path), library_path("a", ["clang"], tmp_path)}) == 3


def test_cache_is_in_the_users_folder(tmp_path: Path) -> None:
    if sys.platform == "linux":
        assert cache_folder({"XDG_CACHE_HOME": str(tmp_path)}) == tmp_path / "rosbridge_sim"
        assert cache_folder({"XDG_CACHE_HOME": "here"}) == Path.home() / ".cache" / "rosbridge_sim"
    assert cache_folder({}).name == "rosbridge_sim"


@pytest.mark.parametrize(("platform", "there"), [("darwin", "Library/Caches"), ("linux", ".cache")])
def test_cache_is_where_the_system_has_such_files(platform: str, there: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    assert cache_folder({}) == Path.home() / there / "rosbridge_sim"


def test_user_without_a_home_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", no_home)
    with pytest.raises(NoKernelsError, match="home directory"):
        cache_folder({})


def test_source_has_constants_and_rules_of_the_package() -> None:
    source = read_source()
    assert "#define HARDEST 8.0\n" in source
    assert "static inline D mean_follow(D a0, D a1, D a2, D a3)" in source


@pytest.mark.parametrize("command", ["no-such-compiler", "false"])
def test_compiler_that_fails_is_told_and_leaves_nothing(command: str, tmp_path: Path) -> None:
    with pytest.raises(NoKernelsError, match=command):
        compile_library("int x;", [command], tmp_path / "kernels.so")
    assert not list(tmp_path.iterdir())


@needs_compiler
def test_mistake_in_the_source_is_told_in_the_compilers_words(tmp_path: Path) -> None:
    with pytest.raises(NoKernelsError, match="no_such_type"):
        compile_library("no_such_type x;", compiler(), tmp_path / "kernels.so")


def test_what_is_no_library_is_not_loaded(tmp_path: Path) -> None:
    path = tmp_path / "kernels.so"
    path.write_bytes(b"no library")
    path.chmod(0o600)
    with pytest.raises(NoKernelsError, match="compiled again"):
        load_library(path)


@pytest.mark.skipif(sys.platform == "win32", reason="rights of files are those of POSIX")
@pytest.mark.parametrize(("of_folder", "of_file"), [(0o700, 0o666), (0o777, 0o600)])
def test_library_that_others_may_write_or_replace_is_not_loaded(of_folder: int, of_file: int, tmp_path: Path) -> None:
    path = tmp_path / "kernels.so"
    path.write_bytes(b"")
    path.chmod(of_file)
    tmp_path.chmod(of_folder)
    with pytest.raises(NoKernelsError, match="nobody else may write"):
        load_library(path)


@needs_compiler
def test_library_of_a_user_whose_group_may_write_new_files_is_loaded(tmp_path: Path) -> None:
    names = re.findall(r"^EXPORT \w+ (\w+)", read_source(), re.MULTILINE)
    source = "".join(f"void {name}(void) {{}}\n" for name in names)
    path, before = tmp_path / "cache" / "kernels.so", os.umask(0o002)
    try:
        compile_library(source, compiler(), path)
    finally:
        os.umask(before)
    load_library(path)


PROGRAM = """
import logging, sys
logging.basicConfig(level="INFO")
from rosbridge_sim.shell.kernels.backend import backend, start_kernels
thread = start_kernels()
print(thread is not None, backend(), "rosbridge_sim.world.kernels.lane_kernel" in sys.modules, "ctypes" in sys.modules)
if thread is not None:
    thread.join()
print(backend())
"""


def run(environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", PROGRAM], env=os.environ | environment, capture_output=True, text=True, check=True
    )


def test_process_without_a_compiler_loads_nothing() -> None:
    assert run({VARIABLE: "none"}).stdout.split()[:3] == ["False", "numpy", "False"]


def test_broken_compiler_is_one_line_in_the_log_and_arrays_go_on(tmp_path: Path) -> None:
    environment = {VARIABLE: "false", "XDG_CACHE_HOME": str(tmp_path), "LOCALAPPDATA": str(tmp_path)}
    done = fork_server.run(["-c", PROGRAM], env=os.environ | environment)
    assert done.stdout.split()[-1] == "numpy"
    assert done.stderr.count("\n") == 1
    assert "driven by numpy, which is slower: false failed with status 1" in done.stderr


@needs_compiler
def test_process_takes_a_library_from_the_cache_at_once() -> None:
    library()  # makes it
    done = run({VARIABLE: " ".join(compiler())})
    assert done.stdout.split() == ["False", "compiled", "True", "True", "compiled"]


@needs_compiler
def test_library_that_was_cut_off_is_not_whole(tmp_path: Path) -> None:
    library()  # makes it
    made = library_path(read_source(), compiler(), cache_folder(os.environ))
    path = tmp_path / made.name
    for suffix in (path.suffix, ".sum"):
        path.with_suffix(suffix).write_bytes(made.with_suffix(suffix).read_bytes())
    assert is_whole(path)
    path.write_bytes(path.read_bytes()[:12_000])
    assert not is_whole(path)
    path.unlink()
    assert not is_whole(path)


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="the cache is that of Linux")
def test_library_that_was_cut_off_is_compiled_again(tmp_path: Path) -> None:
    environment = {VARIABLE: " ".join(compiler()), "XDG_CACHE_HOME": str(tmp_path)}
    run(environment)
    (path,) = (tmp_path / "rosbridge_sim").glob("*.so")
    path.write_bytes(path.read_bytes()[:12_000])
    assert run(environment).stdout.split()[-1] == "compiled"
    assert is_whole(path)


@pytest.mark.skipif(sys.platform == "win32", reason="there are no bytes in its environment")
def test_command_that_is_no_text_and_very_long_is_one_line(tmp_path: Path) -> None:
    done = run({VARIABLE: "no-such\udcff" + "x" * 20_000, "XDG_CACHE_HOME": str(tmp_path)})
    assert done.stdout.split()[-1] == "numpy"
    assert done.stderr.count("\n") == 1
    assert len(done.stderr) < 2000


@needs_compiler
def test_process_takes_loops_over_when_they_are_compiled(tmp_path: Path) -> None:
    words = run({VARIABLE: " ".join(compiler()), "XDG_CACHE_HOME": str(tmp_path)}).stdout.split()
    if sys.platform == "linux":
        assert words == ["True", "numpy", "True", "True", "compiled"]
        assert len(list((tmp_path / "rosbridge_sim").iterdir())) == 2


WAITS = """
import atexit, subprocess, sys, threading, time
from pathlib import Path
from rosbridge_sim.shell.kernels.backend import start_kernels

ending, start = threading.Event(), subprocess.Popen._execute_child

def start_late(*words):
    start(*words)
    ending.wait()

if IS_LATE:
    subprocess.Popen._execute_child = start_late
start_kernels()
while not Path(PLACE).exists():
    time.sleep(0.01)
atexit.register(ending.set)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs pidfd_open")
@pytest.mark.parametrize("is_late", [False, True], ids=["running", "just_started"])
def test_compiler_ends_with_its_process(tmp_path: Path, is_late: bool) -> None:  # noqa: FBT001 - a parameter
    program = WAITS.replace("PLACE", repr(str(tmp_path / "pid"))).replace("IS_LATE", str(is_late))
    compiling = f"sh -c 'sleep 100 & echo $! > {tmp_path}/new; mv {tmp_path}/new {tmp_path}/pid; wait'"
    environment = os.environ | {VARIABLE: compiling, "XDG_CACHE_HOME": str(tmp_path)}
    assert fork_server.run(["-c", program], env=environment).returncode == 0
    try:
        compiler_process = os.pidfd_open(int((tmp_path / "pid").read_text()))
    except ProcessLookupError:
        return
    with os.fdopen(compiler_process) as descriptor:
        has_ended, _, _ = select.select([descriptor], [], [], PATIENCE)
    assert has_ended
