"""Tools that describe files, given damaged files: a report or one error line, never a traceback."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.shell.files.library import DATA
from tests.cli.tool_fixture import run
from tests.mutations import Edit, edits, examples, spoil
from tests.simulator.small_maps import KOREAN, ROADRUNNER

SCENARIOS: dict[str, Any] = {
    **{path.stem: json.loads(path.read_bytes()) for path in sorted((DATA / "scenarios").glob("*.json"))},
    "saved": json.loads((Path(__file__).parents[1] / "scenarios" / "fixtures" / "saved.json").read_bytes()),
}
MAPS = {"korean": KOREAN, "roadrunner": ROADRUNNER}
FORMS = st.sampled_from([(), ("--json",)])


def explain(*words: str) -> None:
    done = run(*words)
    if done.code == 2:
        assert done.out == ""
        assert len(done.complaint) < 1_000
        return
    assert done.code in {0, 1}
    assert done.err == ""
    if "--json" in words:
        json.loads(done.out)
    else:
        assert done.lines


@pytest.mark.slow
@examples(20)
@given(name=st.sampled_from(sorted(SCENARIOS)), changes=edits(), form=FORMS)
def test_odd_scenario_gives_a_report_or_one_error_line(name: str, changes: list[Edit], form: tuple[str, ...]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.json"
        path.write_text(json.dumps(spoil(SCENARIOS[name], changes)))
        explain("scenario", "check", str(path), *form)


@pytest.mark.slow
@examples(20)
@given(name=st.sampled_from(sorted(MAPS)), data=st.data(), form=FORMS)
def test_odd_map_gives_a_report_or_one_error_line(name: str, data: st.DataObject, form: tuple[str, ...]) -> None:
    files = dict(MAPS[name])
    file = data.draw(st.sampled_from(sorted(files)))
    files[file] = spoil(files[file], data.draw(edits()))
    with tempfile.TemporaryDirectory() as folder:
        for file_name, content in files.items():
            (Path(folder) / file_name).write_text(json.dumps(content))
        explain("map", "info", folder, *form)
