"""`service list`, `info`, `type`, `find` and `call`: list services, show their fields, and call them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress

from rosbridge_sim.cli.tools.text import note, put, put_json, put_names, put_table, render, show
from rosbridge_sim.cli.tools.tool_client import Bridge, ToolAnswer, absolute, words
from rosbridge_sim.errors import RosbridgeSimError
from rosbridge_sim.link.bridge_errors import BridgeError, RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.suggestions import hint

# list


async def list_services(bridge: Bridge, *, is_verbose: bool, has_types: bool, is_count: bool, is_json: bool) -> None:
    """Print all services, sorted by name.

    Args:
        is_count: print only how many there are.

    Raises:
        RefusedError: rosapi refuses, or does not exist.
        BridgeError: there is no answer.
    """
    names = sorted(words(await bridge.ask("services"), "services"))
    if is_count or not (is_verbose or has_types):
        put_names(names, is_count=is_count, is_json=is_json)
        return
    questions = [(question, {"service": name}) for name in names for question in ("service_type", "service_node")]
    answers = await bridge.ask_all(questions)
    kinds = [answer.word("type") for answer in answers[::2]]
    nodes = [answer.word("node") for answer in answers[1::2]]
    rows = list(zip(names, kinds, nodes, strict=True))
    if is_json:
        put_json([{"service": name, "type": kind, "provider": node} for name, kind, node in rows])
    elif not is_verbose:
        put_names(names, [kind or "?" for kind in kinds])
    else:
        put_table(("SERVICE", "TYPE", "PROVIDER"), [(name, kind or "?", node or "?") for name, kind, node in rows])


# type, node, find


async def show_service_word(bridge: Bridge, name: str, command: str, *, is_json: bool) -> None:
    """Print what rosapi says about a service in one word: its type, or its node.

    Args:
        command: `type` or `node`, as in the name of rosapi's service and its answer.

    Raises:
        RefusedError: there is no such service.
        BridgeError: there is no answer.
    """
    service = absolute(name)
    word = str((await bridge.ask(f"service_{command}", service=service)).get(command, ""))
    if not word:
        raise RefusedError(await _no_service(bridge, service))
    show(word, safe(word), is_json=is_json)


async def find_services(bridge: Bridge, type_name: str, *, is_count: bool, is_json: bool) -> None:
    """Print the services of a type, which may be spelled as in either generation.

    Raises:
        RefusedError: there is none, or no rosapi.
        BridgeError: there is no answer.
    """
    short = type_name.replace("/srv/", "/")
    spellings = (short, short.replace("/", "/srv/"))  # rosbridge_suite compares texts
    answers = await bridge.ask_all([("services_for_type", {"type": one}) for one in spellings])
    lists = [words(one.values, "services") for one in answers if one.is_ok and isinstance(one.values, dict)]
    if not lists:
        raise RefusedError(f"/rosapi/services_for_type says: {safe(str(answers[0].values))}")
    found = sorted({name for names in lists for name in names})
    if not found:
        raise RefusedError(f"no service of type {safe(type_name)} here")
    put_names(found, is_count=is_count, is_json=is_json)


# info


Fields = Sequence[tuple[str, str]]
"""Type and name of each field of a message."""


async def show_service(bridge: Bridge, name: str, *, is_json: bool) -> None:
    """Print a service's type and provider, and its request and response as far as they are known.

    Raises:
        RefusedError: there is no such service.
        BridgeError: there is no answer.
    """
    service = absolute(name)
    kind = str((await bridge.ask("service_type", service=service)).get("type", ""))
    if not kind:
        raise RefusedError(await _no_service(bridge, service))
    (node,) = await bridge.ask_all([("service_node", {"service": service})])
    provider = node.word("node")
    halves = await _ask_details(bridge, kind) or _look_up(kind)
    if is_json:
        account: dict[str, object] = {"service": service, "type": kind, "provider": provider or None}
        for title, lines in zip(("request", "response"), halves or (None, None), strict=True):
            account[title] = None if lines is None else "\n".join(lines)
        put_json(account)
        return
    put(f"Type: {safe(kind)}\nProvider: {safe(provider) or 'unknown'}")
    if not halves:
        put("\nIts definition is unknown, on the server and here.")
        return
    for title, lines in zip(("Request", "Response"), halves, strict=True):
        put(f"\n{title}:{'' if lines else ' (empty)'}")
        for line in lines:
            put(f"  {safe(line)}")


Halves = tuple[list[str], list[str]]
"""Outlines of a request and of a response."""


async def _ask_details(bridge: Bridge, kind: str) -> Halves | None:
    """Return both halves from the server; None if it does not know them."""
    questions = ("service_request_details", "service_response_details")
    answers = await bridge.ask_all([(question, {"type": kind}) for question in questions])
    halves = [_read_typedefs(answer) for answer in answers]
    if None in halves:
        return None
    request, response = (list(outline) for outline in halves if outline is not None)
    return request, response


def _read_typedefs(answer: ToolAnswer) -> Iterator[str] | None:
    """Yield the outline of a message from rosapi's typedefs; the first typedef is the message itself."""
    typedefs = answer.fields.get("typedefs")
    if not isinstance(typedefs, list) or not typedefs or not all(isinstance(one, dict) for one in typedefs):
        return None
    fields = {str(one.get("type")): read_fields(one) for one in reversed(typedefs)}
    return _outline(str(typedefs[0].get("type")), lambda name: fields.get(name, ()), ())


