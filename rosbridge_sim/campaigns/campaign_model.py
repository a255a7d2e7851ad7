"""The file of a campaign, key by key: scenarios, parameters, drivers, limits.

`schemas/campaign.schema.json` and `docs/reference/campaigns.md` are generated from this module.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    TypeAdapter,
    model_validator,
)
from pydantic_core import PydanticCustomError

from rosbridge_sim.document_mistakes import CheckedModel, read_model
from rosbridge_sim.document_reading import content_of
from rosbridge_sim.documents import MAX_KEY_SHOWN, keys_beside, sort_keys
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.suggestions import hint

MAX_CAMPAIGN_BYTES: Final = 1 << 20
MAX_RUNS: Final = 100_000
"""Most runs of a campaign: a table of 30 MB, and weeks on two cores."""

MAX_NAMES: Final = 100
"""Most drivers, parameters, limits and assignments each."""


MAX_VALUES: Final = 2_000_000
"""Most values of all parameters and samples together: a second, and 100 MB."""

MAX_SEED: Final = 2**32 - 1


def _refuse_lists(value: object) -> object:
    if not isinstance(value, bool | int | float | str):
        raise PydanticCustomError("value", "expected a number, a text, or true or false")
    if isinstance(value, float) and not math.isfinite(value):
        raise PydanticCustomError("value", "expected a finite number")
    return value


def _check_seeds(value: object) -> object:
    """Check what a union of types would tell in two lines."""
    if isinstance(value, list):
        if not all(type(each) is int and 0 <= each <= MAX_SEED for each in value):
            raise PydanticCustomError("seeds", "expected whole numbers from 0 to 4294967295")
    elif type(value) is not int or not 1 <= value <= MAX_RUNS:
        raise PydanticCustomError("seeds", "expected a whole number from 1 to 100000, or a list of seeds")
    return value


def _check_scenarios(value: object) -> object:
    names = value if isinstance(value, list) else [value]
    if not all(isinstance(each, str) for each in names):
        raise PydanticCustomError("scenario", "expected a text, or a list of texts")
    return value


def _check_name(value: str) -> str:
    """Check a name that stands in tables and on terminals."""
    if not value.isprintable() or not 0 < len(value) <= MAX_NAME_LENGTH:
        raise PydanticCustomError("name", "expected a name of 1 to 100 printable characters")
    return value


MAX_NAME_LENGTH: Final = 100

_Name = Annotated[str, AfterValidator(_check_name)]


ParameterValue = Annotated[bool | int | float | str, BeforeValidator(_refuse_lists)]
"""A value of a parameter; a text may be a word such as `rain`."""

_Text = Annotated[str, Field(max_length=500)]
_Seconds = Annotated[float, Field(ge=0.02, le=36_000.0)]
_Frames = Annotated[int, Field(ge=1, le=500)]


class _Item(CheckedModel):
    """A table of the file; keys that there are not are mistakes."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, strict=True)


class ParameterItem(_Item):
    """Values of a parameter: a list, or a range."""

    values: Annotated[
        list[ParameterValue] | None, Field(min_length=1, max_length=MAX_RUNS, description="the values themselves")
    ] = None
    low: Annotated[float | None, Field(description="least value of a range")] = None
    high: Annotated[float | None, Field(description="greatest value of a range")] = None
    num: Annotated[
        int | None, Field(ge=1, le=MAX_RUNS, description="values of the range in a grid, both ends among them")
    ] = None
    whole: Annotated[bool, Field(description="values of the range are rounded to whole numbers")] = False

    @model_validator(mode="after")
    def _check(self) -> Self:
        has_range = self.low is not None and self.high is not None
        if (self.values is None) == (not has_range) and self.values is None:
            raise PydanticCustomError("range", "expected a list of values, or low and high")
        if self.values is not None and (self.low, self.high, self.num) != (None, None, None):
            raise PydanticCustomError("range", "expected values or a range; got both")
        if has_range and self.low is not None and self.high is not None and not self.low <= self.high:
            raise PydanticCustomError("range", "expected low <= high")
        return self


