"""Bytes for a socket: incomplete frames, frames against the WebSocket's rules, and bytes of other protocols."""

from __future__ import annotations

import random


def raw_bytes(chance: random.Random, text: bytes) -> bytes:
    """Return bytes for a port that are not a correct WebSocket handshake.

    Args:
        chance: the random generator.
        text: bytes to use in them.
    """
    line = chance.choice(
        (
            *(
                b"GET / HTTP/1.1",
                b"GET /healthz HTTP/1.1",
                b"HEAD / HTTP/1.1",
                b"POST / HTTP/1.1",
                b"GET /x?y#z HTTP/9",
            ),
            *(b"GET", b"", b"\x16\x03\x01\x02\x00\x01\x00", b"\0" * 9, b"PRI * HTTP/2.0", b"GET /\xff HTTP/1.1"),
            b"GET /" + b"a" * 9_000 + b" HTTP/1.1",
        )
    )
    headers = [
        *(b"Host: localhost", b"Upgrade: websocket", b"Connection: Upgrade", b"Sec-WebSocket-Version: 13"),
        *(b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==", b"Sec-WebSocket-Key: x", b"Sec-WebSocket-Version: 7"),
        *(b"Sec-WebSocket-Extensions: permessage-deflate; x=1", b"Sec-WebSocket-Protocol: a", b"no colon", b": x"),
        *(b"Origin: http://evil.example", b"Authorization: Bearer x", b"Content-Length: 99", b"X: " + b"y" * 9_000),
    ]
    chosen = chance.sample(headers, chance.randrange(len(headers)))
    request = b"\r\n".join([line, *chosen, b"", b""])
    if chance.random() < 0.3:
        request = request[: chance.randrange(len(request))]
    return request + chance.choice((b"", part_of_frame(chance, text), chance.randbytes(50)))


def part_of_frame(chance: random.Random, text: bytes) -> bytes:
    """Return WebSocket bytes that end in the middle of a frame, or break the rules.

    Args:
        chance: the random generator.
        text: payload to use in them.
    """
    text = text[:100]
    frame = bytes([0x81, 0x80 | len(text)]) + b"\0\0\0\0" + text
    return chance.choice(
        (
            frame[: chance.randrange(len(frame))],
            frame + frame[:5],
            b"\x01" + frame[1:],  # the first of several, and no other comes
            b"\x81\xfe\xff\xff\0\0\0\0" + text,  # claims 65,535 bytes
            b"\x81\xff\0\0\0\0\x7f\xff\xff\xff\0\0\0\0",  # claims 2 GB
            b"\xf1" + frame[1:],  # bits of an extension that was not negotiated
            b"\x81" + bytes([len(text)]) + text,  # not masked
            b"\x80\x80\0\0\0\0",  # goes on with nothing
            b"\x89\xfe\x01\x00\0\0\0\0" + b"x" * 256,  # too long a ping
            b"\x88\x81\0\0\0\0x",  # a closing of one byte
        )
    )
