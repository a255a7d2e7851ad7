"""Accepted and refused values of each setting."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.value_types import SWITCH, show_size


def read(key: str, value: object) -> object:
    return FLAGS[key].kind.read(value)


@pytest.mark.parametrize(
    ("key", "given_value", "value"),
    [
        ("port", "0", 0),
        ("port", 65_535, 65_535),
        ("port", 9090.0, 9090),
        ("seed", " 7 ", 7),
        ("start", "sync", "sync"),
        ("world", "off", False),
        ("world", "TRUE", True),
        ("world", "1", True),
        ("map", "none", None),
        ("map", "track", "track"),
        ("object-limit", "profile", None),
        ("object-limit", "0", 0),
        ("sync-lease", "none", None),
        ("sync-lease", "0", None),
        ("sync-lease", 2, 2.0),
        ("ping-interval", "0.5", 0.5),
        ("ping-interval", "off", None),
        ("max-frame-size", "16777216", 16_777_216),
        ("max-frame-size", "16 MiB", 16_777_216),
        ("max-frame-size", "1.5MB", 1_500_000),
        ("max-frame-size", "20k", 20_000),
        ("schema-path", "one", ("one",)),
        ("schema-path", ["one", Path("two")], ("one", "two")),
        ("config", Path("a.toml"), "a.toml"),
        ("rate", ["/Ego_topic=10", "clock=0.5"], {"/Ego_topic": 10.0, "/clock": 0.5}),
        ("rate", {"Ego_topic": 120}, {"/Ego_topic": 120.0}),
        ("token", "abc", "abc"),
        ("token", "none", None),
        ("certfile", Path("a.pem"), "a.pem"),
        ("allow-publish", "/a*", ("/a*",)),
        ("deny-param", ["/a ", "*"], ("/a", "*")),
        ("allow-origin", ["null", "https://a.b:1"], ("null", "https://a.b:1")),
        ("max-clients", "none", None),
        ("attach", "a", ("ws://a:9090",)),
        ("attach", ["wss://a/?token=b", "http://c:1"], ("wss://a/?token=b", "ws://c:1")),
        ("attach-retry", "0.5", 0.5),
        ("max-rate", 50, 50),
    ],
)
def test_valid_value_is_read(key: str, given_value: object, value: object) -> None:
    assert read(key, given_value) == value


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("port", "x"),
        ("port", -1),
        ("port", 65_536),
        ("port", 1.5),
        ("port", True),
        ("port", [9090]),
        ("port", "9090.0"),
        ("port", "1" * 5_000),
        ("host", ""),
        ("host", 4),
        ("host", "a\0b"),
        ("start", "Run"),
        ("start", ["run"]),
        ("world", "maybe"),
        ("world", 2),
        ("world", []),
        ("sync-lease", -1),
        ("sync-lease", "nan"),
        ("sync-lease", "inf"),
        ("sync-lease", True),
        ("max-frame-size", "16 potatoes"),
        ("max-frame-size", "1"),
        ("max-frame-size", 2**40),
        ("max-frame-size", 1.5),
        ("schema-path", [""]),
        ("schema-path", [3]),
        ("schema-path", 3),
        ("rate", "Ego_topic"),
        ("rate", "a=b=c"),
        ("rate", "=10"),
        ("rate", "a=0"),
        ("rate", "a=121"),
        ("rate", "a=nan"),
        ("rate", {"a": "fast"}),
        ("rate", {"a": True}),
        ("rate", 10),
        ("token", ""),
        ("token", "two words"),
        ("token", "ö"),
        ("token", 7),
        ("allow-publish", [""]),
        ("allow-publish", ["/a /b"]),
        ("allow-publish", ["/a\0"]),
        ("allow-publish", 3),
        ("max-clients", 0),
        ("max-rate", 0.5),
        ("max-held", 0),
        ("max-calls", "none"),
    ],
)
def test_invalid_value_is_refused(key: str, value: object) -> None:
    with pytest.raises((ValueError, TypeError, KeyError, OverflowError, AttributeError)):
        read(key, value)


@pytest.mark.parametrize("key", FIELDS)
def test_every_default_passes_its_own_check(key: str) -> None:
    default = getattr(Settings(), FIELDS[key].name)
    if key != "config":
        assert read(key, default) == default


@pytest.mark.parametrize("key", FIELDS)
def test_every_setting_has_a_help_text_and_a_value_description(key: str) -> None:
    flag = FLAGS[key]
    assert flag.group
    assert flag.text
    assert flag.kind.expects
    assert flag.kind.sign or flag.kind is SWITCH or flag.kind.is_table


def test_settings_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Settings().port = 1  # type: ignore[misc]


def test_settings_objects_share_no_mutable_default() -> None:
    assert Settings().publishers is not Settings().publishers


@given(st.integers(1024, 2**30))
def test_shown_size_is_read_back(size: int) -> None:
    assert read("max-frame-size", show_size(size)) == size