ParameterChoice = Annotated[
    Annotated[ParameterItem, Tag("")] | Annotated[list[ParameterValue], Tag("values")],
    Discriminator(lambda value: "values" if isinstance(value, list) else ""),
]
"""A table, or the list of values alone. An error names the place in the file, so the table has no tag."""


class DriverItem(_Item):
    """One way to drive the ego. Exactly one of `own`, `python`, `policy` and `command` is given."""

    own: Annotated[
        Literal["lanes"] | None, Field(description="our own driver, which follows the lanes and the rules")
    ] = None
    python: Annotated[
        _Text | None,
        Field(description="`FILE.py:NAME` or `package.module:NAME`: a function of an observation, or a class of such"),
    ] = None
    policy: Annotated[
        _Text | None,
        Field(
            description="the same: a function from the observation of `rosbridge_sim/LaneKeeping-v1` to its action;"
            " needs the extra `gym`, too"
        ),
    ] = None
    command: Annotated[
        list[_Text] | None,
        Field(
            min_length=1,
            max_length=100,
            description="a program and its arguments; `{url}`, `{seconds}`, `{seed}`, `{run}` and parameters are filled"
            " in; the variable ROSBRIDGE_SIM_URL has the URL, too",
        ),
    ] = None
    speed: Annotated[
        float | None, Field(gt=0.0, le=100.0, description="of `own`: speed that it wants [m/s]; none for the limits")
    ] = None
    every: Annotated[_Frames, Field(description="frames of 20 ms between two decisions; of `python` and `policy`")] = 5
    batch: Annotated[
        int,
        Field(
            ge=0,
            le=1024,
            description="of `python`: worlds that are driven at once with arrays of (n,); 0: one, numbers",
        ),
    ] = 0
    real_time: Annotated[
        bool,
        Field(
            description="of `command`: the world runs in real time from the moment at which the program connects, for"
            " programs that cannot tick"
        ),
    ] = False
    timeout: Annotated[
        float, Field(gt=0.0, le=86_400.0, description="longest time of a drive on the wall clock [s]")
    ] = 120.0
    memory_mb: Annotated[
        int, Field(ge=64, le=1_000_000, description="most memory of each process that drives [MB]")
    ] = 8_192
    environment: Annotated[dict[str, _Text], Field(max_length=100, description="of `command`: variables")] = Field(
        default_factory=dict
    )

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, value: object) -> object:
        """Read the short forms `"lanes"` and `"FILE.py:NAME"`."""
        if isinstance(value, str):
            return {"own": value} if value == "lanes" else {"python": value}
        return value

    @model_validator(mode="after")
    def _check(self) -> Self:
        given = [key for key in ("own", "python", "policy", "command") if getattr(self, key) is not None]
        if len(given) != 1:
            raise PydanticCustomError("driver", "expected exactly one of own, python, policy, command")
        name = self.python or self.policy
        if name is not None and not all(name.rpartition(":")[::2]):
            raise PydanticCustomError("driver", "expected FILE.py:NAME or package.module:NAME")
        if self.real_time and self.command is None:
            raise PydanticCustomError("driver", "real_time is for drivers with a command")
        if self.batch and self.python is None:
            raise PydanticCustomError("driver", "batch is for python drivers")
        return self

    @property
    def is_program(self) -> bool:
        """True if the driver is a separate program, which connects to a rosbridge."""
        return self.command is not None


class Place(_Item):
    """A place that the ego must reach."""

    x: Annotated[float, Field(description="east [m]")]
    y: Annotated[float, Field(description="north [m]")]
    radius: Annotated[float, Field(gt=0.0, description="the ego is there within it [m]")] = 5.0
    within: Annotated[float | None, Field(gt=0.0, description="latest time [s]; none for the end of the drive")] = None


