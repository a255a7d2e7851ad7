"""The report on a simulator after a failed test: last message of every topic, a picture, the command to repeat the run.

Messages are read without a subscription, so the report does not change which topics are published or listed.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError, RosbridgeSimError
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.scenarios.scenario import Spawn
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.value_types import SECRET, SWITCH, URLS
from rosbridge_sim.world.state.world import Kind, World

MAX_TOPICS: Final = 1_000
"""Largest number of topics whose last message is kept: more than the simulator and a test's programs have."""

MAX_MESSAGE: Final = 600
"""Bytes of a message that are shown: a whole ego status, or the start of a list of objects."""

MAX_REPORT: Final = 20_000
"""Bytes of all messages that are shown: about 30 topics. People read the report in the log of a CI job."""

_LEFT_OUT: Final = frozenset({"host", "port", "data-dir"})
"""Settings of the test, not of the run: a free port, and a temporary folder."""


class _Scene(Record):
    """The contents of a picture."""

    frame: int
    road_map: RoadMap
    agents: list[Spawn]


class FailureReport:
    """Follows a simulator that runs in its own thread, and reports on it after a failed test."""

    def __init__(self, simulator: Simulator) -> None:
        """Start to follow a simulator.

        Args:
            simulator: a simulator that was started by `open`.
        """
        self._simulator = simulator
        self._last: dict[str, Message] = {}
        simulator.run_inside(self._follow)

    def _follow(self) -> None:
        assert self._simulator.bus is not None, "it was opened"
        self._simulator.bus.delivery.watch(self._keep)

    def _keep(self, topic: Topic, message: Message) -> None:
        if topic.name in self._last or len(self._last) < MAX_TOPICS:
            self._last[topic.name] = message

    def text(self, picture: Path, test: str) -> str:
        """Return the report; write the picture into a file.

        Args:
            picture: path of the picture, a `.png`. Its folder is created if needed.
            test: the test's id for pytest.

        Returns:
            Lines of text, without a line end after the last one.
        """
        lines = [f"{self._simulator!r}", *self._picture_lines(picture), *self._message_lines()]
        command = command_of(self._simulator.settings)
        return "\n".join([*lines, "to repeat the run:", f"  {command}", f"  python -m pytest {shlex.quote(test)}"])

    def _picture_lines(self, path: Path) -> Iterator[str]:
        try:
            scene = self._simulator.run_inside(self._scene)
        except RuntimeError:
            yield "picture: none, because the simulator was closed"
            return
        if scene is None:
            return
        from rosbridge_sim.shell.drawing.map_picture import draw_map  # noqa: PLC0415 - it needs Pillow, and only after a failure

        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            draw_map(scene.road_map, path, scene.agents)
        except (OSError, DocumentError) as error:
            yield f"picture: none: {error}"
        else:
            yield f"picture of frame {scene.frame}: {path}"

    def _scene(self) -> _Scene | None:
        node = self._simulator.node
        if node is None:
            return None
        return _Scene(node.world.frame, node.scene.road_map, list(_agents_of(node.world)))

    def _message_lines(self) -> Iterator[str]:
        """Yield the last message of each topic, then the present content of topics without a subscriber."""
        last = dict(self._last)
        try:
            current = self._simulator.run_inside(self._current)
        except RuntimeError:
            current = {}
        unheard = {name: message for name, message in current.items() if name not in last}
        room = MAX_REPORT
        for title, messages in (
            ("last message of each topic:", last),
            ("topics without a subscriber, as they would be now:", unheard),
        ):
            if not messages:
                continue
            yield title
            for i, name in enumerate(sorted(messages)):
                line = f"  {safe(name)} {_show(messages[name])}"
                room -= len(line.encode(errors="replace"))
                if room < 0:
                    yield f"  ... and {len(messages) - i:,} more topics"
                    break
                yield line

    def _current(self) -> dict[str, Message]:
        node = self._simulator.node
        if node is None or node.context.failure.why is not None:
            return {}
        return {topic.name: message for topic, message in node.context.publishers.current()}


def _show(message: Message) -> str:
    """Return a message as JSON on one line, or its start."""
    try:
        text = message.json
    except RosbridgeSimError as error:
        return f"(cannot be written: {safe(str(error))})"
    shown = safe(text[:MAX_MESSAGE].decode(errors="replace"))
    return shown if len(text) <= MAX_MESSAGE else f"{shown}... ({len(text):,} bytes)"


def _agents_of(world: World) -> Iterator[Spawn]:
    """Yield everything that is in a world, as a picture of a scenario shows it."""
    for row in world.placed():
        kind = Kind(int(world.kind[row]))
        yield Spawn(
            kind=kind,
            model=Model(world.names[row], kind, world.bodies[row]),
            name=world.names[row],
            uid=int(world.uid[row]),
            x=float(world.x[row]),
            y=float(world.y[row]),
            z=float(world.z[row]),
            yaw=float(world.yaw[row]),
        )


def command_of(settings: Settings) -> str:
    """Return the command that starts a server with the same world.

    It has the scenario, the seed, and all settings that differ from the defaults. Tokens and URLs are left out, because
    many people may read a report. Tables are left out, because no flag sets them.

    Args:
        settings: settings of the simulator.
    """
    words = ["rosbridge-sim", "serve"]
    for key, field in FIELDS.items():
        kind, value = FLAGS[key].kind, getattr(settings, field.name)
        is_default = value == getattr(Settings(), field.name) and key not in {"scenario", "seed"}
        if is_default or key in _LEFT_OUT or kind in (SECRET, URLS) or kind.is_table:
            continue
        if kind is SWITCH:
            words.append(f"--{key}" if value else f"--no-{key}")
            continue
        none = kind.sign.rpartition("|")[2] if "|" in kind.sign else "none"
        for one in value if isinstance(value, tuple) else [none if value is None else value]:
            words += [f"--{key}", shlex.quote(str(one))]
    return " ".join(words)
