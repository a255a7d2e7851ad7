"""The file of `--port-file`: whole, right, gone at the end, and with errors that name it."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

from rosbridge_sim import DocumentError, Simulator
from rosbridge_sim.shell.files.port_file import PortFile
from tests.conftest import Serve


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


async def test_file_names_the_port_while_the_server_listens(tmp_path: Path) -> None:
    path = tmp_path / "port"
    async with Simulator(port=0, world=False, port_file=path) as sim:
        assert path.read_text() == f"{sim.port}\n"
        assert names_in(tmp_path) == ["port"]
    assert not path.exists()


def test_file_that_is_left_of_a_server_that_was_killed_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "port"
    path.write_text("1234567\n")
    PortFile(path, 9090)
    assert path.read_text() == "9090\n"


def test_file_that_another_server_has_written_meanwhile_stays(tmp_path: Path) -> None:
    path = tmp_path / "port"
    first = PortFile(path, 1)
    second = PortFile(path, 2)
    first.remove()
    assert path.read_text() == "2\n"
    second.remove()
    second.remove()
    assert not path.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there, and names follow other rules")
def test_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "port")
    file = PortFile(tmp_path / "link", 1)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "port").read_text() == "1\n"
    file.remove()
    assert not (tmp_path / "port").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there, and names follow other rules")
def test_file_that_cannot_be_written_is_told_with_its_path(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    for path, why in (
        (tmp_path / "nowhere" / "port", f"the folder {tmp_path / 'nowhere'} does not exist; create it first"),
        (tmp_path, "expected a file or an unused name; got something else"),
        (Path("/dev/null"), "expected a file or an unused name; got something else"),
        (tmp_path / "file" / "port", f"{tmp_path / 'file'} is not a folder"),
        (tmp_path / ("x" * 300), "File name too long"),
        (tmp_path / "circle", ""),
    ):
        with pytest.raises(DocumentError) as caught:
            PortFile(path, 1)
        assert str(caught.value).startswith(f"port-file {path}: ")
        assert why in str(caught.value)
    assert names_in(tmp_path) == ["circle", "file"]


async def test_start_without_its_port_file_listens_no_longer_and_records_nothing(tmp_path: Path) -> None:
    bag = tmp_path / "drive.bag"
    sim = Simulator(port=0, port_file=tmp_path / "nowhere" / "port", record=bag)
    with pytest.raises(DocumentError, match="port-file"):
        await sim.start()
    assert not bag.exists()
    await sim.stop()


async def test_port_file_goes_where_a_later_step_of_the_start_fails(tmp_path: Path) -> None:
    (tmp_path / "drive.bag").touch()
    sim = Simulator(port=0, port_file=tmp_path / "port", record=tmp_path / "drive.bag")
    with pytest.raises(DocumentError, match="exists already"):
        await sim.start()
    assert names_in(tmp_path) == ["drive.bag"]


async def test_simulator_without_a_port_wants_no_port_file(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="port-file: expected a server that listens"):
        await Simulator(attach="ws://127.0.0.1:1", listen=False, port_file=tmp_path / "port").start()


@pytest.mark.slow
def test_file_is_there_before_the_first_line_and_goes_when_a_signal_ends_the_server(
    serve: Serve, tmp_path: Path
) -> None:
    path = tmp_path / "port"
    server = serve("--port-file", str(path))
    assert path.read_text() == f"{server.port}\n"
    assert server.stop(signal.SIGTERM) == 0
    assert not path.exists()
