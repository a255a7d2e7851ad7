"""`contract record` and `contract check`: write what an app relies on, and judge a rosbridge by it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

from rosbridge_sim.cli.contracts.watching import chosen, services_if_told, types_if_told, watch_topics
from rosbridge_sim.cli.tools.text import Flow, demand_new, note, put, put_json, put_lines, put_table, render, write_file
from rosbridge_sim.cli.tools.tool_client import Bridge, Connect
from rosbridge_sim.contracts.contract import CONTRACT, Contract
from rosbridge_sim.contracts.contract_check import Claim, judge_contract
from rosbridge_sim.contracts.contract_recording import contract_document, record_contract
from rosbridge_sim.contracts.seen_system import SeenSystem
from rosbridge_sim.documents.document_reading import check_values
from rosbridge_sim.documents.yaml_reading import MAX_YAML_BYTES, read_yaml
from rosbridge_sim.errors import DocumentError, file_errors
from rosbridge_sim.junit import Case, write_suite
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.urls import shown_url
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.records import asdict

MESSAGES_FOR_RATE = 5

MAX_LONGER = 60.0
"""A check watches until the slowest topic should have sent so many messages, but not longer than this [s]."""

HEAD = """\
# What an app relies on. `rosbridge-sim contract check URL FILE` judges a robot, a simulator or a mock by it.
# Remove what the app does not use, and widen what may differ: ranges have what was seen, and {margin:.0%} more.
# Without a range, a list of values or a length ({{}}) the field must be there.
"""


async def record_contract_file(
    bridge: Bridge,
    file: str,
    *,
    topics: Sequence[str],
    services: Sequence[str],
    duration: float,
    margin: float,
    tolerance: float,
    is_json: bool,
) -> None:
    """Watch a rosbridge, and write the contract for what was seen.

    Args:
        bridge: the connection.
        file: path of the new file.
        topics: patterns of topics; without any pattern of either kind all but those of ROS itself.
        services: patterns of services, the same.
        duration: how long it is watched [s].
        margin: see `record_contract`.
        tolerance: share by which rates may differ.
        is_json: print the contract as JSON, too.

    Raises:
        RefusedError: there is no rosapi, or nothing that the patterns select.
        DocumentError: the file is there already, or cannot be written.
    """
    demand_new(Path(file))
    types = await types_if_told(bridge)
    there = await services_if_told(bridge, services) if services or not topics else {}
    if types is None:
        raise RefusedError("a contract cannot be recorded without rosapi; write it, and check it")
    wanted = chosen(types, topics) if topics or not services else []
    if not wanted and not there:
        raise RefusedError("nothing to record: no topic and no service that the patterns select is there")
    seen = await watch_topics(bridge, {name: types[name] for name in wanted}, duration)
    contract = record_contract(SeenSystem(seen, types, there, duration), margin, tolerance)
    text = HEAD.format(margin=margin) + render(_document(contract)) + "\n"
    if len(text.encode()) > MAX_YAML_BYTES:
        raise RefusedError(f"the contract has more than {MAX_YAML_BYTES:,} bytes; --topic and --service select less")
    write_file(Path(file), text)
    num_fields = sum(len(topic.fields) for topic in contract.topics.values())
    if is_json:
        put_json(contract_document(contract))
    else:
        note(f"{file}: {len(contract.topics)} topics, {num_fields} fields, {len(contract.services)} services")


def _document(contract: Contract) -> Mapping[str, JsonValue]:
    """Return the document of a contract, with one line for each field."""
    document = dict(contract_document(contract))
    for topic in document.get("topics", {}).values():
        if "fields" in topic:
            topic["fields"] = {path: Flow(terms) for path, terms in topic["fields"].items()}
    return document


def read_contract(file: str) -> Contract:
    """Return the contract in a file.

    Raises:
        DocumentError: it cannot be read; or a line for each mistake.
    """
    with file_errors(file, "read"):
        content = Path(file).read_bytes()
    document = read_yaml(content, file)
    read = check_values(CONTRACT, document.value, document.where)
    if read[0] is None:
        raise DocumentError("\n".join(mistake.text for mistake in read[1]))
    return read[0]


async def check_contract(
    url: str,
    connect: Connect,
    file: str,
    *,
    duration: float,
    junit_path: Path | None,
    verbose: bool,
    is_json: bool,
) -> int:
    """Watch the topics of a contract, and print which terms are broken.

    Args:
        url: URL of the rosbridge, or `HOST[:PORT]`.
        connect: opens the connection.
        file: the contract.
        duration: least time of watching [s].
        junit_path: file for JUnit XML; None writes none.
        verbose: print the terms that are kept, too.
        is_json: print JSON.

    Returns:
        0 if no term is broken, else 1.

    Raises:
        DocumentError: the contract has mistakes, there is no connection, or a file cannot be written.
        RefusedError: the server has closed the connection.
    """
    contract = read_contract(file)
    slowest = min((topic.rate for topic in contract.topics.values() if topic.rate), default=math.inf)
    seconds = max(duration, min(MESSAGES_FOR_RATE / slowest, MAX_LONGER))
    async with connect(url) as bridge:
        types = await types_if_told(bridge)
        wanted = contract.topics if types is None else contract.topics.keys() & types.keys()
        kinds = {name: (types or {}).get(name, contract.topics[name].type) for name in sorted(wanted)}
        there = await services_if_told(bridge, ["*"], typed=contract.services) if contract.services else {}
        seen = await watch_topics(bridge, kinds, seconds) if kinds else {}
    claims = judge_contract(contract, SeenSystem(seen, types, there, seconds))
    num_broken = sum(claim.is_broken for claim in claims)
    if junit_path is not None:
        cases = [Case(one.name, one.term, str(one) if one.is_broken else "") for one in claims]
        write_file(junit_path, write_suite("contract", cases))
    if is_json:
        put_json({"server": shown_url(url), "broken": num_broken, "claims": [asdict(claim) for claim in claims]})
    else:
        _put_claims(claims, is_verbose=verbose)
        put(f"{len(claims)} terms: {num_broken} broken" if num_broken else f"{len(claims)} terms: all are kept")
    return 1 if num_broken else 0


def _put_claims(claims: Sequence[Claim], *, is_verbose: bool) -> None:
    """Print a line for each topic and service, and below them each broken term."""
    rows = []
    for name, group in groupby(claims, lambda claim: claim.name):
        own = list(group)
        shown = {claim.term: claim.seen for claim in own}
        num_broken = sum(claim.is_broken for claim in own)
        verdict = f"{num_broken} of {len(own)} broken" if num_broken else "kept"
        rows.append((name, shown.get("type", ""), shown.get("rate", "-"), str(len(own)), verdict))
    put_table(("NAME", "TYPE", "RATE", "TERMS", "VERDICT"), rows)
    put_lines("\n".join(str(claim) for claim in claims if is_verbose or claim.is_broken))