class LimitItem(_Item):
    """A limit of the user's own: an expression, or a Python function."""

    always: Annotated[
        _Text | None, Field(description="an expression that must hold in every frame that has a value")
    ] = None
    end: Annotated[_Text | None, Field(description="an expression that must hold in the last frame")] = None
    python: Annotated[
        _Text | None,
        Field(
            description="`FILE.py:NAME`: a function of the trace that returns None, or a text that says what is wrong"
        ),
    ] = None
    after: Annotated[float, Field(ge=0.0, description="of `always`: from this time on [s]")] = 0.0

    @model_validator(mode="after")
    def _check(self) -> Self:
        if sum(each is not None for each in (self.always, self.end, self.python)) != 1:
            raise PydanticCustomError("limit", "expected exactly one of always, end, python")
        return self


class LimitsItem(_Item):
    """Limits of the scores, and the user's own."""

    collisions: Annotated[int | None, Field(ge=0, description="most collisions")] = None
    red_lights: Annotated[int | None, Field(ge=0, description="most red lights that were passed")] = None
    stop_lines: Annotated[int | None, Field(ge=0, description="most stop lines that were passed without a stop")] = None
    lane_invasions: Annotated[int | None, Field(ge=0, description="most changes of lane")] = None
    off_road: Annotated[float | None, Field(ge=0.0, description="longest time off the road, all together [s]")] = None
    lane_error: Annotated[float | None, Field(ge=0.0, description="greatest offset from the lane's line [m]")] = None
    time_to_collision: Annotated[float | None, Field(ge=0.0, description="least time to collision [s]")] = None
    jerk: Annotated[float | None, Field(ge=0.0, description="greatest jerk [m/s^3]")] = None
    lateral_accel: Annotated[float | None, Field(ge=0.0, description="greatest lateral acceleration [m/s^2]")] = None
    distance: Annotated[float | None, Field(ge=0.0, description="least distance driven at the end [m]")] = None
    arrival: Annotated[Place | None, Field(description="a place that the ego must reach")] = None
    own: Annotated[dict[_Name, LimitItem], Field(max_length=MAX_NAMES, description="your own limits, by name")] = Field(
        default_factory=dict
    )


class SearchItem(_Item):
    """A search for the worst parameters, in place of a grid."""

    worst: Annotated[
        _Text, Field(description="an expression over the scores of a run; the least value is the worst")
    ] = "min_time_to_collision"
    budget: Annotated[int, Field(ge=4, le=MAX_RUNS, description="most runs of each scenario, seed and driver")] = 100
    seed: Annotated[int, Field(ge=1, le=2**31, description="of the search's own chance")] = 1
    stop_at_failure: Annotated[bool, Field(description="end the search after the first batch with a failed run")] = (
        False
    )


class OutputItem(_Item):
    """Files that are kept of the runs."""

    keep: Annotated[
        Literal["failures", "all", "none"], Field(description="of which runs traces, logs and recordings are kept")
    ] = "failures"
    record: Annotated[
        bool, Field(description="of `command`: also record the simulator's topics into drive.mcap, for those runs")
    ] = False
    quota_mb: Annotated[int, Field(ge=1, le=10_000_000, description="most of these files together [MB]")] = 2_000


