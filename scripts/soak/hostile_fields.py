#!/usr/bin/env python3
"""Hostile values for each field of each service and input topic of a server, made from the types.

    python scripts/soak/hostile_fields.py [--names PATTERN]...

A server tells its services and the topics that it subscribes to. Each text, list and array in their types is filled in
several shapes, in frames of all sizes up to the longest that the server takes. One row is printed for each service and
topic, with the worst of its frames. The exit code is 1 if a bound of `hostile.py` fails, or if a call of a service is
not answered.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

import orjson

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from scripts.soak.harness import Bystander, SoakError, WatchedServer
from scripts.soak.soak_client import Client

LARGEST = 16 * 2**20 - 1_000
"""Most bytes of a body: the server's default limit for a frame, without the op around the body."""

SIZES = (40_000, 250_000, 1_000_000, 4_000_000, LARGEST)
"""Lengths of bodies [bytes]: below and above each limit of a server."""

TRIES = 4
"""Tries of a frame that is beyond a bound; the best one counts, because a busy machine delays the bystander, too."""

MAX_PASS_MS, MAX_WAIT_MS = 50.0, 500.0
"""Longest pass of the server's loop [ms of CPU time], and longest wait of another client above its idle one [ms]. The
wait has the work of other processes in it, so it is there for a frame that takes many passes."""

NUMBERS = (b"1", b"0.1", b"1e308")
TEXTS = (b'""', b'"{}"', b'"' + b"x" * 100 + b'"')
OTHERS = (b"{}", b"[]", b"null")
"""Small elements, which are repeated. Those of the wrong type are tried as well."""


@dataclass(frozen=True, slots=True)
class Target:
    """A service, or a topic that the server subscribes to.

    Attributes:
        op: `call_service` or `publish`.
        name: of the service or topic.
        type_name: its type.
    """

    op: str
    name: str
    type_name: str

    def frame(self, body: bytes, op_id: str) -> bytes:
        """Return the op with a body.

        Args:
            body: JSON text.
            op_id: its id.

        Returns:
            JSON text.
        """
        key, inner = ("service", "args") if self.op == "call_service" else ("topic", "msg")
        fields = {"op": self.op, "id": op_id, key: self.name}
        if self.op == "publish":
            fields["type"] = self.type_name
        return orjson.dumps(fields)[:-1] + b',"' + inner.encode() + b'":' + body + b"}"


async def find_targets(call: Callable[..., Any]) -> list[Target]:
    """Return all services and input topics of a server.

    Args:
        call: calls a service with fields by name, and returns the fields of the answer.

    Returns:
        Them, sorted by name.
    """
    targets = []
    for node in (await call("/rosapi/nodes", {}))["nodes"]:
        if not node.startswith(("/rosapi", "/morai_sim", "/tf2")):
            continue  # a client
        details = await call("/rosapi/node_details", {"node": node})
        for name in details["services"]:
            found = await call("/rosapi/service_type", {"service": name})
            targets.append(Target("call_service", name, found["type"]))
        for name in details["subscribing"]:
            found = await call("/rosapi/topic_type", {"topic": name})
            targets.append(Target("publish", name, found["type"]))
    return sorted(targets, key=lambda one: (one.op, one.name))


def type_of(target: Target, store: Store) -> MessageSpec:
    """Return the type of the bodies of a target.

    Args:
        store: has the type.
    """
    if target.op == "call_service":
        return store.service(target.type_name).request.spec
    return store.message(target.type_name).spec


def paths(spec: MessageSpec, within: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], FieldSpec]]:
    """Yield the fields of a type that can be long, with their names from the outside; `[]` is an element of a list.

    Args:
        spec: the type.
        within: names of the fields around it.
    """
    for name, field in spec.fields.items():
        path = (*within, name)
        if field.definition.array is not None or field.definition.type in {"string", "wstring"}:
            yield path, field
        if field.nested is not None:
            yield from paths(field.nested, path if field.definition.array is None else (*path, "[]"))


def wrap(path: Sequence[str], value: bytes) -> bytes:
    """Return a body with a value in one field.

    Args:
        path: of the field.
        value: JSON text.

    Returns:
        JSON text.
    """
    for name in reversed(path):
        value = b"[" + value + b"]" if name == "[]" else b'{"' + name.encode() + b'":' + value + b"}"
    return value


