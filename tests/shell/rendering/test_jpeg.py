"""JPEG of pictures."""

from __future__ import annotations

import io
import sys

import numpy as np
import pytest
from PIL import Image

from rosbridge_sim.shell.rendering.jpeg import encode_jpeg
from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError
from tests.shell.rendering.graphics import need_jpeg


def test_thin_yellow_line_keeps_its_colour() -> None:
    need_jpeg()
    picture = np.full((48, 64, 3), 97, dtype=np.uint8)
    picture[:, 30:32] = (224, 188, 50)
    content = encode_jpeg(picture, 90)
    read = np.asarray(Image.open(io.BytesIO(content)))
    assert read.shape == (48, 64, 3)
    assert np.abs(read[24, 30].astype(int) - (224, 188, 50)).max() < 25


@pytest.mark.parametrize("quality", [0, 101])
def test_quality_is_bounded(quality: int) -> None:
    with pytest.raises(ValueError, match=r"1\.\.100"):
        encode_jpeg(np.zeros((8, 8, 3), dtype=np.uint8), quality)


def test_missing_library_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "simplejpeg", None)
    with pytest.raises(RenderingUnavailableError, match=r"rosbridge-sim\[sensors\]"):
        encode_jpeg(np.zeros((8, 8, 3), dtype=np.uint8))
