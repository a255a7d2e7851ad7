from __future__ import annotations

import os
from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files import bounded_read
from rosbridge_sim.shell.files.bounded_read import PIECE, TURN, read_bounded, read_in_pieces


def test_file_is_read_up_to_its_bound(tmp_path: Path) -> None:
    path = tmp_path / "x"
    for size in (0, 1, 2**15, 2**15 + 1):
        path.write_bytes(b"x" * size)
        assert read_bounded(path, size) == b"x" * size
    with pytest.raises(DocumentError, match="expected at most 32,768 bytes; it is longer"):
        read_bounded(path, 2**15)


def test_device_is_refused() -> None:
    with pytest.raises(DocumentError, match=r"^/dev/null: expected a file, got a pipe or a device; write its content"):
        read_bounded(Path(os.devnull), 100)


def test_pipe_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "fifo"
    os.mkfifo(path)
    with pytest.raises(DocumentError, match="expected a file, got a pipe"):
        read_bounded(path, 100)


def test_folder_and_missing_file_are_told(tmp_path: Path) -> None:
    for path, why in ((tmp_path, "Is a directory"), (tmp_path / "none", "No such file or directory")):
        with pytest.raises(DocumentError, match=f"cannot be read: {why}"):
            read_bounded(path, 100)


def test_file_comes_in_pieces_up_to_its_length(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(bytes(range(256)) * 600)
    pieces = list(read_in_pieces(path, 1_000_000))
    assert (b"".join(pieces), len(pieces[0])) == (path.read_bytes(), PIECE)
    with pytest.raises(DocumentError, match="expected at most 1,000 bytes; it is longer"):
        next(read_in_pieces(path, 1_000))
    with pytest.raises(DocumentError, match="cannot be read: No such file"):
        next(read_in_pieces(tmp_path / "b", 1_000))
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DocumentError, match="expected a file, got a pipe"):
        next(read_in_pieces(tmp_path / "pipe", 1_000))


def test_other_threads_have_a_turn_after_each_piece(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    turns: list[float] = []
    monkeypatch.setattr(bounded_read, "sleep", turns.append)
    path = tmp_path / "a"
    path.write_bytes(bytes(3 * PIECE))
    seen = [len(turns) for _ in read_in_pieces(path, 1_000_000)]
    assert (seen, turns) == ([0, 1, 2], [TURN] * 3)
