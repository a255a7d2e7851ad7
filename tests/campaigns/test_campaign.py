"""A campaign's file: what it says, what is refused, and which runs it makes."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

from rosbridge_sim.campaigns.assignments import change_document
from rosbridge_sim.campaigns.campaign import Campaign, check_search, is_skipped, plan_runs, read_campaign
from rosbridge_sim.campaigns.campaign_model import ParameterItem
from rosbridge_sim.campaigns.parameter_sets import expand_parameters, place_in
from rosbridge_sim.errors import DocumentError


def campaign_of(text: str) -> Campaign:
    return read_campaign(tomllib.loads(text), "c.toml")


WHOLE = """
scenario = ["town", "loop"]
seeds = [3, 5]

[parameters]
gap = { low = 0.1, high = 0.5, num = 5 }
word = ["rain", "noon"]

[set]
"scenario.vehicleList[1].initPosition.pos.x" = "20 + gap * 10"
"setting.traffic" = "floor(gap * 10)"
"setting.weather" = "word"
vehicle = "'Van'"

[drivers]
ours = "lanes"
mine = "d.py:drive"
"""


def test_runs_are_every_scenario_driver_point_and_seed_in_this_order() -> None:
    runs = plan_runs(campaign_of(WHOLE))
    assert len(runs) == 2 * 2 * 10 * 2
    assert [run.number for run in runs] == list(range(1, 81))
    assert [(run.scenario, run.driver, run.seed) for run in runs[:3]] == [
        ("town", "ours", 3),
        ("town", "ours", 5),
        ("town", "ours", 3),
    ]
    assert [run.parameters["gap"] for run in runs[:20:4]] == [0.1, 0.2, 0.3, 0.4, 0.5]
    assert len({run.key for run in runs}) == 80


def test_one_scenario_with_a_number_of_seeds_is_planned_as_lists_are() -> None:
    campaign = campaign_of('scenario = "town"\nseeds = 3')
    assert (campaign.scenarios, campaign.seeds) == (("town",), (0, 1, 2))
    assert campaign_of('scenario = "town"\nseeds = 1').seeds == (0,)
    assert campaign_of('scenario = "town"\nseeds = [0, 4294967295]').seeds == (0, 4294967295)


def test_assignments_are_expressions_over_the_parameters() -> None:
    campaign = campaign_of(WHOLE)
    values = campaign.values_of(plan_runs(campaign)[12])
    assert values.scenario == ((("vehicleList", 1, "initPosition", "pos", "x"), 24),)
    assert values.settings == {"traffic": 4, "weather": "rain"}
    assert values.vehicle == "Van"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("seconds = 3", "scenario: missing"),
        ('scenario = "town"\nsecond = 3', "did you mean seconds"),
        ('scenario = "town"\n[limits]\ncolisions = 0', "did you mean collisions"),
        ('scenario = "town"\n[limits.own.a]\nalway = "speed < 3"', "did you mean always"),
        ('scenario = "town"\n[limits.own.a]\nalways = "spede < 3"', "did you mean speed"),
        ('scenario = "town"\n[limits.own.a]\nafter = 2', "exactly one of always, end, python"),
        ('scenario = "town"\n[drivers.a]\nspeed = 2', "exactly one of own, python, policy, command"),
        ('scenario = "town"\n[drivers.a]\npython = "a.py"', "expected FILE.py:NAME"),
        ('scenario = "town"\n[drivers.a]\nown = "lanes"\nbatch = 3', "batch is for python"),
        ('scenario = "town"\n[drivers.a]\nown = "lanes"\nreal_time = true', "real_time is for drivers with a command"),
        ('scenario = "town"\n[parameters]\nspeed = [1]', "a figure of the drive"),
        ('scenario = "town"\n[parameters]\n"a b" = [1]', "no name for expressions"),
        (
            'scenario = "town"\n[parameters]\na = { low = 0, high = 1, num = 1_000_000 }',
            "c.toml: parameters.a.num: exp",
        ),
        ('scenario = "town"\n[parameters]\na = [1, [2]]', "parameters.a[1]: expected a number, a text"),
        ('scenario = "town"\n[parameters]\na = 3', "parameters.a: expected an object or a list, got 3"),
        ('scenario = "town"\n[parameters]\na = { low = 1 }', "a list of values, or low and high"),
        ('scenario = "town"\n[parameters]\na = { low = 1, high = 2 }', "a grid needs num"),
        ('scenario = "town"\n[parameters]\na = { low = 3, high = 2, num = 2 }', "low <= high"),
        ('scenario = "town"\nsampling = "list"\n[parameters]\na = [1]\nb = [1, 2]', "a 1, b 2"),
        ('scenario = "town"\n[set]\n"settings.traffic" = 3', "expected scenario.PATH"),
        ('scenario = "town"\n[set]\n"scenario.a..b" = 3', "expected a path"),
        ('scenario = "town"\n[set]\n"setting.weather" = "rain"', "no value 'rain'"),
        ('scenario = ["town", "town"]', "none twice"),
        ('scenario = "town"\nseeds = []', "seeds: expected at least one"),
        ('scenario = "town"\nseeds = [4294967296]', "from 0 to 4294967295"),
        ('scenario = "town"\nseeds = [1.0]', "from 0 to 4294967295"),
        ('scenario = "town"\nseeds = [-1]', "from 0 to 4294967295"),
        ('scenario = "town"\nseeds = 1000000000000', "a whole number from 1 to 100000"),
        ("scenario = 3", "scenario: expected a text, or a list of texts, got 3"),
        ('scenario = "town"\n[parameters]\na = [inf]', "expected a finite number"),
        ('scenario = "town"\n[drivers]\n"a\\u001b[2J" = "lanes"', "printable characters"),
        (f'scenario = "town"\n[set]\n"scenario.{"a." * 5000}b" = 1', "a path of at most 200 characters"),
        (
            'scenario = "town"\nsampling = "random"\nsamples = 100000\n[parameters]\n'
            + "".join(f"p{i} = {{ low = 0, high = 1 }}\n" for i in range(30)),
            "at most 2,000,000 values together, got 3,000,000",
        ),
        (
            'scenario = "town"\n[parameters]\n'
            + "".join(f"p{i} = {{ low = 0, high = 1, num = 100000 }}\n" for i in range(99)),
            "at most 100,000 sets, got far more",
        ),
        ('scenario = "town"\nseeds = 2000\n[parameters]\na = { low = 0, high = 1, num = 100 }', "at most 100,000 runs"),
        ('scenario = "town"\nseconds = "long"', "expected a number"),
        *(
            (f'scenario = "town"\n{place} = "{text}"', f"a condition such as '{text} < 5', got '{text}'")
            for place in ("[limits.own.a]\nalways", "[limits.own.a]\nend", "end_when")
            for text in ("mean(abs(jerk))", "time", "speed < 3 and jerk", "3", "jerk if time > 2 else speed", "last(x)")
        ),
        ('scenario = "town"\nskip_when = "a"\n[parameters]\na = [0, 1]', "skip_when: expected a condition"),
        ('scenario = "town"\n[limits.own.a]\nend = "-/a.b"', "expected a condition"),
    ],
)
def test_mistake_is_told_with_its_place(text: str, what: str) -> None:
    with pytest.raises(DocumentError, match=r"^c\.toml: ") as caught:
        plan_runs(campaign_of(text))
    assert what in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "speed < 3 and not collisions",
        "/planner/state.is_ready",
        "ever(/a.b) or always(speed < 3)",
        "last(/a.b)",
        "first(speed > 1)",
        "True if time < 2 else jerk < 3",
        "wet",
    ],
)
def test_switches_and_comparisons_are_conditions(text: str) -> None:
    values = f'scenario = "town"\nend_when = "{text}"\n[parameters]\nwet = [true, false]\n'
    assert campaign_of(f'{values}[limits.own.a]\nend = "{text}"').limits.end["a"].text == text


def points(text: str) -> list[Any]:
    return expand_parameters(campaign_of('scenario = "town"\n' + text).document, "c.toml")


def test_latin_hypercube_has_one_value_in_each_part_of_each_range() -> None:
    found = points(
        'sampling = "latin hypercube"\nsamples = 20\n'
        "[parameters]\na = { low = 0, high = 20 }\nb = { low = -1, high = 1 }"
    )
    assert sorted(int(point["a"]) for point in found) == list(range(20))
    assert sorted(int((point["b"] + 1.0) * 10.0) for point in found) == list(range(20))
    assert [int(point["a"]) for point in found] != list(range(20))


def test_chance_depends_on_its_seed_alone() -> None:
    text = (
        'sampling = "random"\nsamples = 5\nsampling_seed = {}\n'
        '[parameters]\na = {{ low = 0, high = 9, whole = true }}\nw = ["x", "y"]'
    )
    assert points(text.format(1)) == points(text.format(1))
    assert points(text.format(1)) != points(text.format(2))
    assert all(isinstance(point["a"], int) and point["w"] in {"x", "y"} for point in points(text.format(1)))


def test_place_in_a_list_or_a_range_is_that_of_a_share_of_it() -> None:
    words, whole = ParameterItem(values=["a", "b", "c", "d"]), ParameterItem(low=-1.0, high=3.0, whole=True)
    shares = (0.0, 0.249, 0.25, 0.99, 1.0)
    assert [place_in(words, share) for share in shares] == ["a", "a", "b", "d", "d"]
    assert [place_in(whole, share) for share in shares] == [-1, 0, 0, 3, 3]
    assert place_in(ParameterItem(low=0.0, high=0.3), 1.0 / 3.0 * 3.0 - 2.0 / 3.0) == 0.1
    assert (
        points("[parameters]\na = { low = 2, high = 4, num = 1 }\nb = { low = 5, high = 5, num = 2 }")
        == [{"a": 3.0, "b": 5.0}] * 2
    )


def test_list_takes_the_nth_values_together() -> None:
    assert points('sampling = "list"\n[parameters]\na = [1, 2]\nb = { low = 5, high = 6, num = 2 }') == [
        {"a": 1, "b": 5.0},
        {"a": 2, "b": 6.0},
    ]


def test_condition_skips_runs() -> None:
    campaign = campaign_of('scenario = "town"\nskip_when = "a > 1 and seed == 0"\n[parameters]\na = [1, 2]')
    assert [is_skipped(campaign, {"a": a}, seed) for a, seed in ((1, 0), (2, 0), (2, 1))] == [False, True, False]


@pytest.mark.parametrize("values", ["[1, 2]", "{ low = 2, high = 2 }"])
def test_search_needs_ranges(values: str) -> None:
    with pytest.raises(DocumentError, match=r"parameters\.a: a search needs a range"):
        check_search(campaign_of(f'scenario = "town"\n[search]\n[parameters]\na = {values}'))


def test_fields_that_limits_read_are_those_of_all_their_expressions() -> None:
    limits = campaign_of(
        'scenario = "town"\n[limits.own.a]\nalways = "/plan.speed < 3 and /wish.x > 1"\n'
        '[limits.own.b]\nend = "count(/plan.speed > 2) == 1 or /last.y < 0"'
    ).limits
    assert {each.text for each in limits.fields} == {"/plan.speed", "/wish.x", "/last.y"}


def test_change_of_a_document_shares_the_rest_and_leaves_it_as_it_was() -> None:
    document = {"a": [{"b": 1}, {"b": 2}], "c": {"d": 3}}
    changed = change_document(document, [(("a", 1, "b"), 9), (("e", "f"), 1)], "s")
    assert changed == {"a": [{"b": 1}, {"b": 9}], "c": {"d": 3}, "e": {"f": 1}}
    assert document == {"a": [{"b": 1}, {"b": 2}], "c": {"d": 3}}
    assert changed["c"] is document["c"]


@pytest.mark.parametrize(
    ("path", "what"), [(("a", 2), "a list of 2"), (("c", 0), "no list"), (("a", 0, "b", "x"), "a table around it")]
)
def test_place_that_is_not_in_the_document_is_refused(path: tuple[str | int, ...], what: str) -> None:
    with pytest.raises(DocumentError, match=r"^s: ") as caught:
        change_document({"a": [{"b": 1}, {}], "c": {}}, [(path, 1)], "s")
    assert what in str(caught.value)


@pytest.mark.parametrize(
    "more",
    [
        {"NAME": 1},
        {"parameters": {"NAME": [1]}},
        {"parameters": {"gap": {"NAME": 1}}},
        {"drivers": {"NAME": "lanes"}},
        {"drivers": {"f": {"NAME": 1}}},
        {"drivers": {"f": "NAME"}},
        {"set": {"NAME": "1"}},
        {"set": {"vehicle": "NAME"}},
        {"limits": {"NAME": 1}},
        {"limits": {"own": {"NAME": {"always": "speed < 1"}}}},
        {"limits": {"own": {"f": {"NAME": 1}}}},
        {"limits": {"own": {"f": {"always": "NAME"}}}},
        {"end_when": "NAME"},
        {"skip_when": "NAME +"},
        {"seeds": "NAME"},
        {"sampling": "NAME"},
    ],
)
def test_error_about_a_long_name_shows_its_start(more: dict[str, Any]) -> None:
    document = {"scenario": "loop", "drivers": {"f": "lanes"}} | more
    long = eval(repr(document).replace("NAME", "k" * 100_000))  # noqa: S307 - what is written above
    with pytest.raises(DocumentError, match=r"kkk|expected") as error:
        plan_runs(read_campaign(long, "c.toml"))
    assert len(str(error.value)) < 1_000
