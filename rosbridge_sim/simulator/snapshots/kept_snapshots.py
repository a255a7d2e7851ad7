"""The snapshots that a simulator keeps: by name, bounded in number and in bytes."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.errors import Reason
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.plain.snapshot_bytes import SnapshotHead
from rosbridge_sim.simulator.snapshots.node_state import SavedState
from rosbridge_sim.simulator.snapshots.snapshot_checks import Refusal

MAX_SNAPSHOTS: Final = 100
"""Snapshots that are kept: a person or a search keeps a few dozen branches."""

MAX_BYTES: Final = 256 * 1024 * 1024
"""All of them together [bytes]: 1,500 of 100 objects would fit, or twenty of a full world."""

MAX_ID: Final = 200
"""Characters of a snapshot's name: as much as a name of a topic."""


class Kept(Record):
    """A snapshot that is kept.

    Attributes:
        state: all of it.
        head: what stands before it when it becomes bytes.
        size: about how much memory it takes [bytes].
    """

    state: SavedState
    head: SnapshotHead
    size: int


class KeptSnapshots:
    """The snapshots by name, and the room for those that are being made.

    Attributes:
        by_name: oldest first.
        num_bytes: of all of them.
    """

    def __init__(self, account: Account) -> None:
        """Keep nothing yet.

        Args:
            account: pays for their memory.
        """
        self.by_name: dict[str, Kept] = {}
        self.num_bytes = 0
        self._account = account
        self._num_named = 0
        self._expected: list[str] = []  # names of those that are being made

    def choose_name(self, wanted: str) -> str:
        """Return the name of a snapshot: the client's, or the next free one.

        Raises:
            Refusal: it is too long, or not printable.
        """
        if wanted:
            if len(wanted) > MAX_ID or not wanted.isprintable():
                raise Refusal(f"id: expected at most {MAX_ID} printable characters", Reason.WRONG_VALUE)
            return wanted
        while True:
            self._num_named += 1
            name = f"snapshot-{self._num_named}"
            if name not in self.by_name:
                return name

    def check_number(self, name: str) -> None:
        """Check that one more may be kept.

        Raises:
            Refusal: there are as many as may be, and none of them has this name.
        """
        if len({name, *self.by_name, *self._expected}) > MAX_SNAPSHOTS:
            text = f"{MAX_SNAPSHOTS} snapshots are kept already: remove some by /sim/snapshots"
            raise Refusal(text, Reason.TOO_MUCH)

    def expect(self, name: str, size: int) -> None:
        """Take room for a snapshot that is being made; `keep` or `give_up` follows.

        Raises:
            Refusal: there is no room.
        """
        old = self.by_name.get(name)
        size_before = 0 if old is None or name in self._expected else old.size
        if self.num_bytes - size_before + size > MAX_BYTES:
            raise Refusal(
                f"the snapshots hold {self.num_bytes:,} of {MAX_BYTES:,} bytes, and this one has {size:,}:"
                " remove some by /sim/snapshots",
                Reason.TOO_MUCH,
            )
        self._expected.append(name)
        self._take(size)

    def keep(self, name: str, kept: Kept) -> None:
        """Keep a snapshot that was expected, in place of one with its name."""
        self._expected.remove(name)
        self.drop(name)
        self.by_name[name] = kept

    def give_up(self, name: str, size: int) -> None:
        """Expect a snapshot no longer."""
        self._expected.remove(name)
        self._take(-size)

    def drop(self, name: str) -> None:
        """Keep a snapshot no longer; none of this name is no error."""
        kept = self.by_name.pop(name, None)
        if kept is not None:
            self._take(-kept.size)

    def _take(self, size: int) -> None:
        self.num_bytes += size
        if size > 0:
            self._account.take(size)
        else:
            self._account.give(-size)