def _repeat(element: bytes, size: int) -> bytes:
    """Return a list that repeats an element."""
    num = max(1, size // (len(element) + 1))
    return b"[" + (element + b",") * (num - 1) + element + b"]"


def _texts(size: int) -> Iterator[tuple[str, bytes]]:
    """Yield long texts."""
    yield "a text", b'"' + b"x" * size + b'"'
    yield "a text of JSON", b'"[' + b"[]," * (size // 3) + b'[]]"'
    yield "a text of escapes", b'"' + b"\\u00e9" * (size // 6) + b'"'


def values(field: FieldSpec, size: int) -> Iterator[tuple[str, bytes]]:
    """Yield values of a field with about as many bytes, right and wrong ones.

    Args:
        field: the field.
        size: in bytes.

    Yields:
        Words for the table, and JSON text.
    """
    is_text = field.definition.type in {"string", "wstring"}
    yield "deep lists", b"[" * (size // 2) + b"]" * (size // 2)
    if is_text or field.definition.is_bytes:
        yield from _texts(size)
    if field.definition.array is None:
        yield "a list of {}", _repeat(b"{}", size)
        return
    for element in (*OTHERS, *TEXTS, *NUMBERS):
        yield f"a list of {element[:8].decode()}", _repeat(element, size)
    if is_text:
        yield "a list with a long text", b"[" + next(_texts(size))[1] + b"]"
    if field.nested is not None:
        for inner, one in paths(field.nested):
            if one.definition.array is not None and one.nested is not None:
                yield f"a list with a list of {inner[-1]}", b"[" + wrap(inner, _repeat(b"{}", size)) + b"]"


def bodies(spec: MessageSpec, sizes: Sequence[int] = SIZES) -> Iterator[tuple[str, bytes]]:
    """Yield hostile bodies of a type.

    Args:
        spec: the type.
        sizes: their lengths [bytes].

    Yields:
        Words for the table, and JSON text.
    """
    for size in sizes:
        yield f"{size:,}: an unknown field", wrap(("what_is_this",), _repeat(b"{}", size))
        yield f"{size:,}: values by position", _repeat(b"[]", size)
        for path, field in paths(spec):
            for words, value in values(field, size):
                yield f"{size:,}: {'.'.join(path)}: {words}", wrap(path, value)


@dataclass(slots=True)
class Worst:
    """The worst figures of one target.

    Attributes:
        num: frames.
        pass_ms, wait_ms: longest pass of the loop, and longest wait of the bystander.
        of: the frame with the longest pass.
        faults: a line for each frame that exceeds a bound.
    """

    num: int = 0
    pass_ms: float = 0.0
    wait_ms: float = 0.0
    of: str = ""
    faults: list[str] | None = None


def _count(answers: Counter[object], op: dict[str, Any]) -> None:
    answers[op.get("id")] += 1


async def attack(target: Target, spec: MessageSpec, server: WatchedServer, bystander: Bystander) -> Worst:
    """Send all bodies of a target, one by one.

    Args:
        spec: type of its bodies.

    Returns:
        The worst figures.
    """
    worst, faults = Worst(), []
    client = await Client.open(server.url)
    longest_ms = (await bystander.waits()).longest + MAX_WAIT_MS
    server.longest_pass()
    for words, body in bodies(spec):
        worst.num += 1
        mark = f"frame-{worst.num}"
        frame = target.frame(body, mark).decode()
        answers = Counter[object]()
        client.on_op["service_response"] = partial(_count, answers)
        pass_ms = wait_ms = math.inf
        num_tries = 0
        while num_tries < TRIES and (pass_ms > MAX_PASS_MS or wait_ms > longest_ms):
            num_tries += 1
            await client.send_raw(frame)
            await client.call("/rosapi/get_time")
            pass_ms = min(pass_ms, server.longest_pass())
            wait_ms = min(wait_ms, (await bystander.waits()).longest)
        if target.op == "call_service" and answers[mark] != num_tries:
            faults.append(f"{words}: {answers[mark]} answers to {num_tries} calls")
        if pass_ms > MAX_PASS_MS:
            faults.append(f"{words}: a pass of the loop took {pass_ms:.0f} ms")
        if wait_ms > longest_ms:
            faults.append(f"{words}: the bystander waited {wait_ms:.0f} ms")
        if pass_ms > worst.pass_ms:
            worst.pass_ms, worst.of = pass_ms, words
        worst.wait_ms = max(worst.wait_ms, wait_ms)
    await client.close()
    worst.faults = faults
    return worst


async def run(patterns: Sequence[str], flags: Sequence[str], out: Callable[[str], None]) -> int:
    """Attack all targets that match.

    Args:
        patterns: of names; none means all.
        flags: of the server.
        out: prints a line.

    Returns:
        Number of failed targets.
    """
    failed = 0
    store = Store(read_definitions("22.R2"))
    out(f"{'service or topic':40}{'frames':>7}{'pass':>8}{'wait':>8}{'peak':>7}{'later':>7}")
    out(f"{'':40}{'':>7}{'ms':>8}{'ms':>8}{'MB':>7}{'MB':>7}")
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "server.log"
        with WatchedServer(log, "--data-dir", str(Path(folder) / "data"), *flags) as server:
            bystander = Bystander(server.url)
            try:
                async with await Client.open(server.url) as client:
                    targets = await find_targets(client.call)
                for target in targets:
                    if patterns and not any(fnmatchcase(target.name, pattern) for pattern in patterns):
                        continue
                    idle_mb = server.figures().memory
                    server.forget_peak()
                    worst = await attack(target, type_of(target, store), server, bystander)
                    peak_mb = server.peak() - idle_mb
                    later_mb = server.figures().memory - idle_mb
                    line = f"{target.name:40}{worst.num:7}{worst.pass_ms:8.1f}{worst.wait_ms:8.1f}"
                    out(f"{line}{peak_mb:7.0f}{later_mb:7.0f}  {worst.of}")
                    for fault in worst.faults or ():
                        out(f"    FAILED: {fault}")
                    failed += bool(worst.faults)
                if "Traceback" in server.log:
                    out("FAILED: a traceback in the log: " + server.log[server.log.index("Traceback") :][:2_000])
                    failed += 1
            except SoakError as error:
                out(f"FAILED: {error}")
                failed += 1
            finally:
                bystander.stop()
    return failed


def main() -> int:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--names", action="append", default=[], metavar="PATTERN", help="names that match [all]")
    options = parser.parse_args()
    failed = asyncio.run(run(options.names, (), print))
    print("all within bounds" if not failed else f"{failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
