"""Runs and their results: a row of the table, and a line of the file of results."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias

import msgspec

MOST: Final = 1e12
"""Largest number in a line of the file of results; a drive has none that is nearly as large."""

_Number = Annotated[float, msgspec.Meta(ge=-MOST, le=MOST)]
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
_Score = Annotated[int, msgspec.Meta(ge=-int(MOST), le=int(MOST))] | _Number | None  # 0 stays 0 in the table
_Whole = Annotated[int, msgspec.Meta(ge=1 - 2**63, le=2**63 - 1)]

Point: TypeAlias = Mapping[str, bool | _Whole | float | str]
"""Values of the parameters of a run, by name."""

Verdict = Literal["pass", "fail", "error", "skipped", "flaky"]
VERDICTS: Final[tuple[Verdict, ...]] = ("fail", "error", "flaky", "skipped", "pass")
"""All verdicts, the worst first."""

BAD: Final[frozenset[Verdict]] = frozenset({"fail", "error", "flaky"})
"""Verdicts that make a campaign fail."""

SCORES: Final = (
    *("distance", "collisions", "red_lights", "stop_lines", "lane_invasions", "off_road", "min_time_to_collision"),
    *("max_lane_offset", "max_jerk", "max_lateral_accel", "mean_speed", "max_speed", "time"),
)
"""Figures of a whole drive: those of its last frame, and mean and greatest speed [m/s]."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a campaign.

    Attributes:
        number: from 1 on, in the order of the table.
        scenario: name or file.
        seed: of the simulation.
        parameters: by name.
    """

    number: _Count
    scenario: str
    driver: str
    seed: _Count
    parameters: Point

    @property
    def key(self) -> tuple[object, ...]:
        """Key by which the same run is found in another campaign."""
        return self.scenario, self.driver, self.seed, tuple(sorted(self.parameters.items()))

    @property
    def title(self) -> str:
        """Driver, scenario, seed and parameters, in one line."""
        return f"{self.driver} {self.scenario} {self.chosen}".rstrip()

    @property
    def chosen(self) -> str:
        """Seed and parameters, in one line."""
        return " ".join(f"{name}={value}" for name, value in (("seed", self.seed), *self.parameters.items()))


class Breach(NamedTuple):
    """A limit that was not kept.

    Attributes:
        text: what was expected and what came.
        time: simulated time of the first frame that broke it [s].
        x, y: place of the ego then [m].
    """

    limit: str
    text: str
    time: _Number
    x: _Number
    y: _Number

    @property
    def told(self) -> str:
        """All of it in one line."""
        return f"{self.limit} at {self.time:g} s, ({self.x:g}, {self.y:g}): {self.text}"


@dataclass(frozen=True, slots=True)
class Result:
    """Result of a run.

    Attributes:
        verdict: of all its drives.
        reason: why, in one line; empty for a pass.
        breaches: limits that were not kept, the earliest first.
        scores: `SCORES` of the drive that decided; empty if nothing was driven.
        frames: that were driven.
        state_hash: of the world at the end; empty if nothing was driven.
        path: of the ego [m].
        verdicts: of each drive, if the run was repeated.
        files: what is kept, names in the run's folder.
        trouble: why other files are missing, such as a full disk; not part of the table.
        wall, cpu: time that it took [s]; not part of the table.
        worker: process and host that drove it; not part of the table.
        retries: so often it was driven again, because its worker was killed; not part of the table.
    """

    run: Run
    verdict: Verdict
    reason: str = ""
    breaches: tuple[Breach, ...] = ()
    scores: Mapping[str, float] = field(default_factory=dict)
    frames: _Count = 0
    state_hash: str = ""
    path: tuple[tuple[_Number, _Number], ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    files: tuple[str, ...] = ()
    trouble: str = ""
    wall: _Number = 0.0
    cpu: _Number = 0.0
    worker: str = ""
    retries: _Count = 0

    def to_json(self) -> dict[str, Any]:
        """Return the values for a line of the file; null stands for an infinite score."""
        values = msgspec.to_builtins(self)
        run = values.pop("run")
        scores = {name: value if math.isfinite(value) else None for name, value in self.scores.items()}
        times = {"wall": round(self.wall, 4), "cpu": round(self.cpu, 4)}
        return {"run": run.pop("number"), **run, **values, "scores": scores, **times}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Result:
        """Return the result that `to_json` has written.

        Raises:
            KeyError, TypeError, ValueError: it is another thing.
        """
        json.dumps(values, ensure_ascii=False).encode()  # half of a surrogate pair is an error; nothing could print it
        values = {"trouble": "", "retries": 0, **values}  # an older version has not written these
        run = {"number" if name == "run" else name: values[name] for name in _OF_RUN}
        rest = {each.name: values[each.name] for each in fields(cls) if each.name != "run"}
        scores = msgspec.convert(rest.pop("scores"), dict[str, _Score])
        found = msgspec.convert({"run": run, **rest}, cls)
        known = [(name, scores[name]) for name in SCORES if name in scores]
        told: dict[str, float] = {name: math.inf if score is None else score for name, score in known}
        return replace(found, scores=told)


_OF_RUN: Final = ("run", "scenario", "driver", "seed", "parameters")
"""Keys of a line that are about the run, whose number is `run`."""
