"""Mistakes in documents: pydantic finds them, and each becomes one readable line.

The models of `documents` are built anew as models of pydantic. Its import and these models take 95 ms, so
`document_reading` imports this module for the first document that its own functions refuse.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache, partial
from types import NoneType, UnionType
from typing import Annotated, Any, Final, TypeVar, Union, get_args, get_origin

import msgspec
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    Strict,
    Tag,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    WrapValidator,
    create_model,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from rosbridge_sim.documents.document_model import (
    SCALARS,
    Document,
    DocumentType,
    Mistake,
    Place,
    Where,
    fields_of,
    kind_within,
    show_json,
    split_marks,
)
from rosbridge_sim.suggestions import hint

T = TypeVar("T")

MAX_DOCUMENT_MISTAKES: Final = 100
"""Largest number of mistakes that are reported for one document."""

MAX_WRONG_OBJECTS: Final = 10_000
"""Objects with mistakes, after which no more are looked at: pydantic takes 1 kB for each mistake."""


def judge_document(kind: DocumentType[T], value: object, where: Where) -> tuple[T | None, list[Mistake]]:
    """Return the model of a parsed document, or None and its mistakes; see `check_values`."""
    wrong: list[object] = []
    try:
        model: T = adapter_of(kind).validate_python(value, context=wrong)
    except ValidationError as error:
        found = error.errors(include_url=False)
    else:
        return model, []
    found.sort(key=lambda one: one["type"] != "extra_forbidden")  # a wrong key may be why another one is missing
    told = [_in_words(one, kind, where) for one in found[:MAX_DOCUMENT_MISTAKES]]
    if len(found) > MAX_DOCUMENT_MISTAKES:
        least = "at least " if len(wrong) > MAX_WRONG_OBJECTS else ""
        told.append(Mistake((), f"{where(())}: ... and {least}{len(found) - MAX_DOCUMENT_MISTAKES:,} more"))
    return None, told


@cache
def adapter_of(kind: DocumentType[Any]) -> TypeAdapter[Any]:
    """Return pydantic's reader of a document."""
    adapter = TypeAdapter(_type_of(kind.form))
    kind.knows_mistakes = True
    return adapter


# Models

_annotate: Any = Annotated
_union: Any = Union
"""For types that are known only at run time."""


@cache
def _model_of(kind: type[Document]) -> Any:  # noqa: ANN401 - a type form
    """Return the type for a `Document`: a model of pydantic, whose values become a document."""
    hints = fields_of(kind)
    fields: dict[str, Any] = {}
    for field in msgspec.structs.fields(kind):
        default = ... if field.required else None  # a document has its own
        fields[f"of_{field.name}"] = _type_of(hints[field.encode_name]), Field(default, alias=field.encode_name)
    extra: Any = "forbid" if kind.__struct_config__.forbid_unknown_fields else "ignore"
    model = create_model(kind.__name__, __config__=ConfigDict(extra=extra), **fields)
    return _annotate[model, WrapValidator(partial(_read_model, kind))]


def _read_model(
    kind: type[Document], value: object, read: Callable[[Any], Any], info: ValidationInfo[list[object]]
) -> Document | None:
    """Return the document of an object; None, unread, if many others have mistakes."""
    if len(info.context) > MAX_WRONG_OBJECTS:
        return None
    try:
        model = read(_worded(kind.prepare)(value))
        given = {name.removeprefix("of_"): getattr(model, name) for name in model.model_fields_set}
        return _worded(lambda _: kind(**given))(value)
    except (ValidationError, PydanticCustomError):
        info.context.append(kind)
        raise


def _type_of(form: Any) -> Any:  # noqa: ANN401 - type forms
    """Return a type with pydantic's marks in place of those of `documents`."""
    form, mark = split_marks(form)
    origin, args = get_origin(form), get_args(form)
    extra = mark.extra or {}
    if "read" in extra and form not in SCALARS:
        return _annotate[Any, PlainValidator(_worded(extra["read"]))]
    found = _marks_of(form, mark, extra)
    if isinstance(form, type) and issubclass(form, Document):
        form = _model_of(form)
    elif origin in {Union, UnionType}:
        form = _choice_of([arg for arg in args if arg is not NoneType])
        form = _union[form, None] if NoneType in args else form
    elif origin in {list, tuple, dict}:
        form = origin[tuple(arg if arg is ... else _type_of(arg) for arg in args)]
    return _annotate[form, *found]


def _marks_of(form: Any, mark: msgspec.Meta, extra: dict[str, Any]) -> list[Any]:  # noqa: ANN401 - a type form
    bounds: dict[str, Any] = {name: getattr(mark, name) for name in ("ge", "gt", "le", "min_length", "max_length")}
    bounds = {name: bound for name, bound in bounds.items() if bound is not None}
    origin, args = get_origin(form), get_args(form)
    if form is float:
        bounds["allow_inf_nan"] = False
    elif origin in {list, tuple} and kind_within(form) is None:
        bounds["fail_fast"] = True  # of a list of points the first mistake is enough
    found = [Field(**bounds), *([Strict("read" not in extra)] if form in SCALARS else [])]
    if extra.get("check"):
        found.append(AfterValidator(_worded(partial(_checked, extra["check"]))))
    if "read" in extra:
        found.append(BeforeValidator(_worded(extra["read"])))
    if origin is tuple and args[1:] != (...,):
        found.append(BeforeValidator(_worded(partial(_check_places, len(args)))))
    return found