class CampaignDocument(_Item):
    """A campaign: every scenario, with every set of parameters, every seed and every driver."""

    scenario: Annotated[
        str | list[str],
        BeforeValidator(_check_scenarios),
        Field(description="name of a built-in scenario or a file; or a list of them"),
    ]
    seconds: Annotated[_Seconds, Field(description="simulated time of a drive [s]")] = 20.0
    end_when: Annotated[_Text | None, Field(description="an expression that ends a drive earlier")] = None
    skip_when: Annotated[
        _Text | None, Field(description="an expression over parameters and `seed`: runs for which it holds are skipped")
    ] = None
    seeds: Annotated[
        int | list[int],
        BeforeValidator(_check_seeds),
        Field(description="seeds of the simulation: a list, or a number n for 0 to n - 1"),
    ] = 1
    repeat: Annotated[
        int, Field(ge=1, le=20, description="drives of each run; if their verdicts differ, the run is flaky")
    ] = 1
    sampling: Annotated[
        Literal["grid", "random", "latin hypercube", "list"],
        Field(
            description="how values are combined: all with all, `samples` by chance, the same evenly spread, or the"
            " n-th values together"
        ),
    ] = "grid"
    samples: Annotated[int, Field(ge=1, le=MAX_RUNS, description="sets of parameters of random, latin hypercube")] = 100
    sampling_seed: Annotated[int, Field(ge=0, le=2**31, description="of the chance in them")] = 0
    parameters: Annotated[dict[str, ParameterChoice], Field(max_length=MAX_NAMES, description="by name")] = Field(
        default_factory=dict
    )
    assign: Annotated[
        dict[str, ParameterValue],
        Field(
            alias="set",
            max_length=MAX_NAMES,
            description="`scenario.PATH`, `setting.KEY` or `vehicle` = a number, or an expression over the parameters",
        ),
    ] = Field(default_factory=dict)
    drivers: Annotated[dict[_Name, DriverItem], Field(max_length=MAX_NAMES, description="by name")] = Field(
        default_factory=lambda: {"ours": DriverItem(own="lanes")}
    )
    limits: Annotated[LimitsItem, Field(description="what makes a run fail")] = Field(default_factory=LimitsItem)
    search: Annotated[SearchItem | None, Field(description="search for the worst parameters")] = None
    output: Annotated[OutputItem, Field(description="what is kept")] = Field(default_factory=OutputItem)


_DOCUMENT: Final = TypeAdapter(CampaignDocument)


def read_campaign_document(document: Mapping[str, Any], source: str) -> CampaignDocument:
    """Check the keys of a campaign's file.

    Args:
        document: the parsed TOML.
        source: name of the file, for errors.

    Raises:
        DocumentError: one line with the place, what was expected, and what came.
    """
    known: list[str]
    for path in sort_keys(CampaignDocument, _without_names(document)).passed_over:
        key = path.rpartition(".")[2]
        if path == "set":
            continue  # the alias of `assign`
        known = ["set" if each == "assign" else each for each in keys_beside(CampaignDocument, path)]
        raise DocumentError(f"{source}: {path}: expected one of {', '.join(known)}{hint(key, known)}")
    _check_named(document, source)
    text = json.dumps(document, default=str).encode()
    return read_model(_DOCUMENT, content_of(text, source, MAX_CAMPAIGN_BYTES), source)


_NAMED: Final[tuple[tuple[tuple[str, ...], type[CheckedModel]], ...]] = (
    (("parameters",), ParameterItem),
    (("drivers",), DriverItem),
    (("limits", "own"), LimitItem),
)
"""Tables whose keys are names of the user, and the models of their values."""


def _without_names(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the document without what stands under names of the user."""
    rest = {key: value for key, value in document.items() if key not in {"parameters", "drivers", "set"}}
    if isinstance(rest.get("limits"), dict):
        rest["limits"] = {key: value for key, value in rest["limits"].items() if key != "own"}
    return rest


def _check_named(document: Mapping[str, Any], source: str) -> None:
    """Refuse unknown keys in tables under names of the user.

    Raises:
        DocumentError: there is one.
    """
    for path, kind in _NAMED:
        table: object = document
        for part in path:
            table = table.get(part) if isinstance(table, Mapping) else None
        for name, value in table.items() if isinstance(table, Mapping) else ():
            for key in value if isinstance(value, Mapping) else ():
                if key not in kind.model_fields:
                    known = list(kind.model_fields)
                    where = ".".join([*path, *(printable(str(part), MAX_KEY_SHOWN) for part in (name, key))])
                    raise DocumentError(f"{source}: {where}: expected one of {', '.join(known)}{hint(key, known)}")


def campaign_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of campaign files."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_DOCUMENT.json_schema()}
