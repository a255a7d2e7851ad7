"""A campaign, checked and parsed: its runs in the order of the table, and what holds for all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

from rosbridge_sim.campaigns.assignments import Assignment, Change, read_assignments
from rosbridge_sim.campaigns.campaign_model import MAX_RUNS, CampaignDocument, DriverItem, read_campaign_document
from rosbridge_sim.campaigns.drive_limits import Limits, read_limits
from rosbridge_sim.campaigns.parameter_sets import expand_parameters, has_switch, ranges_of
from rosbridge_sim.campaigns.run_results import Point, Run
from rosbridge_sim.campaigns.trace import FIGURES
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import Expression, TopicField, Value, is_name, parse_expression
from rosbridge_sim.printable import MAX_QUOTED, printable
from rosbridge_sim.records import Record


class RunValues(Record):
    """Values that a run sets.

    Attributes:
        scenario: changes of the scenario's document.
        settings: of the server, by name.
        vehicle: model of the ego; None for that of the scenario.
    """

    scenario: tuple[Change, ...]
    settings: Mapping[str, Value]
    vehicle: str | None


class Campaign(Record):
    """A campaign as it was read: its runs, and how each is judged.

    Attributes:
        source: name of its file, for errors.
        document: as it was read.
        scenarios, seeds: in the order of the table.
        assignments: what each run sets.
        limits: what makes a run fail.
        end_when, skip_when: see the document.
    """

    source: str
    document: CampaignDocument
    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    assignments: tuple[Assignment, ...]
    limits: Limits
    end_when: Expression | None
    skip_when: Expression | None

    @property
    def drivers(self) -> Mapping[str, DriverItem]:
        """The drivers by name."""
        return self.document.drivers

    @property
    def parameters(self) -> Sequence[str]:
        """Names of the parameters, in the order of the columns."""
        return tuple(self.document.parameters)

    @property
    def fields(self) -> frozenset[TopicField]:
        """Fields of topics that its expressions read."""
        return self.limits.fields | (frozenset() if self.end_when is None else self.end_when.fields)

    def groups(self) -> list[Run]:
        """Return every scenario with every driver and seed, as runs without a number and parameters."""
        return [Run(0, *chosen, {}) for chosen in product(self.scenarios, self.drivers, self.seeds)]

    def values_of(self, run: Run) -> RunValues:
        """Return what a run sets.

        Raises:
            DocumentError: an expression has no value, or the vehicle is no text.
        """
        names = names_of(run)
        scenario: list[Change] = []
        settings: dict[str, Value] = {}
        vehicle: str | None = None
        for each in self.assignments:
            value = each.value_in(names)
            if isinstance(value, float) and value.is_integer():
                value = int(value)
            if each.room == "scenario":
                scenario.append((each.path, value))
            elif each.room == "setting":
                settings[str(each.path[0])] = value
            elif isinstance(value, str):
                vehicle = value
            else:
                raise DocumentError(f"{self.source}: set.vehicle: expected the name of a model, got {value!r}")
        return RunValues(tuple(scenario), settings, vehicle)


def names_of(run: Run) -> dict[str, Value]:
    """Return parameters and seed of a run, for expressions."""
    return {**run.parameters, "seed": run.seed}


def read_campaign(values: Mapping[str, Any], source: str) -> Campaign:
    """Check and parse a campaign.

    Args:
        values: the parsed TOML.
        source: name of the file, for errors.

    Raises:
        DocumentError: something in it cannot be used. The text says where.
    """
    document = read_campaign_document(values, source)
    for name in (*document.parameters, *document.drivers, *document.limits.own):
        if len(name) > MAX_QUOTED:
            shown = printable(name, 40)
            raise DocumentError(f"{source}: {shown}: expected a name of at most {MAX_QUOTED} characters")
    names = tuple(document.parameters)
    for name in names:
        if not is_name(name) or name in {*FIGURES, "seed"}:
            taken = "a figure of the drive" if name in FIGURES else "no name for expressions"
            raise DocumentError(f"{source}: parameters.{name}: {taken}; take another name, such as {name}_0")
    scenarios = (document.scenario,) if isinstance(document.scenario, str) else tuple(document.scenario)
    seeds = tuple(range(document.seeds)) if isinstance(document.seeds, int) else tuple(document.seeds)
    for key, listed in (("scenario", scenarios), ("seeds", seeds), ("drivers", tuple(document.drivers))):
        if not listed or len(set(listed)) < len(listed):
            raise DocumentError(f"{source}: {key}: expected at least one, and none twice")
    known = frozenset({*FIGURES, *names, "seed"})
    numbers = known - {name for name, item in document.parameters.items() if has_switch(item)}
    end_when = skip_when = None
    if document.end_when is not None:
        where = f"{source}: end_when"
        end_when = parse_expression(document.end_when, where, known, is_followed=True, numbers=numbers)
    if document.skip_when is not None:
        where = f"{source}: skip_when"
        skip_when = parse_expression(document.skip_when, where, frozenset({*names, "seed"}), numbers=numbers)
    assignments = read_assignments(document.assign, names, source)
    limits = read_limits(document.limits, known, numbers, source)
    return Campaign(source, document, scenarios, seeds, assignments, limits, end_when, skip_when)


def plan_runs(campaign: Campaign) -> list[Run]:
    """Return all runs of a campaign without a search, in the order of the table.

    Raises:
        DocumentError: parameters that cannot be combined, or too many runs.
    """
    points = expand_parameters(campaign.document, campaign.source)
    num_groups = len(campaign.scenarios) * len(campaign.drivers) * len(campaign.seeds)
    if len(points) * num_groups > MAX_RUNS:
        raise DocumentError(
            f"{campaign.source}: expected at most {MAX_RUNS:,} runs, got {len(points) * num_groups:,}: {num_groups}"
            f" scenarios with drivers and seeds, and {len(points):,} sets of parameters"
        )
    chosen = enumerate(product(campaign.scenarios, campaign.drivers, points, campaign.seeds), 1)
    return [Run(number, scenario, driver, seed, point) for number, (scenario, driver, point, seed) in chosen]


def check_search(campaign: Campaign) -> None:
    """Check that a search has ranges and a budget that is allowed.

    Raises:
        DocumentError: it has not.
    """
    search = campaign.document.search
    assert search is not None
    ranges_of(campaign.document, campaign.source)
    num = search.budget * len(campaign.groups())
    if num > MAX_RUNS:
        raise DocumentError(f"{campaign.source}: search.budget: expected at most {MAX_RUNS:,} runs in all, got {num:,}")


def is_skipped(campaign: Campaign, point: Point, seed: int) -> bool:
    """Return whether `skip_when` holds for a set of parameters."""
    return campaign.skip_when is not None and bool(campaign.skip_when({**point, "seed": seed}))
