"""The store of all types by name: definition texts in, compiled types out, each compiled at its first use.

A store gets definition texts (those in `schemas/` and in the user's folders). Further standard packages come
from `standard.py`. The text of an action also defines the seven
messages of actionlib. Both `pkg/Type` and `pkg/msg/Type` are accepted everywhere. `pkg/Type` is the name of a type
inside; `spelled` returns the one that the ROS generation writes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Literal, TypeVar

from rosbridge_sim.errors import DefinitionError, TypeNameError, UnknownPackageError
from rosbridge_sim.records import replace
from rosbridge_sim.schema.compile import compile_message
from rosbridge_sim.schema.definitions.dialect import ROS1, ROS2, Leniency
from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.definitions.names import (
    FEEDBACK_MESSAGE,
    RENAMED_FIELDS,
    RENAMED_PACKAGES,
    DefinitionKind,
    Generation,
    spelled,
    split_name,
)
from rosbridge_sim.schema.definitions.parse import SUFFIXES, Definition, Field, parse_message, parse_parts
from rosbridge_sim.schema.definitions.standard import (
    PACKAGES,
    WITHOUT_SERVICES,
    ros2_text,
    standard_names,
    standard_text,
)
from rosbridge_sim.schema.definitions.typedefs import full_text
from rosbridge_sim.schema.message_type import ActionType, Encoders, LateMessageType, MessageType, ServiceType
from rosbridge_sim.suggestions import hint

_ACTIONLIB_MESSAGES = {
    "ActionGoal": "Header header\nactionlib_msgs/GoalID goal_id\n{name}Goal goal\n",
    "ActionResult": "Header header\nactionlib_msgs/GoalStatus status\n{name}Result result\n",
    "ActionFeedback": "Header header\nactionlib_msgs/GoalStatus status\n{name}Feedback feedback\n",
    "Action": "{name}ActionGoal action_goal\n{name}ActionResult action_result\n{name}ActionFeedback action_feedback\n",
}
"""Definitions that ROS 1 generates for an action: the messages of its topics, and one that holds them all."""

_OF_ACTIONS = _ACTIONLIB_MESSAGES | {FEEDBACK_MESSAGE: "unique_identifier_msgs/UUID goal_id\n{name}Feedback feedback\n"}
"""The same, and those of ROS 2 that have a topic here."""

T = TypeVar("T")


class Store:
    """All types that are known.

    Attributes:
        ros: the ROS generation whose forms go out.
        time_value: `(stamp_ns)`: returns the value of a `time` field at a time [ns].

    Args:
        texts: definition texts by (package, `msg` or `srv` or `action`, name).
        leniency: other names and forms to accept.
        ros: see above.
        is_checked: no text has a mistake. Then a type is compiled when its first message comes or goes; otherwise
            when it is asked for, so that the mistake is told there.
    """

    def __init__(
        self,
        texts: Mapping[tuple[str, str, str], str],
        *,
        leniency: Leniency | None = None,
        ros: Generation = 1,
        is_checked: bool = False,
    ) -> None:
        leniency = leniency or Leniency()
        self.ros = ros
        self._dialect = {1: ROS1, 2: ROS2}[ros]
        self.time_value = self._dialect.time
        self._encoders = Encoders(ros)
        self._is_checked = is_checked
        self._texts = dict(texts)
        self._leniency = replace(leniency, fields=_joined(RENAMED_FIELDS, leniency.fields))
        self._packages = {package for package, _, _ in self._texts}
        self._definitions: dict[str, Definition] = {}
        self._known_parts: dict[tuple[str, str], tuple[Definition, ...]] = {}
        self._specs: dict[tuple[str, str], MessageSpec] = {}  # by kind and name
        self._messages: dict[str, MessageType] = {}
        self._services: dict[str, ServiceType] = {}
        self._actions: dict[str, ActionType] = {}
        self._spellings: dict[str, str] = {}
        self._full_texts: dict[str, str] = {}

    def add(self, texts: Mapping[tuple[str, str, str], str]) -> None:
        """Add definition texts of types that are not known yet; the form is that of the constructor."""
        self._texts = {**texts, **self._texts}
        self._is_checked = False
        self._packages |= {package for package, _, _ in texts}

    def with_texts(self, texts: Mapping[tuple[str, str, str], str]) -> Store:
        """Return a store that knows these texts, too, to find their mistakes."""
        return Store({**texts, **self._texts}, leniency=self._leniency, ros=self.ros)

    # Names

    def canonical(self, name: str) -> str:
        """Return the one form of a type name, `pkg/Type`, with aliases resolved. The type may still be unknown.

        Raises:
            TypeNameError: the name is malformed.
        """
        known = self._spellings.get(name)
        if known is not None:
            return known
        package, short = split_name(name)
        if package not in self._packages:
            package = RENAMED_PACKAGES.get(package, package)
        full = f"{package}/{short}"
        # A type that exists is no alias of another one.
        is_there = any((package, kind, short) in self._texts for kind in ("msg", "srv", "action"))
        return full if is_there else self._leniency.types.get(full, full)

    def spelled(self, name: str, kind: DefinitionKind) -> str:
        """Return a type's name as the ROS generation writes it: `pkg/Type` for ROS 1, `pkg/msg/Type` for ROS 2.

        Raises:
            TypeNameError: the name is malformed.
        """
        return spelled(self.canonical(name), kind, self.ros)

    def packages(self) -> list[str]:
        """Return the names of all packages with a known type, sorted."""
        return sorted(self._packages | PACKAGES[self.ros])

    def names(self, kind: DefinitionKind) -> list[str]:
        """Return the names of all known messages, services or actions, sorted."""
        own = {f"{package}/{name}" for package, k, name in self._texts if k == kind}
        if kind == "msg":
            own.update(standard_names(self.ros))
            if self.ros == 1:
                suffixes = (*_ACTIONLIB_MESSAGES, *SUFFIXES["action"])
                own.update(action + suffix for action in self.names("action") for suffix in suffixes)
        return sorted(own)

    def has(self, name: str, kind: DefinitionKind) -> bool:
        """Return whether there is a definition text of a type; standard packages have further messages.

        Raises:
            TypeNameError: the name is malformed.
        """
        package, _, short = self.canonical(name).partition("/")
        return (package, kind, short) in self._texts

    def near_package(self, name: str) -> str:
        """Return a suggestion for a type of an unknown package, to end a sentence; empty if no name is near.

        Args:
            name: `pkg/Type`.
        """
        return hint(name.partition("/")[0], self.packages(), cutoff=0.8)

    # Types

    def message(self, name: str) -> MessageType:
        """Return the compiled type of a message.

        Args:
            name: `pkg/Type` or `pkg/msg/Type`.

        Raises:
            TypeNameError: the name is malformed, its package has no such message, or its definition is broken.
            UnknownPackageError: its package is unknown.
        """
        return self._messages.get(name) or self._find(name, self._message)

    def service(self, name: str) -> ServiceType:
        """Return the compiled type of a service.

        Args:
            name: `pkg/Type` or `pkg/srv/Type`.

        Raises:
            TypeNameError: the name is malformed, its package has no such service, or its definition is broken.
            UnknownPackageError: its package is unknown.
        """
        return self._services.get(name) or self._find(name, self._service)

    def action(self, name: str) -> ActionType:
        """Return the compiled type of an action.

        Args:
            name: `pkg/Type` or `pkg/action/Type`.

        Raises:
            TypeNameError: the name is malformed, its package has no such action, or its definition is broken.
            UnknownPackageError: its package is unknown.
        """
        return self._actions.get(name) or self._find(name, self._action)

    def full_text(self, name: str) -> str:
        """Return a message's text with those of all types in it, in the grammar of the ROS generation, for rosapi.

        It is the text of the message, then for each distinct nested type, depth first: 80 equal signs, `MSG: pkg/Type`
        and its text. Nested names are written in full.

        Raises:
            TypeNameError: as for `message`.
        """
        spec = self.message(name).spec
        text = self._full_texts.get(spec.name)
        if text is None:
            text = self._full_texts[spec.name] = full_text(spec)
        return text

    def definition(self, name: str) -> Definition:
        """Return the parsed definition of a message.

        Args:
            name: `pkg/Type`, in any spelling.

        Raises:
            TypeNameError: as for `message`.
            DefinitionError: the text cannot be read.
        """
        return self._definition(self.canonical(name))

    def definitions(self, package: str) -> list[Definition]:
        """Return the parsed definitions of a package: its messages, and the parts of its services and actions.

        Raises:
            DefinitionError: a text cannot be read.
        """
        own = [name for name in self.names("msg") if name.partition("/")[0] == package]
        found = [self._definition(name) for name in own]
        for kind in SUFFIXES:
            for name in self.names(kind):
                if name.partition("/")[0] == package:
                    found += self._parts(kind, name)
        return found

    # Search for types

    def _find(self, name: str, find: Callable[[str], T]) -> T:
        """Return the type that `find` has for the canonical name; for errors see `message`."""
        canonical = self.canonical(name)
        try:
            compiled = find(canonical)
        except DefinitionError as error:
            raise TypeNameError(f"Unable to resolve type {canonical}: {error}") from None
        self._remember(name, canonical)
        return compiled

    def _remember(self, spelling: str, canonical: str) -> None:
        """Keep a spelling that led to a type; there are only a few for each type, so memory is bounded.

        Spellings with needless slashes are not kept, because a client can send any number of them.
        """
        if "//" in spelling or spelling.startswith("/") or spelling.endswith("/"):
            return
        self._spellings[spelling] = canonical
        if canonical in self._messages:
            self._messages.setdefault(spelling, self._messages[canonical])
        if canonical in self._services:
            self._services.setdefault(spelling, self._services[canonical])

    def _message(self, name: str) -> MessageType:
        compiled = self._messages.get(name)
        if compiled is None:
            package, _, short = name.partition("/")
            if (package, "msg", short) not in self._texts:
                self._definition(name)  # raises an error if there is none
            compiled = self._messages[name] = self._type("msg", name, partial(self._definition, name))
        return compiled

    def _service(self, name: str) -> ServiceType:
        compiled = self._services.get(name)
        if compiled is None:
            package, _, short = name.partition("/")
            if (package, "srv", short) not in self._texts:
                raise self._unknown(package, name, "srv", "service")
            request, response = (
                self._type("srv", name + suffix, partial(self._part, "srv", name, i))
                for i, suffix in enumerate(SUFFIXES["srv"])
            )
            compiled = self._services[name] = ServiceType(name, request, response)
        return compiled

    def _action(self, name: str) -> ActionType:
        compiled = self._actions.get(name)
        if compiled is None:
            parts = self._parts("action", name)
            if not parts:
                raise self._unknown(name.partition("/")[0], name, "action", "action")
            goal, result, feedback = (
                self._message(part.name)
                if self._definition(part.name) is part
                else self._type("action", part.name, partial(self._part, "action", name, i))
                for i, part in enumerate(parts)
            )
            compiled = self._actions[name] = ActionType(name, goal, result, feedback)
        return compiled

    def _parts(self, kind: Literal["srv", "action"], name: str) -> tuple[Definition, ...]:
        """Return the messages in the text of a service or an action; none if it has no text."""
        known = self._known_parts.get((kind, name))
        if known is None:
            package, _, short = name.partition("/")
            text = self._texts.get((package, kind, short))
            if text is None:
                return ()
            known = parse_parts(kind, name, text, f"{package}/{kind}/{short}.{kind}", self.ros)
            self._known_parts[kind, name] = known
        return known

    def _part(self, kind: Literal["srv", "action"], name: str, i: int) -> Definition:
        return self._parts(kind, name)[i]

    def _type(self, kind: DefinitionKind, name: str, find: Callable[[], Definition]) -> MessageType:
        """Return a message type, compiled now or late.

        Args:
            kind: where the definition stands.
            find: returns the definition.
        """
        if self._is_checked:
            return LateMessageType(name, partial(self._spec, kind, name, find), self._encoders)
        return MessageType(self._spec(kind, name, find), self._encoders)

    def _spec(
        self, kind: DefinitionKind, name: str, find: Callable[[], Definition], within: tuple[str, ...] = ()
    ) -> MessageSpec:
        """Return a compiled message; `within` are the messages that contain it."""
        known = self._specs.get((kind, name))
        if known is None:
            # Two threads may compile the same type at once; both get that of the first.
            known = self._specs.setdefault((kind, name), self._compile(find(), within))
        return known

    def _compile(self, definition: Definition, within: tuple[str, ...]) -> MessageSpec:
        within = (*within, definition.name)

        def nested(f: Field) -> MessageSpec:
            if f.type in within:
                circle = " > ".join([*within[within.index(f.type) :], f.type])
                raise DefinitionError(definition.source, f.line, 1, f"a message cannot contain itself: {circle}")
            try:
                return self._spec("msg", f.type, partial(self._definition, f.type), within)
            except TypeNameError as error:
                raise DefinitionError(definition.source, f.line, 1, f"unknown type {f.type}: {error}") from None

        return compile_message(definition, nested, self._dialect, self._leniency)

    def _definition(self, name: str) -> Definition:
        known = self._definitions.get(name)
        if known is not None:
            return known
        package, _, short = name.partition("/")
        text = self._texts.get((package, "msg", short))
        if self.ros != 1:
            text = ros2_text(package, short) or text
        if text is None:
            definition = self._of_action(name)
            if definition is None:
                text = standard_text(self.ros, package, short)
        if text is not None:
            definition = parse_message(name, text, f"{package}/msg/{short}.msg", self.ros)
        if definition is None:
            raise self._unknown(package, name, "msg", "message")
        self._definitions[name] = definition
        return definition

    def _of_action(self, name: str) -> Definition | None:
        """Return a message that ROS generates from the text of an action; None if there is no such text."""
        for suffix, text in _OF_ACTIONS.items():
            action = name.removesuffix(suffix)
            if action != name and self._parts("action", action):
                source = f"{action.replace('/', '/action/')}.action"
                return parse_message(name, text.format(name=action), source, self.ros)
        for i, suffix in enumerate(SUFFIXES["action"]):
            action = name.removesuffix(suffix)
            if action != name and (parts := self._parts("action", action)):
                return parts[i]
        return None

    def _unknown(self, package: str, name: str, kind: DefinitionKind, what: str) -> TypeNameError:
        is_standard = package in PACKAGES[1] or package in PACKAGES[2]
        if package in self._packages or (is_standard and not (kind == "srv" and package in WITHOUT_SERVICES)):
            names = [short for one, k, short in self._texts if (one, k) == (package, kind)]
            if is_standard and kind == "msg":
                found = (full.partition("/") for full in standard_names(self.ros))
                names += [short for one, _, short in found if one == package]
            near = hint(name.rpartition("/")[2], names)
            return TypeNameError(f"Unable to resolve type {name}: package {package} has no such {what}{near}")
        return UnknownPackageError(
            f"Unable to import {package}.{kind} from package {package}. Caused by: no folder of definitions has it"
            f"{self.near_package(name)}"
        )


def _joined(
    first: Mapping[str, Mapping[str, str]], second: Mapping[str, Mapping[str, str]]
) -> dict[str, Mapping[str, str]]:
    """Return both tables as one; in rows of both, the entries of the second count."""
    return {key: {**first.get(key, {}), **second.get(key, {})} for key in [*first, *second]}
