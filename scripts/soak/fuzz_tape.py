"""Record of the acts that were sent to a server, so that they can be sent again."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, field
from pathlib import Path

from scripts.soak.fuzz_frames import Act
from scripts.soak.fuzz_server import CONFIGURATIONS, Configuration

MAX_KEPT = 256 * 2**20
"""Largest size of the kept acts [bytes]; earlier ones are dropped."""


@dataclass(slots=True)
class Tape:
    """Acts of one round, for a replay.

    Attributes:
        configuration: of the server.
        acts: number of the client and its act, in order of time.
        num_bytes: of all acts.
    """

    configuration: Configuration
    acts: list[tuple[int, Act]] = field(default_factory=list)
    num_bytes: int = 0

    def add(self, client: int, act: Act) -> None:
        """Keep one more act; if there are too many, drop half of them.

        Args:
            client: its number.
        """
        self.acts.append((client, act))
        self.num_bytes += len(act.data)
        if self.num_bytes > MAX_KEPT:
            del self.acts[: len(self.acts) // 2]
            self.num_bytes = sum(len(act.data) for _, act in self.acts)

    def write(self, path: Path) -> None:
        """Write the tape as JSON lines.

        Args:
            path: of the file.
        """
        lines = [json.dumps({"configuration": self.configuration.name})]
        lines += [
            json.dumps({"client": client, "form": act.form, "data": base64.b64encode(act.data).decode()})
            for client, act in self.acts
        ]
        path.write_text("\n".join(lines) + "\n")

    @classmethod
    def read(cls, path: Path) -> Tape:
        """Read a tape that `write` has written.

        Args:
            path: of the file.

        Returns:
            The tape.
        """
        head, *lines = map(json.loads, path.read_text().splitlines())
        (configuration,) = (one for one in CONFIGURATIONS if one.name == head["configuration"])
        tape = cls(configuration)
        for line in lines:
            tape.add(line["client"], Act(line["form"], base64.b64decode(line["data"])))
        return tape
