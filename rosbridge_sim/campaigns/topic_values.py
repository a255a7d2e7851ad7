"""Values of fields of topics, for expressions: of the last message of each topic, and nothing else is kept."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import TopicField, Value
from rosbridge_sim.printable import printable
from rosbridge_sim.suggestions import hint

MAX_TEXT = 1_000
"""Characters of a text in a message that are kept."""


class TopicValues:
    """Values of fields of topics, by their texts.

    Attributes:
        values: of the last messages; a field that the last message lacks, such as an entry of a shorter list, has none.
        trouble: why a field cannot be read; empty if all can.
    """

    def __init__(self, fields: Iterable[TopicField]) -> None:
        self.values: dict[str, Value] = {}
        self.trouble = ""
        self._by_topic: dict[str, list[TopicField]] = {}
        for field in sorted(fields, key=lambda each: each.text):
            self._by_topic.setdefault(field.topic, []).append(field)

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics that are read."""
        return tuple(self._by_topic)

    def take(self, topic: str, message: object) -> None:
        """Take a message.

        Args:
            topic: one of `topics`.
            message: its value: a generated struct, or a table for a type that is not known.
        """
        for field in self._by_topic[topic]:
            try:
                value = _read(message, field)
            except DocumentError as error:
                self.trouble = self.trouble or str(error)
                return
            if value is None:
                self.values.pop(field.text, None)
            else:
                self.values[field.text] = value


def _read(message: Any, field: TopicField) -> Value | None:  # noqa: ANN401 - a generated struct
    """Return the value of a field; None for an entry behind the end of a list.

    Raises:
        DocumentError: messages of this topic have no such field.
    """
    value = message
    for step in field.path:
        if isinstance(step, int):
            if isinstance(value, str | dict) or not hasattr(value, "__len__"):
                raise DocumentError(f"{field.text}: [{step}]: expected a list; the message has {_told(value)}")
            if step >= len(value):
                return None
            value = value[step]
        else:
            names = value if isinstance(value, dict) else getattr(value, "__struct_encode_fields__", ())
            if step not in names:
                raise DocumentError(
                    f"{field.text}: no field {step!r}{hint(step, list(names))}; there is {_told(value)}"
                )
            value = value[step] if isinstance(value, dict) else getattr(value, _attribute(value, step))
    if hasattr(value, "item"):
        value = value.item()  # a number of an array
    if isinstance(value, str):
        return value[:MAX_TEXT]
    if isinstance(value, bool | int | float):
        return value
    raise DocumentError(f"{field.text}: expected a number or a text; the message has {_told(value)}")


def _attribute(struct: Any, name: str) -> str:  # noqa: ANN401 - a generated struct
    """Return the name that a field has in Python."""
    return str(struct.__struct_fields__[struct.__struct_encode_fields__.index(name)])


def _told(value: object) -> str:
    names = list(value) if isinstance(value, dict) else getattr(value, "__struct_encode_fields__", None)
    if names is not None:
        return f"a message with {printable(', '.join(map(str, names)), 200) or 'no fields'}"
    return f"{type(value).__name__}" if not hasattr(value, "__len__") or isinstance(value, str) else "a list"
