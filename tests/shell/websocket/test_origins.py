"""Origins and hosts of handshakes: allowed web pages, and refusals of others."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.shell.websocket.origins import MAX_REFUSED_ORIGINS, OriginRules, RefusedOrigins, own_names

NAMES = own_names("robot.plant.example")

LOOPBACK = "127.0.0.1:9090"


def judge(
    origin: str, host: str, *, is_loopback: bool = True, origins: tuple[str, ...] = (), hosts: tuple[str, ...] = ()
) -> str | None:
    return OriginRules(origins, hosts).judge([origin], [host], NAMES, is_loopback=is_loopback)


both = pytest.mark.parametrize("is_loopback", [True, False])


# Programs


@both
@pytest.mark.parametrize("host", ["sim:9090", "localhost:9090", "192.168.1.5:9090", "evil.example", "", "\0"])
def test_request_without_an_origin_needs_no_host(host: str, *, is_loopback: bool) -> None:
    for rules in (OriginRules(), OriginRules(("https://a.example",), ("b",))):
        assert rules.judge([], [host], frozenset(), is_loopback=is_loopback) is None
        assert rules.judge([], [], frozenset(), is_loopback=is_loopback) is None


@both
@pytest.mark.parametrize(
    "address",
    [
        "127.0.0.1:9090",
        "127.0.1.1:9090",
        "localhost:9090",
        "localhost:19090",
        "localhost",
        "[::1]:9090",
        "192.168.1.5:9090",
        "[fd00::1]:9090",
        "[fe80::1%eth0]:9090",
        "robot:9090",
        "robot.local:9090",
        "robot.plant.example:9090",
        "sim.localhost:9090",
    ],
)
def test_origin_equal_to_the_host_passes_for_a_trusted_host(address: str, *, is_loopback: bool) -> None:
    """As Python's websocket-client sends it: directly, through a published Docker port, through an SSH tunnel."""
    for scheme in ("http", "https"):
        assert judge(f"{scheme}://{address}", address, is_loopback=is_loopback) is None


@both
@pytest.mark.parametrize(
    ("origin", "host"),
    [
        ("http://robot", "robot:80"),
        ("http://robot:80", "robot"),
        ("https://robot", "robot:443"),
        ("https://robot:443", "robot"),
        ("HTTP://Robot:9090", "rObot:09090"),
        ("http://robot.:9090", "robot:9090"),
        ("http://10.0.0.7.:9090", "10.0.0.7:9090"),
        ("http://10.0.0.7:9090", "10.0.0.7.:9090"),
        ("http://[fd00:0:0::1]:9090", "[FD00::1]:9090"),
        ("http://robot:", "robot"),
    ],
)
def test_two_spellings_of_an_address_are_equal(origin: str, host: str, *, is_loopback: bool) -> None:
    assert judge(origin, host, is_loopback=is_loopback) is None


# Pages of this machine


@both
@pytest.mark.parametrize(
    "origin",
    [
        "http://localhost:3000",
        "https://localhost",
        "HTTP://LocalHost:3000",
        "http://localhost.:3000",
        "http://127.0.0.1:8080",
        "http://[::1]:8080",
        "http://[0:0:0:0:0:0:0:1]:8080",
        "vscode-webview://0f1lk8v3mq",
        "file://",
        "app://",
        "app://obsidian.md",
        "FILE://",
        "capacitor://localhost",
        "chrome-extension://abcdefgh",
    ],
)
@pytest.mark.parametrize("host", [LOOPBACK, "localhost:9090", "localhost:19090", "[::1]:9090", "192.168.1.5:9090"])
def test_local_pages_pass(origin: str, host: str, *, is_loopback: bool) -> None:
    assert judge(origin, host, is_loopback=is_loopback) is None


# Pages of websites


