"""The file of a campaign, key by key: scenarios, parameters, drivers, limits.

`schemas/campaign.schema.json` and `docs/reference/campaigns.md` are generated from this module.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from msgspec import Meta, field

from rosbridge_sim.documents.document_model import DocumentType, Table, about
from rosbridge_sim.documents.document_reading import read_values
from rosbridge_sim.loose_types import JsonValue

MAX_RUNS: Final = 100_000
"""Most runs of a campaign: a table of 30 MB, and weeks on two cores."""

MAX_NAMES: Final = 100
"""Most drivers, parameters, limits and assignments each."""


MAX_VALUES: Final = 2_000_000
"""Most values of all parameters and samples together: a second, and 100 MB."""

MAX_SEED: Final = 2**32 - 1


def _read_scalar(value: object) -> object:
    if not isinstance(value, bool | int | float | str):
        raise ValueError("expected a number, a text, or true or false")  # noqa: TRY004 - as all mistakes
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("expected a finite number")
    return value


def _read_seeds(value: object) -> object:
    if isinstance(value, list):
        if not all(type(each) is int and 0 <= each <= MAX_SEED for each in value):
            raise ValueError(f"expected whole numbers from 0 to {MAX_SEED}")
    elif type(value) is not int or not 1 <= value <= MAX_RUNS:
        raise ValueError(f"expected a whole number from 1 to {MAX_RUNS}, or a list of seeds")
    return value


def _read_scenarios(value: object) -> object:
    names = value if isinstance(value, list) else [value]
    if not all(isinstance(each, str) for each in names):
        raise ValueError("expected a text, or a list of texts")
    return value


def _check_name(value: str) -> None:
    """Check a name that stands in tables and on terminals."""
    if not value.isprintable() or not 0 < len(value) <= MAX_NAME_LENGTH:
        raise ValueError(f"expected a name of 1 to {MAX_NAME_LENGTH} printable characters")


MAX_NAME_LENGTH: Final = 100

_Name = Annotated[str, Meta(extra={"check": _check_name})]

ParameterValue = Annotated[bool | int | float | str, Meta(extra={"read": _read_scalar})]
"""A value of a parameter; a text may be a word such as `rain`."""

_Text = Annotated[str, Meta(max_length=500)]
_Seconds = Annotated[float, Meta(ge=0.02, le=36_000.0)]
_NotNegative = Annotated[float, Meta(ge=0.0)]
_Positive = Annotated[float, Meta(gt=0.0)]
_Speed = Annotated[float, Meta(gt=0.0, le=100.0)]
_Count = Annotated[int, Meta(ge=0)]
_Many = Annotated[int, Meta(ge=1, le=MAX_RUNS)]
_Frames = Annotated[int, Meta(ge=1, le=500)]


class ParameterItem(Table, frozen=True, kw_only=True):
    """Values of a parameter: a list, or a range."""

    values: Annotated[
        Annotated[list[ParameterValue], Meta(min_length=1, max_length=MAX_RUNS)] | None, about("the values themselves")
    ] = None
    low: Annotated[float | None, about("least value of a range")] = None
    high: Annotated[float | None, about("greatest value of a range")] = None
    num: Annotated[_Many | None, about("values of the range in a grid, both ends among them")] = None
    whole: Annotated[bool, about("values of the range are rounded to whole numbers")] = False

    def __post_init__(self) -> None:
        """Check that the keys fit each other."""
        has_range = self.low is not None and self.high is not None
        if self.values is None and not has_range:
            raise ValueError("expected a list of values, or low and high")
        if self.values is not None and (self.low, self.high, self.num) != (None, None, None):
            raise ValueError("expected values or a range; got both")
        if has_range and self.low is not None and self.high is not None and not self.low <= self.high:
            raise ValueError("expected low <= high")


ParameterChoice = ParameterItem | list[ParameterValue]
"""A table, or the list of values alone."""


class DriverItem(Table, frozen=True, kw_only=True):
    """One way to drive the ego. Exactly one of `own`, `python`, `policy` and `command` is given."""

    own: Annotated[Literal["lanes"] | None, about("our own driver, which follows the lanes and the rules")] = None
    python: Annotated[
        _Text | None, about("`FILE.py:NAME` or `package.module:NAME`: a function of an observation, or a class of such")
    ] = None
    policy: Annotated[
        _Text | None,
        about(
            "the same: a function from the observation of `rosbridge_sim/LaneKeeping-v1` to its action;"
            " needs the extra `gym`, too"
        ),
    ] = None
    command: Annotated[
        Annotated[list[_Text], Meta(min_length=1, max_length=100)] | None,
        about(
            "a program and its arguments; `{url}`, `{seconds}`, `{seed}`, `{run}` and parameters are filled"
            " in; the variable ROSBRIDGE_SIM_URL has the URL, too"
        ),
    ] = None
    speed: Annotated[_Speed | None, about("of `own`: speed that it wants [m/s]; none for the limits")] = None
    every: Annotated[_Frames, about("frames of 20 ms between two decisions; of `python` and `policy`")] = 5
    batch: Annotated[
        int, about("of `python`: worlds that are driven at once with arrays of (n,); 0: one, numbers", ge=0, le=1024)
    ] = 0
    real_time: Annotated[
        bool,
        about(
            "of `command`: the world runs in real time from the moment at which the program connects, for"
            " programs that cannot tick"
        ),
    ] = False
    timeout: Annotated[float, about("longest time of a drive on the wall clock [s]", gt=0.0, le=86_400.0)] = 120.0
    memory_mb: Annotated[int, about("most memory of each process that drives [MB]", ge=64, le=1_000_000)] = 8_192
    environment: Annotated[dict[str, _Text], about("of `command`: variables", max_length=100)] = field(
        default_factory=dict
    )

    @classmethod
    def prepare(cls, value: JsonValue) -> JsonValue:
        """Read the short forms `"lanes"` and `"FILE.py:NAME"`."""
        if isinstance(value, str):
            return {"own": value} if value == "lanes" else {"python": value}
        return value

    def __post_init__(self) -> None:
        """Check that the keys fit each other."""
        given = [key for key in ("own", "python", "policy", "command") if getattr(self, key) is not None]
        if len(given) != 1:
            raise ValueError("expected exactly one of own, python, policy, command")
        name = self.python or self.policy
        if name is not None and not all(name.rpartition(":")[::2]):
            raise ValueError("expected FILE.py:NAME or package.module:NAME")
        if self.real_time and self.command is None:
            raise ValueError("real_time is for drivers with a command")
        if self.batch and self.python is None:
            raise ValueError("batch is for python drivers")

    @property
    def is_program(self) -> bool:
        """True if the driver is a separate program, which connects to a rosbridge."""
        return self.command is not None


class Place(Table, frozen=True, kw_only=True):
    """A place that the ego must reach."""

    x: Annotated[float, about("east [m]")]
    y: Annotated[float, about("north [m]")]
    radius: Annotated[float, about("the ego is there within it [m]", gt=0.0)] = 5.0
    within: Annotated[_Positive | None, about("latest time [s]; none for the end of the drive")] = None


class LimitItem(Table, frozen=True, kw_only=True):
    """A limit of the user's own: an expression, or a Python function."""

    always: Annotated[_Text | None, about("an expression that must hold in every frame that has a value")] = None
    end: Annotated[_Text | None, about("an expression that must hold in the last frame")] = None
    python: Annotated[
        _Text | None,
        about("`FILE.py:NAME`: a function of the trace that returns None, or a text that says what is wrong"),
    ] = None
    after: Annotated[float, about("of `always`: from this time on [s]", ge=0.0)] = 0.0

    def __post_init__(self) -> None:
        """Check that the keys fit each other."""
        if sum(each is not None for each in (self.always, self.end, self.python)) != 1:
            raise ValueError("expected exactly one of always, end, python")


