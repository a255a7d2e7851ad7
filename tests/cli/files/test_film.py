"""`shot --scenario` and `clip`: files and refusals."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rosbridge_sim.client import Client
from rosbridge_sim.shell.app import Simulator
from tests.cli.tool_fixture import run
from tests.shell.rendering.graphics import open_renderer

SMALL = ("--scenario", "demo", "--size", "64x48")


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["webp", "gif", "png"])
def test_clip_has_its_pictures_and_their_times(tmp_path: Path, suffix: str) -> None:
    open_renderer()
    path = tmp_path / f"drive.{suffix}"
    done = run("clip", *SMALL, "--seconds", "0.4", "--fps", "15", "-o", str(path), "--json")
    assert (done.code, done.err) == (0, "")
    told = json.loads(done.out)
    assert told == {"file": str(path), "width": 64, "height": 48, "pictures": 6, "bytes": path.stat().st_size}
    times = []
    with Image.open(path) as clip:
        assert (clip.size, getattr(clip, "n_frames", 1), clip.info["loop"]) == ((64, 48), 6, 0)
        for i in range(6):
            clip.seek(i)
            clip.load()
            times.append(clip.info["duration"])
    assert times == [60, 60, 80, 60, 60, 80]  # 15 pictures a second, of frames of 20 ms


@pytest.mark.slow
def test_shot_of_a_camera_has_its_size_and_its_depth(tmp_path: Path) -> None:
    open_renderer()
    path = tmp_path / "depth.png"
    words = ("shot", "--scenario", "demo", "--sensors", "all", "--camera", "Camera-depth", "-o", str(path))
    done = run(*words)
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith(f"{path}  640 x 480  ")
    with Image.open(path) as picture:
        assert picture.mode.startswith("I;16")
        assert 1_000 < np.asarray(picture)[479, 320] < 10_000  # the road, in millimetres


@pytest.mark.slow
def test_clip_of_a_recording_ends_with_it_and_says_so(tmp_path: Path) -> None:
    open_renderer()
    bag, path = tmp_path / "drive.bag", tmp_path / "drive.gif"
    with Simulator(port=0, start="sync", scenario="demo", record=bag) as sim, Client(sim.url) as client:
        client.start_sync()
        client.tick(20)
    done = run("clip", "--recording", str(bag), "--size", "64x48", "--seconds", "2", "-o", str(path), "--json")
    num = json.loads(done.out)["pictures"]
    assert done.code == 0
    assert done.err == f"rosbridge-sim: the recording is over: {num} of 20 pictures\n"
    assert 3 <= num <= 6


def test_machine_that_cannot_draw_is_told_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "moderngl", None)
    done = run("shot", *SMALL, "-o", str(tmp_path / "a.png"))
    assert (done.code, done.complaint) == (
        2,
        "cameras need the library moderngl: pip install 'rosbridge-sim[sensors]'",
    )
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("clip", *SMALL, "-o", "a.jpg"), "--out: expected a file that ends with .webp, .gif, .png; got 'a.jpg'"),
        (("shot", *SMALL, "-o", "a.txt"), "--out: expected a file that ends with .webp, .gif, .png, .jpg, .jpeg; got"),
        (
            ("clip", "--size", "10x10", "-o", "a.gif"),
            "--size: expected WIDTHxHEIGHT in pixels, from 16x16",
        ),
        (("clip", "--fps", "0", "-o", "a.gif"), "--fps: expected pictures a second, from 0.1 to 50; got '0'"),
        (
            ("clip", "--size", "1920x1080", "--fps", "50", "-o", "a.gif"),
            "300 of 1920 x 1080 are 622,080,000: choose a smaller --size, --fps or --seconds",
        ),
        (
            ("clip", "--sensors", "all", "--camera", "Camera-depth", "-o", "a.gif"),
            "--camera: a clip needs a camera of colours; Camera-depth shows depth",
        ),
        (("shot", "--scenario", "tow", "-o", "a.png"), "no scenario 'tow'; known are"),
        (("shot", "--weather", "fog", "-o", "a.png"), "--weather: expected with --scenario or --recording"),
        (("shot", "--camera", "chase", "-o", "a.png"), "--camera chase: expected with --scenario or --recording"),
        (("clip", "--weather", "fogg", "-o", "a.gif"), "--weather: expected noon or dusk or night or rain or fog"),
        (("clip", "--recording", "/none.bag", "-o", "a.gif"), "none.bag: cannot be read"),
    ],
)
def test_refusals_say_what_to_do(words: tuple[str, ...], text: str) -> None:
    open_renderer()
    done = run(*words)
    assert done.code == 2
    assert text in done.err
    assert len(done.err.splitlines()) == 1