@both
@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example",
        "http://evil.example:9090",
        "http://localhost.evil.example",
        "http://evil-localhost",
        "http://127.0.0.1.evil.example",
        "http://xn--lcalhost-m4d",
        "http://8.8.8.8:9090",
        "http://128.0.0.1",
        "http://[2001:db8::1]",
        "http://0x7f.1:9090",
        "ftp://evil.example",
    ],
)
def test_other_pages_are_refused_with_the_flag_to_use(origin: str, *, is_loopback: bool) -> None:
    why = judge(origin, LOOPBACK, is_loopback=is_loopback)
    assert why is not None
    flag, _, end = why.partition("--allow-origin ")[2].partition(" would")
    assert (flag.strip("'"), end) == (origin, " let them")
    assert judge(origin, LOOPBACK, is_loopback=is_loopback, origins=(flag.strip("'"),)) is None


@both
def test_null_origin_is_refused_until_the_flag_names_it(*, is_loopback: bool) -> None:
    for origin in ("null", "NULL"):
        why = judge(origin, LOOPBACK, is_loopback=is_loopback)
        assert why is not None
        assert "--allow-origin null" in why
        assert "every website" in why
        assert judge(origin, LOOPBACK, is_loopback=is_loopback, origins=("null",)) is None


@both
@pytest.mark.parametrize("origins", [(), ("https://app.example", "http://[ab]*")])
@pytest.mark.parametrize(
    "origin",
    [
        "",
        " ",
        "localhost",
        "localhost:3000",
        "http:localhost",
        "http:/localhost",
        "http://",
        "http://:3000",
        "http://.",
        "http://localhost/",
        "http://localhost:3000/x",
        "http://evil.example@localhost:3000",
        "http://localhost@evil.example",
        "http://localhost:3000@evil.example",
        "http://localhost:x",
        "http://localhost:300000",
        "http://localhost:\u0663",
        "http://[::1",
        "http://::1",
        "http://[localhost]",
        "http://[127.0.0.1]",
        "http://l\u00f6calhost",
        "http://localhost\udcff",
        "http://localhost http://evil.example",
        "app://a, http://evil.example",
        "app://a,http://evil.example",
        "://localhost",
        "http://*",
        "*",
        "null null",
        "http://" + "a" * 400,
    ],
)
def test_malformed_origin_is_refused_and_no_flag_is_offered(
    origin: str, origins: tuple[str, ...], *, is_loopback: bool
) -> None:
    why = judge(origin, LOOPBACK, is_loopback=is_loopback, origins=origins)
    assert why is not None
    assert why.startswith("Expected an Origin such as https://app.example.org, or none; got ")
    assert why.isascii()
    assert len(why) < 200
    assert "--allow" not in why


def test_two_origin_headers_are_refused() -> None:
    for rules in (OriginRules(), OriginRules(("*",))):
        why = rules.judge(["http://localhost"] * 2, [LOOPBACK], NAMES, is_loopback=True)
        assert why == "Expected one Origin header; got 2"


# Pages of the same host


@pytest.mark.parametrize(
    ("origin", "host", "is_let_in"),
    [
        ("http://robot.local", "robot.local:9090", True),
        ("https://Robot.local:8443", "robot.local:9090", True),
        ("http://10.0.0.7:8080", "10.0.0.7:9090", True),
        ("http://[fd00::1]:8080", "[fd00::1]:9090", True),
        ("http://other.local", "other.local:9090", False),
        ("http://10.0.0.8:8080", "10.0.0.7:9090", False),
        ("http://robot.local.evil.example", "robot.local:9090", False),
        ("http://robot.local@evil.example", "robot.local:9090", False),
        ("https://evil.example", "robot.local:9090", False),
    ],
)
def test_other_ports_of_the_same_host_pass_off_loopback(origin: str, host: str, *, is_let_in: bool) -> None:
    assert (judge(origin, host, is_loopback=False) is None) is is_let_in
    assert judge(origin, host, is_loopback=True) is not None, "what a tunnel shows is another machine"


# Hosts


REBOUND = "rebound.example:9090"


