"""Mistakes in documents, each as one readable line, and the JSON Schemas of documents.

The models of `documents` are built anew as models of pydantic, which lists all mistakes. Only this module and
`campaigns/` know pydantic. It takes 60 ms to import and to build the models, so `documents` imports this module for the
documents that need it.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from functools import cache, partial
from typing import Annotated, Any, ClassVar, TypeVar, Union, get_args, get_origin

import msgspec
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    WithJsonSchema,
    create_model,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from rosbridge_sim.documents import MAX_KEY_SHOWN, Document, DocumentType, Mistake, Spelling, fields_of
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.not_json import explain_not_json
from rosbridge_sim.printable import printable

T = TypeVar("T")

MAX_VALUE_SHOWN = 40
"""Longest part of an offending value that an error shows [characters]."""

MAX_DOCUMENT_MISTAKES = 100
"""Largest number of mistakes that are reported for one document."""


class CheckedModel(BaseModel):
    """A model of pydantic; its class values are those of `Document`."""

    other_keys: ClassVar[frozenset[str]] = frozenset()
    idle_keys: ClassVar[frozenset[str]] = frozenset()

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, coerce_numbers_to_str=True)


class _Twin(CheckedModel):
    """The model of pydantic for a `Document`."""

    document: ClassVar[type[Document]]


def read_slowly(kind: DocumentType[T], content: bytes, source: str) -> T:
    """Read and check a document that `DocumentType.read` has refused.

    Args:
        kind: what is expected.
        content: the text, without a byte order mark.
        source: the file's name, for errors.

    Raises:
        DocumentError: one line, the first mistake; see `read_document`.
    """
    value: T = _document_of(read_model(adapter_of(kind), content, source))
    return value


def read_model(adapter: TypeAdapter[T], content: bytes, source: str) -> T:
    """Read and check a document, as models of pydantic.

    Args:
        adapter: what is expected.
        content: the text, without a byte order mark.
        source: the file's name, for errors.

    Raises:
        DocumentError: one line, the first mistake; see `read_document`.
    """
    try:
        return adapter.validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    raise DocumentError(_one_line(first, source))


def list_mistakes(kind: DocumentType[T], content: bytes, source: str) -> list[Mistake]:
    """Return all mistakes of a document, in its order.

    Args:
        kind: what is expected.
        content: the text, without a byte order mark.
        source: the file's name, for errors.
    """
    try:
        adapter_of(kind).validate_json(content)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        found = [Mistake(one["loc"], _one_line(one, source)) for one in errors[:MAX_DOCUMENT_MISTAKES]]
        if len(errors) > MAX_DOCUMENT_MISTAKES:
            found.append(Mistake((), f"{source}: ... and {len(errors) - MAX_DOCUMENT_MISTAKES:,} more"))
        return list({mistake.text: mistake for mistake in found}.values())
    return []


def schema_of(kind: DocumentType[Any]) -> dict[str, Any]:
    """Return the JSON Schema of a document."""
    return adapter_of(kind).json_schema()


# Models


@cache
def adapter_of(kind: DocumentType[Any]) -> TypeAdapter[Any]:
    """Return pydantic's reader of a document."""
    adapter = TypeAdapter(_type_of(kind.form))
    kind.knows_mistakes = True
    return adapter


@cache
def _model_of(kind: type[Document]) -> type[_Twin]:
    """Return the model of pydantic for a `Document`."""
    fields: dict[str, Any] = {}
    hints = fields_of(kind)
    for field in msgspec.structs.fields(kind):
        default = ... if field.default is msgspec.NODEFAULT else field.default
        if field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        fields[field.name] = _type_of(hints[field.name]), _model_value(default)
    validators: dict[str, Any] = (
        {"prepare_": model_validator(mode="before")(_preparing(kind))} if "prepare" in vars(kind) else {}
    )
    made = create_model(kind.__name__, __base__=_Twin, __doc__=kind.__doc__, __validators__=validators, **fields)
    made.document = kind
    return made


def _preparing(kind: type[Document]) -> Any:  # noqa: ANN401 - a class method, which the checker takes for another type
    return classmethod(lambda _cls, value: kind.prepare(value))


