"""Folders of results by their path, or at an address of fsspec, such as `s3://bucket/night`.

Object stores cannot append to a file. So commands work on a copy on this machine's disk. Changed files are stored every
minute and at the end. Two machines that write to one address are not noticed.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from threading import Event, Thread
from typing import Any, Final
from urllib.parse import unquote

from rosbridge_sim.campaign_runs.results_folder import SUMMARY_FILES, ResultsFolder
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import MAX_QUOTED, printable

ADDRESS: Final = re.compile(r"[a-z][a-z0-9+.-]+://.+")

_PASSWORD: Final = re.compile(r"(://[^/:@]*:)([^/]+)(?=@)")

STORED_EVERY: Final = 60.0
"""Interval between two searches for changed files [s]. A machine that is lost loses the results of one interval."""


@contextmanager
def open_results(
    place: str, *, fetch: Sequence[str] | None = (), tell: Callable[[str], None] | None = None
) -> Iterator[ResultsFolder]:
    """Open a folder of results.

    Args:
        place: a path, or an address of fsspec. A password in it stays out of titles and errors.
        fetch: prefixes of names of files to read, beside those with all results; None reads all files.
        tell: called with a sentence each time that storing fails; None if nothing is to be stored.

    Raises:
        DocumentError: fsspec or its back end is missing, or the address cannot be read or written.
    """
    if not ADDRESS.fullmatch(place):
        yield ResultsFolder(Path(place))
        return
    stored = _StoredFolder(place)
    with temporary_folder() as work:
        copy = Path(work) / "results"
        try:
            stored.fetch(copy, fetch)
            with stored.storing(copy, tell) if tell is not None else contextlib.nullcontext():
                yield ResultsFolder(copy, stored.title)
        except DocumentError as error:
            raise DocumentError(str(error).replace(str(copy), stored.title)) from None


@contextmanager
def temporary_folder() -> Iterator[str]:
    """Create a temporary folder, and delete it at the end.

    Raises:
        DocumentError: no folder for temporary files can be written.
    """
    try:
        folder = tempfile.TemporaryDirectory(prefix="campaign-")
    except OSError as error:
        raise DocumentError(f"no temporary folder can be made ({error.strerror}): have TMPDIR name one") from None
    with folder as work:
        yield work


class _StoredFolder:
    """A folder at an address, by a file system of fsspec. Its back ends raise errors of many libraries.

    Attributes:
        title: the address without its password, for people and for reports.

    Raises:
        DocumentError: see `open_results`.
    """

    def __init__(self, address: str) -> None:
        self.title = _PASSWORD.sub(r"\1***", address)
        self._passwords = [found[2] for found in _PASSWORD.finditer(address)]
        self._sizes: dict[str, tuple[int, int]] = {}
        try:
            import fsspec  # noqa: PLC0415 - an optional library
        except ImportError:
            raise DocumentError(f"{self.title}: needs fsspec: pip install fsspec, and s3fs for s3://") from None
        self._files: Any
        with self._errors_told("opened"):
            self._files, self._root = fsspec.url_to_fs(address.rstrip("/"))

    @contextmanager
    def _errors_told(self, done: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # noqa: BLE001 - back ends raise any error
            why = _PASSWORD.sub(r"\1***", str(error) or type(error).__name__)
            for password in self._passwords:
                why = why.replace(password, "***").replace(unquote(password), "***")
            raise DocumentError(f"{self.title}: cannot be {done}: {printable(why, MAX_QUOTED)}") from None

    def fetch(self, copy: Path, wanted: Sequence[str] | None) -> None:
        """Copy what is there to the disk."""
        with self._errors_told("read"):
            for path in self._files.find(self._root) if self._files.exists(self._root) else ():
                name = path[len(self._root) :].lstrip("/")
                is_wanted = wanted is None or name in SUMMARY_FILES or name.startswith(tuple(wanted))
                if not is_wanted or ".." in PurePosixPath(name).parts:  # a store takes any name: none leaves the copy
                    continue
                target = copy / name
                target.parent.mkdir(parents=True, exist_ok=True)
                self._files.get_file(path, str(target))
                self._sizes[name] = _state_of(target)

    @contextmanager
    def storing(self, copy: Path, tell: Callable[[str], None]) -> Iterator[None]:
        """Store changed files of the copy, at intervals and at the end.

        At the end Ctrl-C gives up a store that does not answer; the results stay on the disk, as after an error.

        Raises:
            DocumentError: the address takes no files; if that is found at the end, it names a folder that has them.
        """
        with self._errors_told("written"), tempfile.NamedTemporaryFile() as empty:  # fail before hours of driving
            self._put(Path(empty.name), f"{self._root}/.probe")
            self._files.rm_file(f"{self._root}/.probe")
        is_over = Event()

        def store_now_and_then() -> None:
            while not is_over.wait(STORED_EVERY):
                try:
                    self._store(copy)
                except DocumentError as error:
                    tell(f"{error}; it is tried again")

        thread = Thread(target=store_now_and_then, name="stores results", daemon=True)
        thread.start()
        try:
            yield
        finally:
            try:
                is_over.set()
                thread.join()
                self._store(copy)
            except (DocumentError, KeyboardInterrupt) as error:
                if not copy.exists():
                    raise
                kept = shutil.move(copy, tempfile.mkdtemp(prefix="campaign-results-"))  # needs no room on a full disk
                what = str(error) or f"{self.title}: not all is stored"
                raise DocumentError(f"{what}; the results are in {kept}") from None

    def _store(self, copy: Path) -> None:
        """Store the files that have changed; the rows of results last, so that each finds its files."""
        with self._errors_told("written"):
            for file in sorted(copy.rglob("*"), key=lambda file: file.parent == copy):
                name = file.relative_to(copy).as_posix()
                if name.startswith(".") or not file.is_file() or self._sizes.get(name) == (state := _state_of(file)):
                    continue
                self._put(file, f"{self._root}/{name}")
                self._sizes[name] = state

    def _put(self, file: Path, target: str) -> None:
        try:
            self._files.put_file(str(file), target)
        except FileNotFoundError:  # a store that has folders
            self._files.makedirs(target.rpartition("/")[0], exist_ok=True)
            self._files.put_file(str(file), target)


def _state_of(file: Path) -> tuple[int, int]:
    """Return size and time of a file, which tell whether it has changed."""
    state = file.stat()
    return state.st_size, state.st_mtime_ns
