"""Servers for the fuzzer: their configurations, their files, and the detection of a bad end."""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from scripts.soak.scenes import write_networks, write_scenes

ROOT = Path(__file__).resolve().parents[2]

PATIENCE = 60.0
"""Longest time for the end of a server [s]; after that it hangs."""

_BAD_WORDS = ("Traceback", "internal error", "bug of ours")


class FuzzError(Exception):
    """The server did something wrong."""


@dataclass(frozen=True, slots=True)
class Configuration:
    """Start options of a server.

    Attributes:
        name: of this configuration.
        flags: of `serve`.
        release, ros: as in the flags.
        is_attached: a simulator brings the world, from behind a proxy that damages frames.
    """

    name: str
    flags: tuple[str, ...] = ()
    release: str = "22.R2"
    ros: Literal[1, 2] = 1
    is_attached: bool = False

    @property
    def has_world(self) -> bool:
        """True if the server itself moves a world."""
        return "--no-world" not in self.flags

    @property
    def all_flags(self) -> list[str]:
        """All flags except those of folders."""
        return [f"--release={self.release}", f"--ros={self.ros}", *self.flags]


CONFIGURATIONS = (
    Configuration("demo"),
    Configuration("town", ("--scenario=town",)),
    Configuration("ros2", ("--scenario=town", "--profile=field"), release="26.R1", ros=2),
    Configuration("sync", ("--start=sync", "--compression", "--sync-frames=strict")),
    Configuration("recording", ("--scenario=loop", "--record={folder}/recorded.bag", "--record-topics=*")),
    Configuration("gateway", ("--no-world", "--strict-types", "--max-rate=3000")),
    Configuration("attached", ("--no-world",), is_attached=True),
    Configuration("newer", ("--scenario=demo", "--start-mode=keyboard", "--sync-on-loss=wait"), release="26.R1"),
    Configuration("mcap", ("--record={folder}/recorded.mcap", "--record-topics=*", "--max-held=20"), ros=2),
)


class Server:
    """A running program of ours, in its own folder.

    Attributes:
        folder: of its files.
        process: the program.
        url: its address, or that of the bridge it is attached to.
    """

    def __init__(self, configuration: Configuration, folder: Path, bridge: str | None = None) -> None:
        """Start it and wait until it is ready. With the URL of a bridge it attaches to that instead of listening."""
        self.folder = folder
        self._log = folder / ("log.txt" if bridge is None else "attached.txt")
        self._seen = 0
        flags = [flag.replace("{folder}", str(folder)) for flag in configuration.all_flags]
        if bridge is not None:
            words = ["attach", bridge, "--attach-retry=1", "--scenario=town"]
            words += [flag for flag in flags if flag != "--no-world"]
        else:
            words = ["serve", "--port=0", *flags]
        words += [f"--scenario-path={folder / 'scenarios'}", f"--data-dir={folder / 'data'}"]
        command = [sys.executable, "-m", "rosbridge_sim", *words]
        (folder / "scenarios").mkdir(exist_ok=True)
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=log, text=True)  # noqa: S603 - our own program
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if " ws://" not in line:
            raise FuzzError(f"the server did not start:\n{self._log.read_text()}")
        self.url = line.rsplit(" ", 1)[1].strip()

    def check(self) -> None:
        """Check that it runs and has logged no fault of ours.

        Raises:
            FuzzError: it has ended, or its log has a fault.
        """
        self._check_log()
        if self.process.poll() is not None:
            raise FuzzError(f"the server has ended with {self.process.returncode}: {self._log.read_text()[-3000:]}")

    def _check_log(self) -> None:
        with self._log.open(errors="replace") as log:
            log.seek(self._seen)
            text = log.read()
            self._seen = max(0, log.tell() - 100)  # a word may be cut in two
        for word in _BAD_WORDS:
            if word in text:
                at = max(0, text.index(word) - 300)
                raise FuzzError(f"the log says:\n{text[at : at + 4000]}")

    def memory(self) -> float:
        """Return its resident memory.

        Returns:
            [MB].
        """
        for line in Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
        raise FuzzError("the server has ended")

    def stop(self) -> None:
        """Stop it, and check that it ends well.

        Raises:
            FuzzError: its code is not 0, or it does not end.
        """
        self.process.send_signal(signal.SIGTERM)
        try:
            code = self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise FuzzError("the server does not stop") from None
        if code:
            raise FuzzError(f"the server has stopped with {code}:\n{self._log.read_text(errors='replace')[-3000:]}")
        self._check_log()

    def last_words(self) -> str:
        """Return the end of its log; if it is about to end, with its last lines."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(1.0)
        return self._log.read_text(errors="replace")[-30000:]

    def kill(self) -> None:
        """End it if it still runs."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()


@contextmanager
def serving(configuration: Configuration, data: Path) -> Iterator[Server]:
    """Run a server with a copy of the data, until the end of the block; without a failure it is stopped in order.

    Args:
        configuration: start options.
        data: from `make_data`.

    Yields:
        The server.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(data, folder, dirs_exist_ok=True)
        server = Server(configuration, folder)
        try:
            yield server
            server.stop()
        except FuzzError as error:
            raise FuzzError(f"{error}\nthe end of the server's log:\n{server.last_words()}") from None
        finally:
            server.kill()


def make_data(folder: Path, seed: int, *, has_recordings: bool = True) -> None:
    """Write correct and wrong scenarios and network settings, and whole and broken recordings.

    Args:
        folder: where to.
        seed: random seed.
        has_recordings: write recordings too.
    """
    (folder / "scenarios").mkdir(parents=True)
    write_scenes(folder / "scenarios")
    write_networks(folder / "data")
    if not has_recordings:
        return
    replays = folder / "data" / "Replay"
    replays.mkdir(parents=True)
    chance = random.Random(seed)  # noqa: S311 - to be repeated
    for name in ("drive.bag", "other.mcap"):
        configuration = Configuration("recorder", (f"--record={replays / name}",))
        with tempfile.TemporaryDirectory() as own:
            server = Server(configuration, Path(own))
            try:
                time.sleep(1.0)
                server.stop()
            finally:
                server.kill()
        whole = (replays / name).read_bytes()
        for i in range(3):
            broken = bytearray(whole)
            for _ in range(chance.choice((1, 5, 30))):
                broken[chance.randrange(len(broken))] = chance.randrange(256)
            (replays / f"broken{i}{Path(name).suffix}").write_bytes(broken)
