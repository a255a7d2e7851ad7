"""Calls and answers of XML-RPC as text, by the standard library's reader and writer.

Bodies of strangers cannot make them work for long: a body is bounded, no document type is read (so there are no
entities that multiply), and it is text in UTF-8 whatever it claims.
"""

from __future__ import annotations

import xml.parsers.expat
import xmlrpc.client
from collections.abc import Sequence
from typing import Any, Final

from rosbridge_sim.errors import GraphError

MAX_DEPTH: Final = 110
"""Deepest nesting of values: as deep as a parameter may be, and some more."""


def write_call(method: str, args: Sequence[object]) -> bytes:
    """Return the body of a call.

    Raises:
        GraphError: a value cannot be written.
    """
    try:
        values: Any = tuple(args)  # a value that XML-RPC cannot have raises
        return xmlrpc.client.dumps(values, method).encode(errors="replace")
    except (TypeError, OverflowError, RecursionError) as error:
        raise GraphError(f"XML-RPC cannot write {method}: {error}") from None


def write_answer(value: list[Any]) -> bytes:
    """Return the body of an answer, `[code, text, value]`."""
    return xmlrpc.client.dumps((value,), methodresponse=True).encode(errors="replace")


def read_call(body: bytes, max_values: int) -> tuple[str, Sequence[Any]]:
    """Return method and arguments of a call.

    Raises:
        GraphError: it is none.
    """
    args, method = _read(body, max_values)
    if method is None:
        raise GraphError("expected a call of XML-RPC; got an answer")
    return method, args


def read_answer(body: bytes, max_values: int) -> Any:  # noqa: ANN401 - any value of XML-RPC
    """Return the value of an answer of the form `[1, text, value]`, which all programs of ROS 1 give.

    Raises:
        GraphError: it is none, or the call was refused.
    """
    args, _ = _read(body, max_values)
    try:
        ((code, text, value),) = args
    except (TypeError, ValueError):
        raise GraphError("expected an answer [code, text, value]; got another one") from None
    if code != 1:
        raise GraphError(f"refused: {str(text)[:300]}")
    return value


def _read(body: bytes, max_values: int) -> tuple[Sequence[Any], str | None]:
    try:
        text = body.decode()
    except UnicodeDecodeError:
        raise GraphError("expected XML in UTF-8") from None
    if "<!" in text.replace("<!--", "") or text.count("<value") > max_values:
        raise GraphError(f"expected XML-RPC without a document type, with at most {max_values:,} values")
    try:
        values, method = xmlrpc.client.loads(text)
        _check_depth(values, 0)
    except xmlrpc.client.Fault as fault:
        raise GraphError(f"refused: {fault.faultString[:300]}") from None
    except (xml.parsers.expat.ExpatError, ValueError, TypeError, LookupError, xmlrpc.client.Error) as error:
        raise GraphError(f"expected XML-RPC: {error!r:.200}") from None
    return values, method


def _check_depth(value: object, depth: int) -> None:
    """Raise ValueError for a value that is nested so deeply that it cannot be shown."""
    if depth > MAX_DEPTH:
        raise ValueError(f"nested more than {MAX_DEPTH} deep")
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, (list, tuple)) else ()
    for part in parts:
        _check_depth(part, depth + 1)
