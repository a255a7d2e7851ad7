"""The parameter server: JSON values by absolute name, and the namespaces that these names form.

A value is kept as JSON text, so it costs only its bytes and no Python objects. Names are kept sorted, so a namespace is
a slice of them. Everything that a client can request in a loop is limited in number and in bytes, for all clients
together. Each client gets half of that, so that no client can use up everything.
A parameter outlives its client. After that it counts only for the limit of all together.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import orjson

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.participant import Participant

MAX_PARAMETERS: Final = 100_000
"""Largest number of parameters, so that a client that sets names in a loop cannot use up the memory."""

MAX_PARAMETER_BYTES: Final = 16 * 2**20
"""Limit for names and JSON texts of all parameters together [bytes]; the longest usual one, a robot description, has a
million."""

MAX_NAMESPACES: Final = 20_000
"""Largest number of namespaces with parameters. Reading the whole tree takes a microsecond for each, so 20 ms in all.
"""

MAX_VALUE_PARTS: Final = 200_000
"""Largest number of commas and brackets in a value that is not a string: so many elements are parsed in 10 ms.
Parameters are settings; arrays of data belong on a topic."""

MAX_MERGED: Final = 10_000
MAX_MERGED_BYTES: Final = 2**20
"""Limits for reading a namespace in which one name is both a value and a namespace, because its values must be parsed.
"""

MAX_REMOVED_SINGLY: Final = 100
"""Up to so many names are removed from the list one by one, at 30 us each in the longest list; for more it is rebuilt.
"""

VALUE_OVERHEAD: Final = 400
"""Memory of a parameter in addition to its name and text: the table entries, measured [bytes]."""


@dataclass(eq=False, slots=True)
class _ClientTotals:
    """Totals of what one client has set: parameters, namespaces and bytes."""

    num: int = 0
    num_namespaces: int = 0
    num_bytes: int = 0


@dataclass(slots=True)
class _Entry:
    """One parameter.

    Attributes:
        folder: its namespace; empty for the root.
        member: its text in the JSON object of its namespace: `"name":value`.
        skip: position of the value in `member`.
        serial: a number that grows with each new name.
        account: totals of the client that set it.
    """

    folder: str
    member: bytes
    skip: int
    serial: int
    account: _ClientTotals


@dataclass(slots=True)
class _Namespace:
    """One namespace: the number of parameters and namespaces in it, and the client that created it."""

    name: str
    num: int
    account: _ClientTotals


class Parameters:
    """All parameters of one bus.

    Attributes:
        on_change: called with `(name, text)` before a parameter is set, and after it is deleted, then with None; a
            GraphError refuses a new value.
    """

    def __init__(self) -> None:
        self.on_change: Callable[[str, str | None], None] = _do_nothing
        self._entries: dict[str, _Entry] = {}
        self._names: list[str] = []
        self._namespaces: dict[str, _Namespace] = {}
        self._accounts: dict[Participant, _ClientTotals] = {}
        self._num_bytes = 0
        self._serial = 0
        self._read: tuple[tuple[str, int], str] | None = None  # the namespace of the last read, and its text

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names in sorted order."""
        return iter(self._names)

    def __contains__(self, name: str) -> bool:
        return name in self._entries

    def num_held(self, owner: Participant) -> int:
        """Return the memory of the parameters that an owner has set [bytes]."""
        account = self._accounts.get(owner)
        return account.num_bytes + VALUE_OVERHEAD * (account.num + account.num_namespaces) if account else 0

    def put(self, name: str, value: str, owner: Participant) -> None:
        """Set a parameter. After an error nothing has changed.

        Args:
            name: absolute name.
            value: JSON text.

        Raises:
            orjson.JSONDecodeError: the value is not JSON text.
            GraphError: the value is too large or nested too deeply, or a limit is reached.
        """
        text = _normalise(value)
        old = self._entries.get(name)
        folder, _, last = name.rpartition("/")
        key = orjson.dumps(last) + b":"
        size = _size(name, text)
        account = self._accounts.get(owner) or _ClientTotals()
        self._check_room(name, size, old, account)
        if old is None:
            self._check_namespaces(folder, account)
        self.on_change(name, text.decode())
        if old is None:
            insort(self._names, name)
            self._add_to_namespace(folder, account)
            self._serial += 1
        else:
            self._settle(old.account, -1, -_size(name, old.member[old.skip :]))
        self._accounts[owner] = account
        self._settle(account, 1, size)
        serial = self._serial if old is None else old.serial
        shared = self._namespaces[folder].name if folder else ""
        self._entries[name] = _Entry(shared, key + text, len(key), serial, account)
        self._read = None

    def change(self, changes: list[tuple[str, str | None]], owner: Participant) -> None:
        """Set and delete parameters. After an error nothing has changed.

        Args:
            changes: absolute names and JSON texts; None deletes a parameter, if it is set.
            owner: the client that sets them.

        Raises:
            GraphError: as for `put`.
        """
        done: list[tuple[str, _Entry | None]] = []
        try:
            for name, text in changes:
                old = self._entries.get(name)
                if text is not None:
                    self.put(name, text, owner)
                elif old is not None:
                    self.remove([name])
                done.append((name, old))
        except GraphError:
            for name, old in reversed(done):
                self._put_back(name, old)
            raise

    def _put_back(self, name: str, old: _Entry | None) -> None:
        """Undo a change, whatever the limits: the old entry may count for another client."""
        if name in self._entries:
            self.remove([name])
        if old is not None:
            insort(self._names, name)
            self._add_to_namespace(old.folder, old.account)
            self._settle(old.account, 1, _size(name, old.member[old.skip :]))
            self._entries[name] = old
            self._read = None
            self.on_change(name, old.member[old.skip :].decode())

    def remove(self, names: list[str]) -> None:
        """Delete parameters; all of them must be set.

        Args:
            names: absolute names.
        """
        for name in names:
            entry = self._entries.pop(name)
            self._settle(entry.account, -1, -_size(name, entry.member[entry.skip :]))
            self._remove_from_namespace(entry.folder)
        if len(names) <= MAX_REMOVED_SINGLY:
            for name in names:
                del self._names[bisect_left(self._names, name)]
        else:
            self._names = [name for name in self._names if name in self._entries]
        self._read = None
        for name in names:
            self.on_change(name, None)

    def disown(self, owner: Participant) -> None:
        """Forget the owner of parameters, because it has left; the parameters stay."""
        self._accounts.pop(owner, None)

    def text(self, name: str) -> str:
        """Return the value of a parameter that is set, as JSON text.

        Args:
            name: absolute name.
        """
        entry = self._entries[name]
        return entry.member[entry.skip :].decode()

    def below(self, prefix: str) -> list[str]:
        """Return the names that begin with a prefix, in sorted order.

        Args:
            prefix: ends with a slash or a colon.
        """
        return self._names[slice(*self._range(prefix))]

    def has_below(self, prefix: str, admits: Callable[[str], bool]) -> bool:
        """Return True if an allowed name begins with a prefix.

        Args:
            admits: returns True for an allowed name.
        """
        start, end = self._range(prefix)
        return any(admits(self._names[i]) for i in range(start, end))

    def tree(self, namespace: str, names: list[str]) -> str:
        """Return the JSON text of a namespace.

        Its names are nested as in ROS 1: `/a` of `/a/b` = 1 is {"b": 1}.

        Args:
            namespace: absolute name.
            names: the names in it that may be read.

        Raises:
            GraphError: a name is both a value and a namespace, and there is too much to merge.
        """
        key = (namespace, len(names))  # all clients have one policy, so equal counts mean equal names
        if self._read is None or self._read[0] != key:
            self._read = (key, self._make_tree(namespace.rstrip("/"), names))
        return self._read[1]

    def _make_tree(self, root: str, names: list[str]) -> str:
        entries = self._entries
        members: dict[str, list[bytes]] = {root: []}
        for name in names:
            entry = entries[name]
            found = members.get(entry.folder)
            if found is None:
                found = members[entry.folder] = []
            found.append(entry.member)
        inner: dict[str, list[str]] = {}
        to_place = list(members)
        for folder in to_place:
            if folder == root:
                continue
            parent = folder.rpartition("/")[0]
            inner.setdefault(parent, []).append(folder)
            if parent not in members:
                members[parent] = []
                to_place.append(parent)
        is_both = [folder for folder in to_place if folder != root and folder in entries]
        if is_both and not set(names).isdisjoint(is_both):
            return self._merge(root, names)
        return _join(root, members, inner)

    def _merge(self, root: str, names: list[str]) -> str:
        entries = [(name, self._entries[name]) for name in names]
        if len(names) > MAX_MERGED or sum(len(entry.member) for _, entry in entries) > MAX_MERGED_BYTES:
            raise GraphError(
                f"Namespace {root or '/'} has a name that is both a value and a namespace, and is too large to merge:"
                f" expected {MAX_MERGED} parameters and {MAX_MERGED_BYTES} bytes at most. Read its parts"
            )
        entries.sort(key=lambda each: each[1].serial)
        values = {name[len(root) + 1 :]: orjson.loads(entry.member[entry.skip :]) for name, entry in entries}
        try:
            return orjson.dumps(merge(values)).decode()
        except orjson.JSONEncodeError:
            raise GraphError("The value is nested too deeply") from None

    def _range(self, prefix: str) -> tuple[int, int]:
        """Return the slice of the names with a prefix. It ends where names with the next character would begin."""
        return bisect_left(self._names, prefix), bisect_left(self._names, prefix[:-1] + chr(ord(prefix[-1]) + 1))

    # Limits

    def _check_room(self, name: str, size: int, old: _Entry | None, account: _ClientTotals) -> None:
        old_size = 0 if old is None else _size(name, old.member[old.skip :])
        is_own = old is not None and old.account is account
        for num, num_bytes, part, whose in (
            (len(self._entries) + (old is None), self._num_bytes + size - old_size, 1, "together"),
            (account.num + (not is_own), account.num_bytes + size - old_size * is_own, 2, "of one client"),
        ):
            if num > MAX_PARAMETERS // part:
                raise GraphError(f"Parameter {name}: at most {MAX_PARAMETERS // part} parameters {whose} can be kept")
            if num_bytes > MAX_PARAMETER_BYTES // part:
                raise GraphError(
                    f"Parameter {name}: all parameters {whose} can have at most {MAX_PARAMETER_BYTES // part} bytes,"
                    " names included"
                )

    def _check_namespaces(self, folder: str, account: _ClientTotals) -> None:
        num = 0
        while folder and folder not in self._namespaces:
            num += 1
            folder = folder.rpartition("/")[0]
        for now, part, whose in ((len(self._namespaces), 1, "together"), (account.num_namespaces, 2, "of one client")):
            if num and now + num > MAX_NAMESPACES // part:
                raise GraphError(f"At most {MAX_NAMESPACES // part} namespaces of parameters {whose} can be kept")

    def _settle(self, account: _ClientTotals, num: int, num_bytes: int) -> None:
        account.num += num
        account.num_bytes += num_bytes
        self._num_bytes += num_bytes

    def _add_to_namespace(self, name: str, account: _ClientTotals) -> None:
        while name:
            folder = self._namespaces.get(name)
            if folder is not None:
                folder.num += 1
                return
            self._namespaces[name] = _Namespace(name, 1, account)
            account.num_namespaces += 1
            name = name.rpartition("/")[0]

    def _remove_from_namespace(self, name: str) -> None:
        while name:
            folder = self._namespaces[name]
            folder.num -= 1
            if folder.num:
                return
            del self._namespaces[name]
            folder.account.num_namespaces -= 1
            name = name.rpartition("/")[0]