def read_fields(typedef: Mapping[str, object]) -> Fields:
    """Return type and name of each field in a typedef of rosapi; empty if it is malformed."""
    names, types, lengths = (typedef.get(key) for key in ("fieldnames", "fieldtypes", "fieldarraylen"))
    if not (isinstance(names, list) and isinstance(types, list) and isinstance(lengths, list)):
        return ()
    # rosbridge_suite for ROS 2 writes Python's names of fields, with an underscore in front.
    return [
        (f"{kind}{'' if length == -1 else f'[{length or str()}]'}", str(name).lstrip("_"))
        for kind, name, length in zip(types, names, lengths, strict=False)
    ]


def _look_up(kind: str) -> Halves | None:
    """Return both halves from local definitions; None for an unknown type."""
    from rosbridge_sim.cli.tools.schema import DefinitionSources, open_store  # noqa: PLC0415 - reads a hundred files

    try:
        store = open_store(DefinitionSources())
        service = store.service(kind)
    except RosbridgeSimError:
        return None
    known = {one.name: one.definition for one in (service.request, service.response)}

    def fields_of(name: str) -> Fields:
        if "/" not in name:
            return ()
        definition = known.get(name) or store.message(name).definition
        return [(f.full_type, f.name) for f in definition.fields]

    request, response = (list(_outline(name, fields_of, ())) for name in known)
    return request, response


def _outline(name: str, fields_of: Callable[[str], Fields], above: tuple[str, ...]) -> Iterator[str]:
    """Yield `type name` of each field, with the fields of a message indented below it."""
    if name in above:
        return  # a message cannot contain itself, but a server may say so
    for kind, field in fields_of(name):
        yield f"{'  ' * len(above)}{kind} {field}"
        yield from _outline(kind.partition("[")[0], fields_of, (*above, name))


# call


async def call(
    bridge: Bridge, name: str, type_name: str, args: object, patience: float | None, *, is_json: bool
) -> None:
    """Call a service; print its answer and the server's status messages about it.

    Args:
        type_name: type that the service must have, in the spelling of either generation; empty means any.
        args: the request, by name or by position.
        patience: longest wait for the answer [s]; None means no limit.

    Raises:
        RefusedError: the service refuses, does not exist, or does not answer in time.
    """
    service = absolute(name)
    if type_name:
        await _check_type(bridge, service, type_name)
    wish = await bridge.send("set_level", level="warning")  # a simulator gives its reasons as warnings
    answer = await bridge.call(service, args, patience)
    for frame in bridge.take_inbox():
        is_remark = frame.get("op") == "status" and frame.get("id") != wish
        if is_remark and frame.get("level") in {"warning", "error"}:
            note(f"the server says: {frame.get('msg')}")
    if answer is None:
        raise RefusedError(f"{safe(service)}: no answer within {patience:g} s; --timeout waits longer")
    if not answer.is_ok:
        text = answer.values if isinstance(answer.values, str) else render(answer.values)
        near = await _near(bridge, service) if text.endswith("does not exist") else ""  # our server adds it itself
        raise RefusedError(f"{safe(text) or f'{safe(service)} refuses without a reason'}{near}")
    if is_json:
        put_json(answer.values)
    else:
        put(render(answer.values))


async def _check_type(bridge: Bridge, service: str, type_name: str) -> None:
    """Refuse a call with the type of another service; a server that does not know the type is asked no further."""
    from rosbridge_sim.schema.definitions.names import canonical_type  # noqa: PLC0415 - not for a command's help

    with suppress(BridgeError):
        (answer,) = await bridge.ask_all([("service_type", {"service": service})])
        kind = answer.word("type")
        if kind and canonical_type(kind) != canonical_type(type_name):
            raise RefusedError(f"{safe(service)}: is of type {safe(kind)}, not {safe(type_name)}")


async def _near(bridge: Bridge, service: str) -> str:
    try:
        return hint(service, words(await bridge.ask("services"), "services"))
    except (BridgeError, RefusedError):
        return ""


async def _no_service(bridge: Bridge, service: str) -> str:
    return f"no service {safe(service)} here{await _near(bridge, service)}"
