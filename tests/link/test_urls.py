"""URLs as users write them, and as the log shows them."""

from __future__ import annotations

import pytest

from rosbridge_sim.link.urls import check_url, hide, hide_in_words, port_of, secrets_of, shown_url


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("host", "ws://host:9090"),
        ("host:1", "ws://host:1"),
        (" 10.0.0.5 ", "ws://10.0.0.5:9090"),
        ("[::1]", "ws://[::1]:9090"),
        ("ws://host", "ws://host"),
        ("wss://host:1/path?token=x", "wss://host:1/path?token=x"),
        ("http://host:1", "ws://host:1"),
        ("https://host", "wss://host"),
    ],
)
def test_url_is_completed(text: str, url: str) -> None:
    assert check_url(text) == url


@pytest.mark.parametrize(
    "text",
    [
        "",
        "ws://",
        "ftp://h",
        "ws://h:0",
        "ws://h:65536",
        "ws://h:x",
        "ws://[::1",
        "a b",
        "ws://h#x",
        "h\x00",
        "ws://me@h",
    ],
)
def test_malformed_url_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"|.*"):
        check_url(text)


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("ws://host:1", "ws://host:1"),
        ("ws://host:1/", "ws://host:1"),
        ("ws://host:1/?token=secret", "ws://host:1"),
        ("ws://host:1?token=secret", "ws://host:1"),
        ("wss://host/path?token=secret", "wss://host/path"),
        ("ws://me:secret@host:1/a@b", "ws://host:1/a@b"),
        ("ws://host:1/#token=secret", "ws://host:1"),
        ("ws://host:1/x#secret?y", "ws://host:1/x"),
        ("host?token=secret", "host"),
        ("no url", "no url"),
    ],
)
def test_secrets_in_a_url_are_hidden(url: str, shown: str) -> None:
    assert shown_url(url) == shown


@pytest.mark.parametrize(("url", "port"), [("ws://h:1/x", 1), ("ws://h", 80), ("wss://[::1]?token=:2", 443)])
def test_port_of_a_url_is_found(url: str, port: int) -> None:
    assert port_of(url) == port


@pytest.mark.parametrize(
    "text",
    [
        "there is nothing at /?token=s3cret/+%3D",
        "what is s3cret/+=?",
        "GET /?token=s3cret/+%3D HTTP/1.1",
        "s3cret/ =",
        "s3cret%2F%2B%3D",
        "hello pass word, pass%20word, me:pass%20word@host",
    ],
)
def test_secrets_of_a_url_repeated_in_error_texts_are_hidden(text: str) -> None:
    hidden = hide(text, secrets_of("ws://me:pass%20word@host/?token=s3cret/+%3D"))
    assert "..." in hidden
    assert "s3cret" not in hidden
    assert "word" not in hidden


def test_other_parts_of_a_text_are_not_hidden() -> None:
    text = "HTTP 404: there is no such page as /x"
    assert hide(text, secrets_of("ws://host/x")) == text
    assert hide(text, secrets_of("ws://host/x?a=1&b")) == text
    for words in ("'/camera/*'", "expected 3; got '?'", "no such flag: --tokn (did you mean --token?)", "'a@b'"):
        assert hide_in_words(words) == words


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ("['ws://h:x/?token=secret']", "['ws://h:x/?...']"),
        ("got 'wss://me:secret@h/x'", "got 'wss://...@h/x'"),
        ("'token=secret'", "'token=...'"),
        ("--token=secret and more", "--token=... and more"),
    ],
)
def test_secrets_in_words_are_hidden(words: str, shown: str) -> None:
    assert hide_in_words(words) == shown