def merge(values: dict[str, Any]) -> dict[str, Any]:
    """Return values by path from values by relative name: `b/c` = 1 is {"b": {"c": 1}}.

    The values are not changed.
    """
    root: dict[str, Any] = {}
    own = {id(root)}  # only objects made here may be changed; all others are values of parameters
    for name, value in values.items():
        *path, last = name.split("/")
        node = root
        for part in path:
            inner = node.get(part)
            if id(inner) not in own:
                node[part] = dict(inner) if isinstance(inner, dict) else {}
                own.add(id(node[part]))
            node = node[part]
        node[last] = value
    return root


def _normalise(value: str) -> bytes:
    """Return JSON text without white space.

    Raises:
        orjson.JSONDecodeError: the value is not JSON text.
        GraphError: it has too many elements, or its nesting can be read but not written again.
    """
    if not value.lstrip().startswith('"'):
        num = value.count(",") + value.count("[") + value.count("{")
        if num > MAX_VALUE_PARTS:
            raise GraphError(f"The value has too many elements: expected {MAX_VALUE_PARTS} at most, got about {num}")
    try:
        return orjson.dumps(orjson.loads(value))
    except orjson.JSONEncodeError:
        raise GraphError("The value is nested too deeply") from None


def _size(name: str, text: bytes) -> int:
    return len(name.encode()) + len(text)


def _join(root: str, members: dict[str, list[bytes]], inner: dict[str, list[str]]) -> str:
    """Return the text of a tree in one pass, so that inner texts are not copied at each level."""
    out: list[bytes] = []
    to_write: list[bytes | str] = [root]
    while to_write:
        piece = to_write.pop()
        if isinstance(piece, bytes):
            out.append(piece)
            continue
        out.append(b"{")
        out.append(b",".join(members[piece]))
        to_write.append(b"}")
        folders = inner.get(piece, ())
        for i, folder in enumerate(folders):
            comma = b"," if members[piece] or i < len(folders) - 1 else b""
            to_write += (folder, comma + orjson.dumps(folder.rpartition("/")[2]) + b":")
    return b"".join(out).decode()


def _do_nothing(_name: str, _text: str | None) -> None:
    """Do nothing: no one else keeps the parameters."""