class LimitsItem(Table, frozen=True, kw_only=True):
    """Limits of the scores, and the user's own."""

    collisions: Annotated[_Count | None, about("most collisions")] = None
    red_lights: Annotated[_Count | None, about("most red lights that were passed")] = None
    stop_lines: Annotated[_Count | None, about("most stop lines that were passed without a stop")] = None
    lane_invasions: Annotated[_Count | None, about("most changes of lane")] = None
    off_road: Annotated[_NotNegative | None, about("longest time off the road, all together [s]")] = None
    lane_error: Annotated[_NotNegative | None, about("greatest offset from the lane's line [m]")] = None
    time_to_collision: Annotated[_NotNegative | None, about("least time to collision [s]")] = None
    jerk: Annotated[_NotNegative | None, about("greatest jerk [m/s^3]")] = None
    lateral_accel: Annotated[_NotNegative | None, about("greatest lateral acceleration [m/s^2]")] = None
    distance: Annotated[_NotNegative | None, about("least distance driven at the end [m]")] = None
    arrival: Annotated[Place | None, about("a place that the ego must reach")] = None
    own: Annotated[dict[_Name, LimitItem], about("your own limits, by name", max_length=MAX_NAMES)] = field(
        default_factory=dict
    )


class SearchItem(Table, frozen=True, kw_only=True):
    """A search for the worst parameters, in place of a grid."""

    worst: Annotated[_Text, about("an expression over the scores of a run; the least value is the worst")] = (
        "min_time_to_collision"
    )
    budget: Annotated[int, about("most runs of each scenario, seed and driver", ge=4, le=MAX_RUNS)] = 100
    seed: Annotated[int, about("of the search's own chance", ge=1, le=2**31)] = 1
    stop_at_failure: Annotated[bool, about("end the search after the first batch with a failed run")] = False


