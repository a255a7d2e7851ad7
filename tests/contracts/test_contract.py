"""The file of a contract: each mistake has its line, what was expected and what came."""

from __future__ import annotations

import pytest

from rosbridge_sim.contracts.contract import CONTRACT
from rosbridge_sim.documents.document_reading import check_values
from rosbridge_sim.documents.yaml_reading import read_yaml

HEAD = "topics:\n  /odom:\n    type: nav_msgs/Odometry\n"


def mistakes(text: str) -> list[str]:
    document = read_yaml(text, "c.yaml")
    return [mistake.text for mistake in check_values(CONTRACT, document.value, document.where)[1]]


def test_contract_with_all_terms_is_read() -> None:
    text = HEAD + (
        "    rate: 50\n    tolerance: 0.1\n    fields:\n      x: {min: -1, max: 2.5, nan: true}\n"
        "      frame: {values: [odom, true]}\n      'ranges': {min_length: 3}\n      y: {}\nservices: {/reset: ''}\n"
    )
    assert mistakes(text) == []


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        ("{}", "c.yaml:1: expected topics, services or both; a contract without them is always kept"),
        ("services: {reset: std_srvs/Empty}", "expected a name with a slash in front, such as /reset, got 'reset'"),
        (
            HEAD + "    rte: 5\n",
            "c.yaml:4: topics./odom.rte: expected one of type, rate, tolerance, fields (did you mean rate?)",
        ),
        (HEAD + "    rate: 0\n", "c.yaml:4: topics./odom.rate: expected more than 0, got 0"),
        (HEAD + "    rate: fast\n", "c.yaml:4: topics./odom.rate: expected a number, got 'fast'"),
        (
            HEAD + "    fields:\n      x: {min: 2, max: 1}\n",
            "c.yaml:5: topics./odom.fields.x: expected min of at most max",
        ),
        (HEAD + "    fields:\n      x: {min: 2, values: [a]}\n", "expected one of: min and max, values, min_length"),
        (
            HEAD + "    fields:\n      x: {values: [1]}\n",
            "expected a text, true or false; `min` and `max` are for numbers",
        ),
        (HEAD + "    fields:\n      x: {min: .nan}\n", "c.yaml:5: topics./odom.fields.x.min: expected a finite number"),
        ("topics: {/odom: {rate: 5}}", "topics./odom.type: missing; type, as either"),
        (HEAD + f"    fields:\n      x: {{values: [{'a, ' * 200}]}}\n", "expected at most 100 entries"),
        ("[1]", "c.yaml:1: expected an object"),
    ],
)
def test_mistake_is_told_with_its_line(text: str, mistake: str) -> None:
    (found,) = mistakes(text)
    assert mistake in found