@both
@pytest.mark.parametrize(
    "host",
    [
        REBOUND,
        "sim:9090",
        "127.0.0.1.evil.example",
        "localhost.evil.example:9090",
        "evillocalhost",
        "com",
        "127.1:9090",
    ],
)
def test_host_equal_to_the_origin_is_not_enough(host: str, *, is_loopback: bool) -> None:
    """A name that was made to point here, and a service's name in Docker Compose, which looks the same."""
    why = judge(f"http://{host}", host, is_loopback=is_loopback)
    name = host.partition(":")[0]
    assert why is not None
    assert f"--allow-host {name} would let them" in why
    for pattern in (name, name.upper(), f"{name[:2]}*", "*"):
        assert judge(f"http://{host}", host, is_loopback=is_loopback, hosts=("x", pattern)) is None
    assert judge(f"http://{host}", host, is_loopback=is_loopback, hosts=(f"{name}x", "x*")) is not None


@both
@pytest.mark.parametrize("origin", ["http://localhost:3000", "vscode-webview://x", "file://"])
def test_host_is_checked_for_every_default_page(origin: str, *, is_loopback: bool) -> None:
    assert "--allow-host sim " in (judge(origin, "sim:9090", is_loopback=is_loopback) or "")
    assert judge(origin, "sim:9090", is_loopback=is_loopback, hosts=("sim",)) is None
    assert judge(origin, "sim.lab.example", is_loopback=is_loopback, hosts=("*.lab.example",)) is None
    assert judge(origin, "sim:9090", is_loopback=is_loopback, hosts=("sim:9090",)) is None
    assert judge(origin, "sim:9091", is_loopback=is_loopback, hosts=("sim:9090",)) is not None


@both
@pytest.mark.parametrize(
    "host", ["", "localhost:x", "a b", "localhost@evil.example", "[::1", "[::1]x", "[x]", "x" * 400]
)
def test_malformed_host_beside_an_origin_is_refused(host: str, *, is_loopback: bool) -> None:
    why = judge("http://localhost:3000", host, is_loopback=is_loopback, hosts=("*",))
    assert why is not None
    assert why.startswith("Expected a Host such as localhost:9090 beside an Origin; got ")
    assert len(why) < 200


@pytest.mark.parametrize("hosts", [[], ["localhost", "localhost"]])
def test_duplicate_host_beside_an_origin_is_refused(hosts: list[str]) -> None:
    why = OriginRules(hosts=("*",)).judge(["http://localhost"], hosts, NAMES, is_loopback=True)
    assert why == f"Expected one Host header beside an Origin; got {len(hosts)}"


# Plain HTTP


@pytest.mark.parametrize(
    "host",
    ["localhost:9090", "LOCALHOST", "sim.localhost", "10.0.0.7:9090", "[fd00::1]:80", "robot:9090", "robot.local"],
)
def test_data_are_told_to_a_host_that_no_website_can_choose(host: str) -> None:
    assert OriginRules().judge_host([host], NAMES) is None


@pytest.mark.parametrize("host", [REBOUND, "sim:9090", "127.0.0.1.evil.example", "evillocalhost", "127.1:9090"])
def test_data_are_not_told_to_another_host_until_the_flag_names_it(host: str) -> None:
    name = host.partition(":")[0]
    for rules in (OriginRules(), OriginRules(("*",), (f"{name}x",))):
        assert f"; --allow-host {name} would let them" in (rules.judge_host([host], NAMES) or "")
    for pattern in (name, f"{name[:2]}*", "*"):
        assert OriginRules(hosts=(pattern,)).judge_host([host], NAMES) is None


@pytest.mark.parametrize(
    ("hosts", "why"),
    [
        ([], "Expected one Host header; got 0"),
        (["localhost", "localhost"], "Expected one Host header; got 2"),
        (["a b"], "Expected a Host such as localhost:9090; got 'a b'"),
    ],
)
def test_data_need_one_host_that_is_well_formed(hosts: list[str], why: str) -> None:
    assert OriginRules(hosts=("*",)).judge_host(hosts, NAMES) == why


