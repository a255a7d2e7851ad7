"""The folder of a campaign's results, and what may be found in it after a crash.

campaign.toml   the file as it was driven, and campaign.json where it came from
.lock           held by the process that writes; see `FolderLock`
results.jsonl   a line for each run, appended as it comes; the only file that a later start reads
runs.csv        the table; times.csv has what depends on the machine; runs.parquet where pyarrow is installed
junit.xml       for CI
report.html     for people
runs/00012/     what is kept of run 12
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import shutil
from collections.abc import Sequence
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rosbridge_sim.campaigns.run_results import Result
from rosbridge_sim.campaigns.tables import Cell, columns_of, write_junit, write_table, write_times
from rosbridge_sim.errors import DocumentError, file_errors
from rosbridge_sim.printable import MAX_QUOTED, printable
from rosbridge_sim.version import __version__

if TYPE_CHECKING:  # to list results needs nothing that drives
    from rosbridge_sim.campaign_runs.job import Job

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

CAMPAIGN: Final = "campaign.toml"
ABOUT: Final = "campaign.json"
RESULTS: Final = "results.jsonl"
SUMMARY_FILES: Final = (CAMPAIGN, ABOUT, RESULTS)
"""Files with the campaign and the results of its runs."""

LOCK: Final = ".lock"

DIGITS: Final = 5
"""Digits of the number in the name of a run's folder: 100,000 runs sort well."""


