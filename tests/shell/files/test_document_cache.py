"""Documents are read once, and again when their files change."""

from __future__ import annotations

import os
import pickle
import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.document_cache import DocumentCache
from rosbridge_sim.shell.files.library import DATA, DiskLibrary

LONG_AGO = 1_000_000_000 * 10**9  # [ns]
PARKED = b'{"egoVehicle": {"initPosition": {"pos": {"x": 1, "y": 2}}}}'


class Document:
    """What is made of a file; compared by identity."""


def counted() -> tuple[list[Document], Callable[[], Document]]:
    made: list[Document] = []

    def make() -> Document:
        made.append(Document())
        return made[-1]

    return made, make


def write(path: Path, text: str = "x", changed_ns: int = LONG_AGO) -> Path:
    path.write_text(text)
    os.utime(path, ns=(changed_ns, changed_ns))
    return path


def test_unchanged_document_is_read_once(tmp_path: Path) -> None:
    cache, (made, make) = DocumentCache(), counted()
    file = write(tmp_path / "a")
    first = cache.get("map", file, [file], make)
    assert cache.get("map", file, [file], make) is first
    assert len(made) == 1
    assert cache.get("scenario", file, [file], make) is not first


def replace(file: Path) -> None:
    write(file.with_name("new")).replace(file)


@pytest.mark.parametrize(
    "change",
    [
        lambda file: write(file, "longer"),
        lambda file: write(file, changed_ns=LONG_AGO + 1),
        replace,
    ],
    ids=["size", "time", "inode"],
)
def test_changed_document_is_read_again(tmp_path: Path, change: Callable[[Path], object]) -> None:
    cache, (made, make) = DocumentCache(), counted()
    files = [write(tmp_path / "a"), write(tmp_path / "b")]
    cache.get("map", tmp_path, files, make)
    change(files[1])
    assert cache.get("map", tmp_path, files, make) is made[1]
    assert cache.get("map", tmp_path, files, make) is made[1]
    cache.get("map", tmp_path, files[:1], make)
    assert len(made) == 3


def test_file_that_changes_while_it_is_read_is_read_again(tmp_path: Path) -> None:
    cache, (made, make) = DocumentCache(), counted()
    file = write(tmp_path / "a")

    def change_and_make() -> Document:
        write(file, "longer")
        return make()

    cache.get("map", file, [file], change_and_make)
    cache.get("map", file, [file], make)
    assert len(made) == 2


def test_recently_written_file_is_read_again_if_requested(tmp_path: Path) -> None:
    cache, (made, make) = DocumentCache(), counted()
    file = tmp_path / "a"
    file.write_text("x")
    for _ in range(2):
        cache.get("scenario", file, [file], make, min_age=1e6)
    assert len(made) == 2
    os.utime(file, ns=(LONG_AGO, LONG_AGO))
    for _ in range(2):
        cache.get("scenario", file, [file], make, min_age=1e6)
    assert len(made) == 3


def test_failure_is_raised_and_not_cached(tmp_path: Path) -> None:
    cache, (made, make) = DocumentCache(), counted()
    file = write(tmp_path / "a")

    def fail() -> Document:
        raise DocumentError("torn")

    with pytest.raises(DocumentError, match="torn"):
        cache.get("map", file, [file], fail)
    cache.get("map", file, [file], make)
    missing = tmp_path / "missing"
    cache.get("map", missing, [missing], make)
    cache.get("map", missing, [missing], make)
    assert len(made) == 3


def test_least_recently_used_documents_are_dropped_first(tmp_path: Path) -> None:
    made, make = counted()
    a, b, c = (write(tmp_path / name, "x" * 10) for name in "abc")
    for cache in (DocumentCache(max_documents=2), DocumentCache(max_bytes=20)):
        made.clear()
        for file in (a, b, a, c, a):
            cache.get("map", file, [file], make)
        assert len(made) == 3
        cache.get("map", b, [b], make)
        assert len(made) == 4
    large = write(tmp_path / "large", "x" * 21)
    made.clear()
    for _ in range(2):
        cache.get("map", large, [large], make)
    assert len(made) == 2


def test_threads_share_one_read_of_a_document(tmp_path: Path) -> None:
    cache, (made, make) = DocumentCache(), counted()
    file = write(tmp_path / "a")
    is_reading, may_end = threading.Event(), threading.Event()
    got: list[Document] = []

    def slow() -> Document:
        is_reading.set()
        assert may_end.wait(10)
        return make()

    threads = [threading.Thread(target=lambda: got.append(cache.get("map", file, [file], slow))) for _ in range(3)]
    threads[0].start()
    assert is_reading.wait(10)
    for thread in threads[1:]:
        thread.start()
    other = write(tmp_path / "b")
    assert cache.get("map", other, [other], Document)  # another document does not wait
    may_end.set()
    for thread in threads:
        thread.join(10)
    assert got == made * 3


def test_library_caches_maps_and_scenarios(tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_bytes(PARKED)
    os.utime(tmp_path / "mine.json", ns=(LONG_AGO, LONG_AGO))
    library = DiskLibrary([tmp_path])
    assert library.map("track") is library.map("track")
    assert library.scenario("mine") is library.scenario("mine.json")


def test_libraries_share_the_built_in_maps_and_no_others(tmp_path: Path) -> None:
    shutil.copytree(DATA / "maps" / "track", tmp_path / "own")
    first, second = DiskLibrary(), DiskLibrary([tmp_path])
    assert first.map("track") is second.map("track") is pickle.loads(pickle.dumps(first)).map("track")  # noqa: S301
    own = [DiskLibrary(own_map=str(tmp_path / "own")).map("track") for _ in range(2)]
    assert len({id(each) for each in (*own, first.map("track"))}) == 3


def test_library_reads_a_just_rewritten_scenario_again(tmp_path: Path) -> None:
    file = tmp_path / "episode.json"
    library = DiskLibrary([tmp_path])
    for x in range(1, 6):  # of one size, in one file, faster than a file system's clock ticks
        file.write_bytes(PARKED.replace(b'"x": 1', b'"x": %d' % x))
        assert library.scenario("episode").egos[0].x == x