class OutputItem(Table, frozen=True, kw_only=True):
    """Files that are kept of the runs."""

    keep: Annotated[Literal["failures", "all", "none"], about("of which runs traces, logs and recordings are kept")] = (
        "failures"
    )
    record: Annotated[
        bool, about("of `command`: also record the simulator's topics into drive.mcap, for those runs")
    ] = False
    quota_mb: Annotated[int, about("most of these files together [MB]", ge=1, le=10_000_000)] = 2_000


class CampaignDocument(Table, frozen=True, kw_only=True):
    """A campaign: every scenario, with every set of parameters, every seed and every driver."""

    scenario: Annotated[
        str | list[str],
        about("name of a built-in scenario or a file; or a list of them", extra={"read": _read_scenarios}),
    ]
    seconds: Annotated[_Seconds, about("simulated time of a drive [s]")] = 20.0
    end_when: Annotated[_Text | None, about("an expression that ends a drive earlier")] = None
    skip_when: Annotated[
        _Text | None, about("an expression over parameters and `seed`: runs for which it holds are skipped")
    ] = None
    seeds: Annotated[
        int | list[int],
        about("seeds of the simulation: a list, or a number n for 0 to n - 1", extra={"read": _read_seeds}),
    ] = 1
    repeat: Annotated[int, about("drives of each run; if their verdicts differ, the run is flaky", ge=1, le=20)] = 1
    sampling: Annotated[
        Literal["grid", "random", "latin hypercube", "list"],
        about(
            "how values are combined: all with all, `samples` by chance, the same evenly spread, or the"
            " n-th values together"
        ),
    ] = "grid"
    samples: Annotated[int, about("sets of parameters of random, latin hypercube", ge=1, le=MAX_RUNS)] = 100
    sampling_seed: Annotated[int, about("of the chance in them", ge=0, le=2**31)] = 0
    parameters: Annotated[dict[str, ParameterChoice], about("by name", max_length=MAX_NAMES)] = field(
        default_factory=dict
    )
    assign: Annotated[
        dict[str, ParameterValue],
        about(
            "`scenario.PATH`, `setting.KEY` or `vehicle` = a number, or an expression over the parameters",
            max_length=MAX_NAMES,
        ),
    ] = field(name="set", default_factory=dict)
    drivers: Annotated[dict[_Name, DriverItem], about("by name", max_length=MAX_NAMES)] = field(
        default_factory=lambda: {"ours": DriverItem(own="lanes")}
    )
    limits: Annotated[LimitsItem, about("what makes a run fail")] = LimitsItem()
    search: Annotated[SearchItem | None, about("search for the worst parameters")] = None
    output: Annotated[OutputItem, about("what is kept")] = OutputItem()


CAMPAIGN: Final = DocumentType[CampaignDocument](CampaignDocument)


def read_campaign_document(document: Mapping[str, Any], source: str) -> CampaignDocument:
    """Check the keys of a campaign's file.

    Args:
        document: the parsed TOML.
        source: name of the file, for errors.

    Raises:
        DocumentError: one line with the place, what was expected, and what came.
    """
    return read_values(CAMPAIGN, document, source)