def _type_of(form: Any) -> Any:  # noqa: ANN401 - type forms
    """Return a type with pydantic's marks in place of those of `documents`."""
    if isinstance(form, type) and issubclass(form, Document):
        return _model_of(form)
    origin, args = get_origin(form), get_args(form)
    if origin is Annotated:
        base, *marks = args
        return _annotate[_type_of(base), *_marks_of(marks)]
    if origin in {Union, types.UnionType}:
        return _union[tuple(map(_type_of, args))]
    if origin in {list, tuple}:
        return origin[tuple(map(_type_of, args))]
    return form


_annotate: Any = Annotated
_union: Any = Union
"""For types that are known only at run time."""


def _marks_of(marks: list[Any]) -> list[Any]:
    found: list[Any] = []
    schemas: list[Any] = []
    for mark in marks:
        if isinstance(mark, msgspec.Meta):
            bounds = {name: getattr(mark, name) for name in ("ge", "le", "max_length", "description")}
            found.append(Field(**{name: value for name, value in bounds.items() if value is not None}))
        elif isinstance(mark, Spelling):
            if mark.read is not None:
                found.append(BeforeValidator(_worded(mark.read)))
            if mark.check is not None:
                found.append(AfterValidator(_worded(partial(_checked, mark.check))))
            if mark.schema is not None:
                schemas.append(WithJsonSchema(dict(mark.schema)))
    return found + schemas


def _worded(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return the function with errors whose text is told as it is."""

    def call(value: object) -> object:
        try:
            return function(value)
        except ValueError as error:
            raise PydanticCustomError("spelling", "{text}", {"text": str(error)}) from None

    return call


def _checked(check: Callable[[Any], None], value: T) -> T:
    check(value)
    return value


def _model_value(value: Any) -> Any:  # noqa: ANN401 - any value
    """Return a default value with models of pydantic in place of documents."""
    if isinstance(value, Document):
        kind = type(value)
        return _model_of(kind)(**{name: _model_value(getattr(value, name)) for name in fields_of(kind)})
    return value


def _document_of(value: Any) -> Any:  # noqa: ANN401 - any value
    """Return a value with documents in place of models of pydantic."""
    if isinstance(value, _Twin):
        return value.document(**{name: _document_of(getattr(value, name)) for name in value.model_fields_set})
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple | _Twin):
        return type(value)(map(_document_of, value))
    return value


# Words


def _one_line(error: ErrorDetails, source: str) -> str:
    if error["type"] == "json_invalid":
        what = str(error.get("ctx", {}).get("error", "")) or error["msg"]
        return explain_not_json(error["input"], what, source)
    path = _path(error["loc"])
    where = f"{source}: {path}" if path else source
    if error["type"] == "missing":
        return f"{where}: missing"
    return f"{where}: {_expected(error)}, got {_shown(error['input'])}"


def _path(loc: tuple[int | str, ...]) -> str:
    """`("vehicleList", 2, "pos")` -> `vehicleList[2].pos`; an empty text is the tag of a union's member."""
    parts = (
        f"[{part}]" if isinstance(part, int) else f".{printable(part, MAX_KEY_SHOWN)}" for part in loc if part != ""
    )
    return "".join(parts).removeprefix(".")


_EXPECTED = {
    "model_type": "an object",
    "model_attributes_type": "an object",
    "dict_type": "an object",
    "list_type": "a list",
    "tuple_type": "a list",
    "string_type": "a text",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing_size": "a whole number of 32 bits",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
}


def _expected(error: ErrorDetails) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in _EXPECTED:
        return f"expected {_EXPECTED[kind]}"
    if kind == "greater_than_equal":
        return f"expected at least {context['ge']:,.15g}"
    if kind == "less_than_equal":
        return f"expected at most {context['le']:,.15g}"
    if kind in {"too_long", "string_too_long"}:
        return f"expected at most {context['max_length']:,} {'characters' if kind == 'string_too_long' else 'entries'}"
    text = " ".join(error["msg"].split())
    return text[:1].lower() + text[1:]


def _shown(value: JsonValue) -> str:
    """Return a value as a short text on one line."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list | tuple):
        return f"a list of {len(value):,}"
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = repr(value) if len(str(value)) <= MAX_VALUE_SHOWN else repr(str(value)[:MAX_VALUE_SHOWN]) + "..."
    return " ".join(text.split())