class ResultsFolder:
    """Results of a campaign on the disk.

    Attributes:
        title: name of the folder in messages.

    Args:
        title: name of the folder in messages; None for the path.
    """

    def __init__(self, path: Path, title: str | None = None) -> None:
        self.path = path
        self.title = str(path) if title is None else title
        self._lock: FolderLock | None = None
        self._file: FileIO | None = None
        self._size = 0
        self._waiting: list[bytes] = []

    # Beginning

    def hold(self) -> None:
        """Make the folder, and let no other process write there until `close`.

        Raises:
            DocumentError: another process writes there, or the folder cannot be written.
        """
        with file_errors(self.path, "written"):
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock = FolderLock(self.path / LOCK)

    def begin(self, job: Job, *, is_resumed: bool) -> list[Result]:
        """Begin the results, or take up those that are there.

        Returns:
            The results that are there already.

        Raises:
            DocumentError: there are results and they are not to be resumed, or they are those of another campaign; or
                another process writes there; or the folder cannot be written.
        """
        there = self.path / CAMPAIGN
        if self._lock is None:
            self.hold()
        with file_errors(self.path, "written"):
            self._check_campaign(there, job, is_resumed=is_resumed)
            found = self.results() if is_resumed else []
            if not there.is_file():
                (self.path / ABOUT).write_text(
                    json.dumps({"source": job.source, "base": job.base, "version": __version__}) + "\n", "utf-8"
                )
                there.write_text(job.text, "utf-8")
            self._file = self._open_results()
        return found

    def _check_campaign(self, there: Path, job: Job, *, is_resumed: bool) -> None:
        if not there.is_file():
            return
        if not is_resumed:
            raise DocumentError(
                f"{self.path}: there are results already; --resume goes on with them, or choose --output"
            )
        if there.read_text("utf-8") != job.text:
            raise DocumentError(
                f"{self.path}: the campaign has changed since these results were made; choose another --output"
            )

    def _open_results(self) -> FileIO:
        """Open the file for appending, behind its last whole line: a crash may have cut the line after it."""
        path = self.path / RESULTS
        if path.is_file():
            content = path.read_bytes()
            whole = content.rfind(b"\n") + 1
            if whole < len(content):
                os.truncate(path, whole)
        file = path.open("ab", buffering=0)  # what a full disk refuses must not wait in a buffer
        self._size = path.stat().st_size
        return file

    # Results

    def results(self) -> list[Result]:
        """Return the results that are there, one for each run, in the order of the table.

        Raises:
            DocumentError: a line is no result.
        """
        path = self.path / RESULTS
        found: dict[int, Result] = {}
        with file_errors(path, "read"):
            lines = path.read_bytes().split(b"\n")[:-1] if path.is_file() else []
        for number, line in enumerate(lines, 1):
            try:
                result = Result.from_json(json.loads(line))
            except KeyError as error:
                raise DocumentError(f"{path}:{number}: expected a result of a run; {error} is missing") from None
            except (ValueError, TypeError, AttributeError, RecursionError) as error:
                why = printable(str(error), MAX_QUOTED)
                raise DocumentError(f"{path}:{number}: expected a result of a run; {why}") from None
            found.setdefault(result.run.number, result)
        return [found[number] for number in sorted(found)]

    def result_of(self, number: int) -> Result:
        """Return the result of a run.

        Raises:
            DocumentError: there is none, or a line is no result.
        """
        for result in self.results():
            if result.run.number == number:
                return result
        raise DocumentError(f"{self.title}: there is no result of a run {number}")

    def name_of(self, file: str) -> str:
        """Return the name of a file of the folder in messages."""
        return f"{self.title.rstrip('/')}/{file}"

    def append(self, result: Result) -> str:
        """Write one result; return why the disk did not take it, to be tried again with the next, or an empty text."""
        self._waiting.append(json.dumps(result.to_json(), separators=(",", ":")).encode() + b"\n")
        try:
            while self._waiting:
                self._write_line(self._waiting[0])
                self._waiting.pop(0)
        except OSError as error:
            return error.strerror or str(error)
        return ""

    def _write_line(self, line: bytes) -> None:
        """Write a whole line, or nothing.

        Raises:
            OSError: the disk takes no more.
        """
        assert self._file is not None
        before, rest = self._size, line
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            os.truncate(self.path / RESULTS, before)  # a part of the line may be there
            raise
        self._size += len(line)

    def close(self) -> None:
        """End the file of results, remove what drives left behind, and let others write here."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.close()
        if self._lock is not None:  # else the folder is that of another process
            shutil.rmtree(self.path / ".work", ignore_errors=True)
            self._lock.release()
            self._lock = None

    # Tables

    def write_tables(self, results: Sequence[Result], parameters: Sequence[str], name: str) -> None:
        """Write the tables anew, each in one piece.

        Args:
            results: in the order of the table.

        Raises:
            DocumentError: the disk takes no more.
        """
        self.write("runs.csv", write_table(results, parameters))
        self.write("times.csv", write_times(results))
        self.write("junit.xml", write_junit(results, name))
        try:
            import pyarrow as pa  # noqa: PLC0415 - only where the user has it
            from pyarrow import parquet  # noqa: PLC0415
        except ImportError:
            return
        columns = {key: pa.array(_alike(cells)) for key, cells in columns_of(results, parameters).items()}
        path = self.path / "runs.parquet"
        with file_errors(path, "written"):
            parquet.write_table(pa.table(columns), str(path))

    def write(self, name: str, text: str) -> None:
        """Write a file in one piece: the old one stays if the disk is full.

        Raises:
            DocumentError: the disk takes no more.
        """
        path, new = self.path / name, self.path / f".{name}.new"
        try:
            new.write_text(text, encoding="utf-8")
            new.replace(path)
        except OSError as error:
            with contextlib.suppress(OSError):
                new.unlink()
            raise DocumentError(f"{path}: cannot be written: {error.strerror}") from None

    @property
    def free(self) -> int:
        """Room on its disk [bytes]."""
        return shutil.disk_usage(self.path).free

    def size_of(self, result: Result) -> int:
        """Return the bytes of the files of a run."""
        place = run_folder(self.path, result.run.number)
        return sum(file.stat().st_size for file in place.iterdir()) if place.is_dir() else 0

    def drop(self, result: Result) -> None:
        """Remove the files of a run."""
        shutil.rmtree(run_folder(self.path, result.run.number), ignore_errors=True)


def _alike(cells: Sequence[Cell]) -> Sequence[Cell]:
    """Return the cells of a column with one type: numbers, switches, or else texts."""
    kinds = {type(cell) for cell in cells if cell is not None}
    if len(kinds) <= 1:
        return cells
    if kinds == {int, float}:  # a large whole number would not fit beside a fraction
        return [None if cell is None else float(cell) for cell in cells]
    return [None if cell is None else str(cell) for cell in cells]


def run_folder(folder: str | Path, number: int) -> Path:
    """Return the folder of what is kept of a run."""
    return Path(folder) / "runs" / f"{number:0{DIGITS}d}"


def read_text_of(folder: Path) -> tuple[Job, str]:
    """Return the campaign of a folder of results, and its name.

    Raises:
        DocumentError: it is no such folder.
    """
    from rosbridge_sim.campaign_runs.job import Job  # noqa: PLC0415 - imports all that drives

    text, source, base = read_origin(folder)
    return Job(text, source, base, str(folder.resolve())), Path(source).stem


def read_origin(folder: Path) -> tuple[str, str, str]:
    """Return the text of the campaign of a folder of results, its file, and the folder of that.

    Raises:
        DocumentError: it is no such folder.
    """
    try:
        text = (folder / CAMPAIGN).read_text("utf-8")
        about: Any = json.loads((folder / ABOUT).read_text("utf-8"))
        source, base = str(about["source"]), str(about["base"])
        (source + base).encode()  # half of a surrogate pair is an error
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise DocumentError(
            f"{folder}: expected a folder of results; `rosbridge-sim campaign run FILE` makes one"
        ) from None
    return text, source, base


class FolderLock:
    """A file that this process has locked. The system frees it when its holder ends in any way.

    Windows has no such locks; two campaigns in one folder are not refused there.

    Args:
        path: of the file; it has the number of the process and the name of its machine while the lock is held.

    Raises:
        DocumentError: another process holds the lock.
        OSError: the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = printable(os.read(self._file, 200).decode("utf-8", "replace").strip(), 80) or "another process"
            os.close(self._file)
            raise DocumentError(
                f"{path.parent}: {holder} writes its results here; wait until it ends, or choose another --output"
            ) from None
        except OSError:
            return  # a file system without locks, as some that are mounted
        os.ftruncate(self._file, 0)
        os.write(self._file, f"process {os.getpid()} on {platform.node()}\n".encode())

    def release(self) -> None:
        """Let another process take the lock. The file stays: another one may wait for it."""
        with contextlib.suppress(OSError):
            os.ftruncate(self._file, 0)
        os.close(self._file)
