"""Runs and their results: a row of the table, and a line of the file of results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, TypeAlias

Point: TypeAlias = Mapping[str, bool | int | float | str]
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

    number: int
    scenario: str
    driver: str
    seed: int
    parameters: Point

    @property
    def key(self) -> tuple[object, ...]:
        """Key by which the same run is found in another campaign."""
        return self.scenario, self.driver, self.seed, tuple(sorted(self.parameters.items()))

    @property
    def title(self) -> str:
        """Driver, scenario, seed and parameters, in one line."""
        chosen = " ".join(f"{name}={value}" for name, value in self.parameters.items())
        return f"{self.driver} {self.scenario} seed={self.seed} {chosen}".rstrip()


@dataclass(frozen=True, slots=True)
class Breach:
    """A limit that was not kept.

    Attributes:
        text: what was expected and what came.
        time: simulated time of the first frame that broke it [s].
        x, y: place of the ego then [m].
    """

    limit: str
    text: str
    time: float
    x: float
    y: float


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
    frames: int = 0
    state_hash: str = ""
    path: tuple[tuple[float, float], ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    files: tuple[str, ...] = ()
    trouble: str = ""
    wall: float = 0.0
    cpu: float = 0.0
    worker: str = ""
    retries: int = 0

    def to_json(self) -> dict[str, Any]:
        """Return the values for a line of the file; null stands for an infinite score."""
        return {
            "run": self.run.number,
            "scenario": self.run.scenario,
            "driver": self.run.driver,
            "seed": self.run.seed,
            "parameters": dict(self.run.parameters),
            "verdict": self.verdict,
            "reason": self.reason,
            "breaches": [[each.limit, each.text, each.time, each.x, each.y] for each in self.breaches],
            "scores": {name: value if math.isfinite(value) else None for name, value in self.scores.items()},
            "frames": self.frames,
            "state_hash": self.state_hash,
            "path": [list(place) for place in self.path],
            "verdicts": list(self.verdicts),
            "files": list(self.files),
            "trouble": self.trouble,
            "wall": round(self.wall, 4),
            "cpu": round(self.cpu, 4),
            "worker": self.worker,
            "retries": self.retries,
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Result:
        """Return the result that `to_json` has written.

        Raises:
            KeyError, TypeError, ValueError: it is another thing.
        """
        run = Run(
            _integer(values["run"]),
            _text(values["scenario"]),
            _text(values["driver"]),
            _integer(values["seed"]),
            {_text(name): _parameter(value) for name, value in _group(values["parameters"]).items()},
        )
        scores = _group(values["scores"])
        return cls(
            run,
            _verdict(values["verdict"]),
            _text(values["reason"]),
            tuple(_breach(*each) for each in _list(values["breaches"])),
            {name: math.inf if scores[name] is None else _number(scores[name]) for name in SCORES if name in scores},
            _integer(values["frames"]),
            _text(values["state_hash"]),
            tuple((_number(x), _number(y)) for x, y in _list(values["path"])),
            tuple(map(_verdict, _list(values["verdicts"]))),
            tuple(map(_text, _list(values["files"]))),
            _text(values.get("trouble", "")),
            _number(values["wall"]),
            _number(values["cpu"]),
            _text(values["worker"]),
            _integer(values.get("retries", 0)),
        )


# Values of a line, which may have been written by hand


MOST: Final = 1e12
"""Largest number in a line; a drive has none that is nearly as large."""


def _wrong(value: object, expected: str) -> ValueError:
    return ValueError(f"expected {expected}, got {value!r:.60}")


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise _wrong(value, "a text")
    value.encode()  # half of a surrogate pair is an error; nothing could print it
    return value


def _integer(value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**63:
        raise _wrong(value, "a whole number from 0 on")
    return value


def _number(value: object) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) <= MOST:
        raise _wrong(value, f"a number of at most {MOST:g}")
    return value


def _parameter(value: object) -> bool | int | float | str:
    if isinstance(value, str):
        return _text(value)
    if not isinstance(value, bool | int | float) or (isinstance(value, int) and abs(value) >= 2**63):
        raise _wrong(value, "a switch, a number or a text")
    return value


def _group(value: object) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise _wrong(value, "values by name")
    return value


def _list(value: object) -> Sequence[Any]:
    if not isinstance(value, list):
        raise _wrong(value, "a list")
    return value


def _verdict(value: object) -> Verdict:
    found = next((each for each in VERDICTS if each == value), None)
    if found is None:
        raise _wrong(value, f"one of {', '.join(VERDICTS)}")
    return found


def _breach(limit: object, text: object, time: object, x: object, y: object) -> Breach:
    return Breach(_text(limit), _text(text), _number(time), _number(x), _number(y))
