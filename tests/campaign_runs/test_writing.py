"""Kept files of a run, as the report reads them: whole, cut by a full disk, or written by hand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.writing import _read_scene, _read_trace
from rosbridge_sim.campaigns.run_results import MOST
from rosbridge_sim.campaigns.trace import FIGURES

BOX = [1.0, 2.0, 0.5, 4.0, 2.0, 1.0, 0.0, "car"]
SCENE = {"roads": [[[0, 1], [2.5, 3]]], "neighbours": [[0.02, [BOX]]]}


def test_whole_scene_is_read(tmp_path: Path) -> None:
    (tmp_path / "scene.json").write_text(json.dumps(SCENE))
    assert _read_scene(tmp_path / "scene.json") == {
        "roads": [[(0.0, 1.0), (2.5, 3.0)]],
        "neighbours": [(0.02, [tuple(BOX)])],
    }
    assert _read_scene(tmp_path / "none.json") == {}


@pytest.mark.parametrize(
    "text",
    [
        json.dumps(SCENE)[:-9],
        json.dumps(SCENE).replace("2.5", "NaN"),
        json.dumps(SCENE).replace("2.5", "-Infinity"),
        json.dumps(SCENE).replace("2.5", "[]"),
        json.dumps(SCENE | {"neighbours": [[0.02, [BOX[1:]]]]}),
        json.dumps(SCENE | {"neighbours": [[0.02, [[float("inf"), *BOX[1:]]]]]}),
        "[]",
    ],
)
def test_no_whole_scene_is_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "scene.json").write_text(text)
    assert _read_scene(tmp_path / "scene.json") == {}


def test_trace_needs_all_figures_and_places_that_can_be_drawn(tmp_path: Path) -> None:
    file, header = tmp_path / "trace.csv", ",".join(FIGURES)
    file.write_text(f"{header}\n{','.join(str(i) for i in range(len(FIGURES)))}\n")
    assert _read_trace(file) == {name: [float(i)] for i, name in enumerate(FIGURES)}
    for text in (
        f"{header.replace('time', 'thyme')}\n" + ",".join("1" * len(FIGURES)),
        f"{header}\n" + ",".join(["1"] * (len(FIGURES) - 1)),
        f"{header}\n" + ",".join(["nothing"] * len(FIGURES)),
        f"{header}\n" + ",".join([repr(2.0 * MOST)] * len(FIGURES)),
        "",
    ):
        file.write_text(text)
        assert _read_trace(file) == {}