_TAGS: Final = {
    list: "\0a list",
    tuple: "\0a list",
    dict: "\0an object",
    str: "\0a text",
    int: "\0a number",
    float: "\0a number",
}
"""Types of JSON values -> tags of a union's members, which stand in the places of pydantic's mistakes."""

_NEAREST: Final = {_TAGS[str]: _TAGS[float], _TAGS[float]: _TAGS[str]}
"""A text is read by the member for numbers where a union has none for texts, and the other way round."""


def _choice_of(members: list[Any]) -> Any:  # noqa: ANN401 - type forms
    """Return the type of one of several members, which are told apart by what was written."""
    if len(members) == 1:
        return _type_of(members[0])
    bases = [split_marks(each)[0] for each in members]
    tags = [_TAGS.get(get_origin(base) or base, _TAGS[dict]) for base in bases]
    tagged = tuple(_annotate[_type_of(each), Tag(tag)] for each, tag in zip(members, tags, strict=True))
    words = f"expected {' or '.join(tag[1:] for tag in tags)}"

    def tag_of(value: object) -> str | None:
        tag = _TAGS.get(type(value))
        return tag if tag is None or tag in tags else _NEAREST.get(tag, tag)

    chosen = Discriminator(tag_of, custom_error_type="spelling", custom_error_message=words)
    return _annotate[_union[tagged], chosen]


def _worded(function: Callable[[Any], T]) -> Callable[[Any], T]:
    """Return the function with errors whose text is told as it is."""

    def call(value: object) -> T:
        try:
            return function(value)
        except ValueError as error:
            raise PydanticCustomError("spelling", "{text}", {"text": str(error)}) from None

    return call


def _checked(check: Callable[[Any], None], value: T) -> T:
    check(value)
    return value


def _check_places(num: int, value: T) -> T:
    if isinstance(value, list | tuple) and len(value) == num:
        return value
    raise ValueError(f"expected a list of {num}")


# Words

_UNSAID: Final = {*_TAGS.values(), "[key]"}
"""Parts of pydantic's places that are no keys."""


def _in_words(error: ErrorDetails, kind: DocumentType[Any], where: Where) -> Mistake:
    """Return a mistake: `demo.json: vehicleList[2].pos: expected an object, got null`."""
    place = tuple(part for part in error["loc"] if part not in _UNSAID)
    got = error["input"]
    match error["type"]:
        case "missing":
            text = f"missing{_meaning_of(kind, place)}"
        case "extra_forbidden":
            text = _expected_one_of(list(fields_of(_model_at(kind, place))), str(place[-1]))
        case "literal_error":
            words = re.findall("'([^']*)'", error["ctx"]["expected"])
            near = got if isinstance(got, str) else ""
            text = _expected_one_of(words, near, f", got {show_json(got)}")
        case _:
            text = f"{_expected(error)}, got {show_json(got)}"
    return Mistake(place, f"{where(place)}: {text}")


def _expected_one_of(known: list[str], word: str, got: str = "") -> str:
    return f"expected one of {', '.join(known)}{got}{hint(word, known) if word else ''}"


def _model_at(kind: DocumentType[Any], place: Place) -> type[Document]:
    """Return the model of the object whose key is at a place."""
    model = kind_within(kind.form)
    for part in place[:-1]:
        inner = kind_within(fields_of(model).get(str(part))) if model is not None else None
        model = inner or model
    assert model is not None, "a key is of an object"
    return model


def _meaning_of(kind: DocumentType[Any], place: Place) -> str:
    """Return the description of a field, to follow that it is missing."""
    description = split_marks(fields_of(_model_at(kind, place))[str(place[-1])])[1].description
    return f"; {description}" if description else ""


_EXPECTED: Final = {
    "model_type": "an object",
    "model_attributes_type": "an object",
    "dict_type": "an object",
    "list_type": "a list",
    "tuple_type": "a list",
    "string_type": "a text",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "greater_than_equal": "at least {ge:,.15g}",
    "greater_than": "more than {gt:,.15g}",
    "less_than_equal": "at most {le:,.15g}",
    "too_short": "at least {min_length:,} entries",
    "too_long": "at most {max_length:,} entries",
    "string_too_long": "at most {max_length:,} characters",
}
"""Names of pydantic's mistakes -> what was expected."""


def _expected(error: ErrorDetails) -> str:
    words = _EXPECTED.get(error["type"])
    if words is not None:
        return f"expected {words.format(**error.get('ctx', {}))}"
    text = " ".join(error["msg"].split())
    return text[:1].lower() + text[1:]
