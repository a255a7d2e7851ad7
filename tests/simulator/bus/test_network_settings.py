"""Network settings: valid values and errors."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.bus.network_settings import (
    DEFAULTS,
    InterfaceChoice,
    InterfaceKind,
    NetworkSettings,
    path_text,
    read_choices,
    split_prefix,
)

PUBLISHER, SUBSCRIBER, SERVICE = InterfaceKind


def test_settings_are_found_by_absolute_names() -> None:
    table = {"Ego_topic": {"name": "car/state", "rate": 25, "on": False}, "/tf": {}}
    assert read_choices(PUBLISHER, table) == {
        "/Ego_topic": InterfaceChoice("/car/state", is_on=False, rate=25.0),
        "/tf": InterfaceChoice(),
    }


def test_parsed_settings_are_accepted_unchanged() -> None:
    choices = read_choices(SERVICE, {"/sim/reset": {"on": False}})
    assert read_choices(SERVICE, choices) == choices


@pytest.mark.parametrize(
    ("kind", "table", "said"),
    [
        (SERVICE, [], 'services: expected a table such as "/NAME" = { on = true }, got a list of 0'),
        (SERVICE, {"/a": "/b"}, "services.\"/a\": expected a table of name, on, got '/b'"),
        (PUBLISHER, {"/a": 5}, 'publishers."/a": expected a table of name, on, rate, got 5'),
        (SERVICE, {"": {}}, "services.\"\": expected the name of a topic or service, without blanks, got ''"),
        (PUBLISHER, {"/": {}}, "publishers.\"/\": expected the name of a topic or service, without blanks, got '/'"),
        (
            SUBSCRIBER,
            {"/a": {"name": "b c"}},
            'subscribers."/a".name: expected the name of a topic or service, without blanks',
        ),
        (
            SUBSCRIBER,
            {"/a": {"name": 7}},
            'subscribers."/a".name: expected the name of a topic or service, without blanks, got 7',
        ),
        (SUBSCRIBER, {"/a": {"name": "x" * 200}}, 'subscribers."/a".name: expected the name of a topic'),
        (SUBSCRIBER, {"/a": {}, "a": {}}, "subscribers.a: expected each subscriber once"),
        (SUBSCRIBER, {"/a": {"on": 1}}, 'subscribers."/a".on: expected true or false, got 1'),
        (SUBSCRIBER, {"/a": {"rate": 1}}, 'subscribers."/a".rate: expected one of name, on'),
        (PUBLISHER, {"/a": {"rats": 1}}, 'publishers."/a".rats: expected one of name, on, rate (did you mean rate?)'),
        (PUBLISHER, {"/a": {"rate": True}}, 'publishers."/a".rate: expected more than 0 and at most 120 Hz, got true'),
        (PUBLISHER, {"/a": {"rate": 0}}, 'publishers."/a".rate: expected more than 0 and at most 120 Hz, got 0'),
        (PUBLISHER, {"/a": {"rate": 120.5}}, 'publishers."/a".rate: expected more than 0 and at most 120 Hz'),
        (PUBLISHER, {"/a": {"rate": float("nan")}}, 'publishers."/a".rate: expected more than 0'),
        (PUBLISHER, {"/a": {"rate": "fast"}}, 'publishers."/a".rate: expected more than 0'),
        (
            PUBLISHER,
            {"/a": {"name": "/Ego-2/a"}},
            'publishers."/a".name: expected no name that begins with /Ego-2/, which is an ego\'s',
        ),
        (PUBLISHER, {"/Ego-2/a": {"name": "/Ego-3/a"}}, 'publishers."/Ego-2/a".name: expected no name that begins'),
    ],
)
def test_error_is_reported_with_its_path(kind: InterfaceKind, table: Any, said: str) -> None:  # noqa: ANN401 - rubbish of any kind
    with pytest.raises(DocumentError) as caught:
        read_choices(kind, table)
    assert str(caught.value).startswith(said)


def test_error_path_uses_the_callers_name_for_the_document() -> None:
    with pytest.raises(DocumentError, match=r"^line 7 of services//a/on: expected"):
        read_choices(SERVICE, {"/a": {"on": 1}}, lambda path: "line 7 of " + "/".join(path))


def test_omitted_settings_have_their_defaults() -> None:
    settings = NetworkSettings(publishers={"/a": InterfaceChoice(rate=5.0), "/b": InterfaceChoice("/c", is_on=False)})
    assert settings.choice(PUBLISHER, "/a") == InterfaceChoice("/a", is_on=True, rate=5.0)
    assert settings.choice(PUBLISHER, "/b") == InterfaceChoice("/c", is_on=False)
    assert settings.choice(SERVICE, "/b") == InterfaceChoice("/b", is_on=True)
    assert DEFAULTS.choice(SERVICE, "/b") == InterfaceChoice("/b", is_on=True)


def test_settings_of_a_further_ego_default_to_those_of_the_first() -> None:
    settings = NetworkSettings(
        publishers={
            "/a": InterfaceChoice("/car/a", is_on=False, rate=5.0),
            "/Ego-3/a": InterfaceChoice("/third", is_on=True),
        }
    )
    assert settings.choice(PUBLISHER, "/a", "/Ego-2/") == InterfaceChoice("/Ego-2/car/a", is_on=False, rate=5.0)
    assert settings.choice(PUBLISHER, "/a", "/Ego-3/") == InterfaceChoice("/third", is_on=True, rate=5.0)
    assert settings.choice(PUBLISHER, "/b", "/Ego-3/") == InterfaceChoice("/Ego-3/b", is_on=True)
    assert settings.prefixes() == ["/", "/Ego-3/"]


def test_overriding_settings_keep_what_they_do_not_name() -> None:
    base = NetworkSettings(
        publishers={"/a": InterfaceChoice("/x", rate=5.0, where="file"), "/b": InterfaceChoice(is_on=False)},
        services={"/s": InterfaceChoice("/t")},
    )
    upper = NetworkSettings(publishers={"/a": InterfaceChoice(rate=7.0, where="flag"), "/c": InterfaceChoice("/d")})
    merged = upper.over(base)
    assert merged == NetworkSettings(
        publishers={
            "/a": InterfaceChoice("/x", rate=7.0),
            "/b": InterfaceChoice(is_on=False),
            "/c": InterfaceChoice("/d"),
        },
        services={"/s": InterfaceChoice("/t")},
    )
    assert merged.publishers["/a"].where == "file", "who has given it its name is to blame for that"


def test_name_is_split_into_ego_prefix_and_default_name() -> None:
    assert split_prefix("/Ego-12/a/b") == ("/Ego-12/", "/a/b")
    assert split_prefix("/a/Ego-2/b") == ("/", "/a/Ego-2/b")
    assert split_prefix("/Ego-2") == ("/", "/Ego-2")


def test_error_path_is_written_as_in_toml() -> None:
    assert path_text(("services", "/a", "on")) == 'services."/a".on'


def test_error_path_with_odd_keys_is_one_short_line() -> None:
    assert path_text(("a\nb", "x" * 5_000)) == '"a\\u000ab".' + "x" * 200 + "..."
