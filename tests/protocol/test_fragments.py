"""Long frames in pieces, at any size and in any order, within bounds."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.fragments import MAX_AGE, MAX_OPEN, MAX_PIECES, MIN_SIZE, Characters, Defragmenter, Pieces
from rosbridge_sim.protocol.json_decoding import decode_frame
from rosbridge_sim.protocol.ops import Fragment


def piece(op_id: str | int, num: float, total: float, data: str) -> Fragment:
    return Fragment(id=op_id, num=num, total=total, data=data)


def read(frame: bytes) -> Fragment:
    (op,) = decode_frame(frame)
    assert isinstance(op, Fragment)
    return op


def cut(frame: bytes, size: int, max_bytes: int = 2**30) -> list[bytes]:
    pieces = Pieces(Characters(frame), size, "frag:1")
    frames: list[bytes] = []
    while not pieces.is_finished:
        taken = pieces.take(max_bytes)
        assert sum(map(len, taken[:-1])) < max_bytes
        assert taken
        frames += taken
    return frames


@given(
    st.text(min_size=1, max_size=300),
    st.integers(1, 500),
    st.integers(1, 2_000),
    st.randoms(use_true_random=False),
)
def test_fragments_of_any_size_join_in_any_order(text: str, size: int, max_bytes: int, random: object) -> None:
    frame = json.dumps({"op": "publish", "msg": text * 10}, ensure_ascii=False).encode()
    frames = cut(frame, size, max_bytes)
    if frames == [frame]:
        return
    assert all(len(json.loads(f)["data"]) <= max(size, MIN_SIZE) for f in frames)
    assert [type(json.loads(f)["num"]) for f in frames] == [int] * len(frames)
    random.shuffle(frames)  # type: ignore[attr-defined] # a random.Random
    defragmenter = Defragmenter(100_000)
    *most, last = [defragmenter.add(read(f), 0.0) for f in frames]
    assert most == [None] * len(most)
    assert last == frame


@given(st.text(min_size=1, max_size=80), st.integers(1, 20))
def test_fragments_cut_inside_a_surrogate_pair_are_joined(text: str, size: int) -> None:
    units = text.encode("utf-16-le")
    cuts = [units[i : i + 2 * size] for i in range(0, len(units), 2 * size)]
    defragmenter = Defragmenter(10_000)
    whole = None
    for num, cut in enumerate(cuts):
        data = cut.decode("utf-16-le", "surrogatepass")  # JSON.stringify escapes a half: "\\ud83d"
        frame = json.dumps({"op": "fragment", "id": "x", "num": num, "total": len(cuts), "data": data}).encode()
        whole = defragmenter.add(read(frame), 0.0)
    assert whole == text.encode()


def test_short_frame_is_not_fragmented() -> None:
    assert cut(b'{"op":1}', 1) == [b'{"op":1}']
    accented = '{"é":"éééééé"}'.encode()
    assert cut(accented, 14) == [accented]  # 14 characters, 21 bytes
    assert len(cut(accented, 13)) == 2


def test_fragments_are_made_when_they_are_sent() -> None:
    pieces = Pieces(Characters(b"x" * 1_000_000), 1, "frag:1")
    assert pieces.num_bytes == 1_000_000
    assert len(pieces.take(1)) == 1
    assert 300 < len(pieces.take(64 * 1024)) < 656
    assert not pieces.is_finished


def test_number_of_fragments_of_a_message_is_bounded() -> None:
    assert len(cut(b"x" * 1_000_000, 1)) == MAX_PIECES


def test_two_fragmented_messages_can_interleave() -> None:
    defragmenter = Defragmenter(100)
    assert defragmenter.add(piece("a", 0, 2, "1"), 0.0) is None
    assert defragmenter.add(piece("b", 1, 2, "4"), 0.0) is None
    assert defragmenter.add(piece("a", 1, 2, "2"), 0.0) == b"12"
    assert defragmenter.add(piece("b", 0, 2, "3"), 0.0) == b"34"
    assert defragmenter.add(piece("a", 0, 1, "again"), 0.0) == b"again"


@pytest.mark.parametrize(
    ("num", "total"),
    [(-1, 2), (2, 2), (0, 0), (0, -1), (float("nan"), 2), (0, float("inf")), (0, MAX_PIECES + 1)],
)
def test_impossible_fragment_numbers_are_refused(num: float, total: float) -> None:
    with pytest.raises(FrameError, match="is not possible"):
        Defragmenter(100).add(piece("a", num, total, "x"), 0.0)


def test_contradicting_fragment_drops_the_message_and_not_the_next_one() -> None:
    defragmenter = Defragmenter(100)
    for wrong in (piece("a", 0, 2, "x"), piece("a", 1, 3, "x")):
        defragmenter.add(piece("a", 0, 2, "x"), 0.0)
        with pytest.raises(FrameError, match="does not go with those before"):
            defragmenter.add(wrong, 0.0)
    assert defragmenter.add(piece("a", 0, 1, "ok"), 0.0) == b"ok"


def test_fragments_are_bounded() -> None:
    defragmenter = Defragmenter(10)
    defragmenter.add(piece("a", 0, 2, "x" * 6), 0.0)
    with pytest.raises(FrameError, match="more than 10 bytes"):
        defragmenter.add(piece("b", 0, 2, "x" * 6), 0.0)
    assert defragmenter.add(piece("a", 1, 2, "x" * 4), 0.0) == b"x" * 10
    for i in range(MAX_OPEN):
        defragmenter.add(piece(i, 0, 2, ""), 0.0)
    with pytest.raises(FrameError, match="under way at once"):
        defragmenter.add(piece("one more", 0, 2, ""), 0.0)


def test_unfinished_messages_are_dropped() -> None:
    defragmenter = Defragmenter(100)
    for i in range(MAX_OPEN):
        defragmenter.add(piece(i, 0, 2, "x"), 0.0)
    assert defragmenter.add(piece("new", 0, 1, "ok"), MAX_AGE + 1.0) == b"ok"
    assert defragmenter.add(piece(0, 1, 2, "late"), MAX_AGE + 1.0) is None


def test_fragments_of_one_frame_share_its_text() -> None:
    frame = b'{"op":"publish","msg":{"data":"' + b"x" * 10_000 + b'"}}'
    text = Characters(frame)
    assert text.cut(0, len(frame)) == frame.decode()
    assert text._text is frame  # nothing is held beside the frame itself
    both = [Pieces(text, 1_000, "a"), Pieces(text, 1_000, "b")]
    joined = ["".join(json.loads(p)["data"] for p in pieces.take(2**30)) for pieces in both]
    assert joined == [frame.decode()] * 2


def test_fragments_are_counted_in_bytes() -> None:
    defragmenter = Defragmenter(100)
    with pytest.raises(FrameError, match="more than 100 bytes"):
        defragmenter.add(piece("f", 0, 2, "가" * 34), 0.0)
