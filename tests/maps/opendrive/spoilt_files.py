"""Spoilt OpenDRIVE files: one change of a good file each, by a seed."""

from __future__ import annotations

import random
import re

NUMBERS = (
    "nan",
    "-1",
    "0",
    "1e9",
    "1e308",
    "-1e-9",
    "",
    "x",
    "1,5",
    "9" * 400,
    "0x10",
    "1e-300",
    "12345678901234567890",
)
WORDS = ("", "none", "-1", "driving", "é", "a" * 3_000, "start", "junction", "</a>", "&lt;")

_ATTRIBUTE = re.compile(rb'\s([\w:]+)="([^"]*)"')
_ELEMENT = re.compile(rb"<(\w+)[^<>]*?/>|<(\w+)[^<>]*>")


def spoil(content: bytes, seed: int) -> bytes:
    """Return a file with one to three changes: of a value, a name, an element, a piece or single bytes."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    for _ in range(chance.randint(1, 3)):
        content = chance.choice((*(_value,) * 8, _name, _name, _element, _element, _piece, _bytes))(content, chance)
    return content


def _value(content: bytes, chance: random.Random) -> bytes:
    found = chance.choice(list(_ATTRIBUTE.finditer(content)) or [re.match(b"", content)])
    if found is None or not found.groups():
        return content
    is_number = re.fullmatch(rb"[-+.\deE]+", found[2]) is not None
    new = chance.choice(NUMBERS if is_number or chance.random() < 0.3 else WORDS).encode()
    return content[: found.start(2)] + new + content[found.end(2) :]


def _name(content: bytes, chance: random.Random) -> bytes:
    found = chance.choice(list(_ATTRIBUTE.finditer(content)) or [re.match(b"", content)])
    if found is None or not found.groups():
        return content
    new = b"" if chance.random() < 0.5 else b' odd="1"'
    return content[: found.start()] + new + content[found.end() :]


def _element(content: bytes, chance: random.Random) -> bytes:
    found = chance.choice(list(_ELEMENT.finditer(content)) or [re.match(b"", content)])
    if found is None:
        return content
    times = chance.choice((0, 0, 2, 3))
    return content[: found.start()] + found[0] * times + content[found.end() :]


def _piece(content: bytes, chance: random.Random) -> bytes:
    a, b = sorted(chance.randrange(len(content) + 1) for _ in range(2))
    return chance.choice((content[:a], content[:a] + content[b:], content[:b] + content[a:]))


def _bytes(content: bytes, chance: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.randint(1, 20)):
        if changed:
            changed[chance.randrange(len(changed))] = chance.randrange(256)
    return bytes(changed)
