from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.noise_file import read_sensor_noise
from rosbridge_sim.simulator.sensors.sensor_noise import TYPICAL


def test_words_choose_none_and_typical_noise() -> None:
    assert read_sensor_noise("none") is None
    assert read_sensor_noise("typical") is TYPICAL


def test_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    path.write_text('{"imu": {"lost": 0.25}}', encoding="utf-8")
    noise = read_sensor_noise(str(path))
    assert noise is not None
    assert noise.imu.lost == 0.25


def test_misspelt_word_is_told_with_the_known_ones() -> None:
    with pytest.raises(DocumentError, match="expected none, typical or a file, got 'typicl'"):
        read_sensor_noise("typicl")


def test_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"none\.json: cannot be read"):
        read_sensor_noise(str(tmp_path / "none.json"))