@pytest.mark.parametrize(
    ("hostname", "names"),
    [
        ("robot", {"robot", "robot.local"}),
        ("Robot.Plant.example.", {"robot.plant.example", "robot", "robot.local"}),
        ("robot.local", {"robot", "robot.local"}),
        ("", set()),
        (".", set()),
        (".example", set()),
    ],
)
def test_machine_name_is_accepted_alone_and_with_a_local_domain(hostname: str, names: set[str]) -> None:
    assert own_names(hostname) == names


# What the user allows


@both
@pytest.mark.parametrize(
    ("origin", "is_let_in"),
    [
        ("https://app.example.org", True),
        ("https://APP.example.org", True),
        ("http://app.example.org", False),
        ("https://a.b.tools.example", True),
        ("https://tools.example", False),
        ("http://[fd00::2]:8080", True),
        ("http://[fd00::3]:1", True),
        ("http://[fd00::2]:8081", False),
        ("http://f:8080", False),
        ("https://xn--mnchen-3ya.example", True),
        ("https://c.example", True),
        ("https://d.example", False),
        ("null", False),
    ],
)
def test_page_named_by_the_flag_passes_with_any_host(origin: str, *, is_let_in: bool, is_loopback: bool) -> None:
    origins = (
        "https://app.example.org/",
        "https://*.tools.example",
        "http://[fd00::2]:8080",
        "http://[fd00::3]:*",
        "https://München.example",
        "https://[abc].example",
        "https://" + "\u00e9" * 70 + ".example",
    )
    for host in (LOOPBACK, REBOUND, ""):
        assert (judge(origin, host, is_loopback=is_loopback, origins=origins) is None) is is_let_in


@both
def test_page_named_by_the_flag_passes_beside_the_default_ones(*, is_loopback: bool) -> None:
    for origin in ("http://localhost:3000", "file://", f"http://{LOOPBACK}"):
        assert judge(origin, LOOPBACK, is_loopback=is_loopback, origins=("https://app.example.org",)) is None


@both
@pytest.mark.parametrize("origin", ["https://evil.example", "null", f"http://{REBOUND}", "file://", "http://[::1", ""])
def test_star_allows_every_page(origin: str, *, is_loopback: bool) -> None:
    for host in (LOOPBACK, REBOUND):
        assert judge(origin, host, is_loopback=is_loopback, origins=("*",)) is None


def test_flags_that_allow_every_website_are_detected() -> None:
    tight = ("https://*.example.org", "http://localhost:*", "http://*.lan:*", "http://10.0.0.*")
    rules = OriginRules((*tight, "*", "http://*", "https://?*", "null", "nul?"), ("*.lab.example", "sim", "*", "*.*"))
    assert rules.open_flags() == [
        "--allow-origin '*'",
        "--allow-origin 'http://*'",
        "--allow-origin 'https://?*'",
        "--allow-origin null",
        "--allow-origin 'nul?'",
        "--allow-host '*'",
        "--allow-host '*.*'",
    ]
    assert OriginRules(tight, ("*.lab.example",)).open_flags() == []


# Any headers at all


@given(st.text(max_size=20) | st.from_regex(r"(http|https|app)://[a-z.\[\]:@%*0-9-]{0,20}", fullmatch=True), st.text())
def test_any_headers_give_a_verdict(origin: str, host: str) -> None:
    for is_loopback in (True, False):
        why = judge(origin, host, is_loopback=is_loopback, origins=("http://x*",), hosts=("y*",))
        assert why is None or (len(why) < 600 and why.isprintable())


# Memory


def test_remembered_refused_origins_are_unique_and_bounded() -> None:
    known = RefusedOrigins()
    assert [known.add(origin) for origin in ("http://a", "HTTP://A", "http://b", "x" * 10_000)] == [
        True,
        False,
        True,
        True,
    ]
    assert not known.is_full
    news = [known.add(f"http://{i}.example") for i in range(1_000)]
    assert sum(news) == MAX_REFUSED_ORIGINS - 3
    assert known.is_full
    assert not known.add("http://new.example")
