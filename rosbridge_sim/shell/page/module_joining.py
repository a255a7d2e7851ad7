"""JavaScript modules joined into one file, so that a browser needs one request for all of them.

This is no parser of JavaScript: it knows the few forms of `import` and `export` that the page uses, at the start of a
line, and refuses others with file and line. All modules share one scope then, so their top-level names must differ.
A module that few need is not joined: `import("./x.js")` loads it late. It stands beside the main module.
"""

from __future__ import annotations

import json
import posixpath
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple


class JoinError(ValueError):
    """A module has a form that cannot be joined; the text names file and line, and says what is expected."""


def join_modules(main: str, read: Callable[[str], str]) -> str:
    """Return one script with a module and all that it imports, each module behind those that it imports.

    Args:
        main: path of the module that is run, such as `js/main.js`.
        read: returns the text of a file, by its path relative to the page's folder.

    Raises:
        JoinError: a module has another form than the page uses, two top-level names are equal, an imported name has no
            export, or modules import each other in a circle.
        OSError: a file cannot be read.
    """
    joiner = _Joiner(read, posixpath.dirname(main))
    joiner.add(main, (), main)
    return "\n".join(f"// {path}\n{body.strip()}\n" for path, body in joiner.bodies.items())


class _Import(NamedTuple):
    """An import of a module or of a JSON file.

    Attributes:
        start, end: its place in the text.
        names: the imported names; for a JSON file the name of its value.
        source: path of the file, relative to the module.
        is_json: it is a JSON file.
    """

    start: int
    end: int
    names: tuple[str, ...]
    source: str
    is_json: bool


@dataclass(slots=True)
class _Joiner:
    """The files that are read so far.

    Attributes:
        read: returns the text of a file.
        folder: of the main module.
        bodies: texts without imports and exports by path, in the order of the joined file.
        exports: names that others may import, by path.
        owners: place of each top-level name.
    """

    read: Callable[[str], str]
    folder: str
    bodies: dict[str, str] = field(default_factory=dict)
    exports: dict[str, frozenset[str]] = field(default_factory=dict)
    owners: dict[str, str] = field(default_factory=dict)

    def add(self, path: str, importers: tuple[str, ...], where: str) -> None:
        """Read a module and those that it imports, unless they are there.

        Args:
            importers: the modules that import it, from the first one on.
            where: place of the import, for errors.
        """
        if path in importers:
            circle = " -> ".join([*importers[importers.index(path) :], path])
            raise JoinError(f"{where}: expected modules that do not import each other in a circle; got {circle}")
        if path in self.bodies:
            return
        text = self.read(path)
        code = _blank(text)
        imports = list(_imports_of(path, text, code))
        for one in imports:
            self._follow(one, path, importers, _place(path, text, one.start))
        body, code = (_without(each, [(one.start, one.end) for one in imports]) for each in (text, code))
        for pattern, expected in _REFUSED:
            match = pattern.search(code)
            if match is not None:
                raise JoinError(f"{_place(path, code, match.start())}: expected {expected}; got {match[0].strip()!r}")
        for match in _LATE_IMPORT.finditer(code):
            literal = _LATE_SOURCE.match(body, match.start())
            if literal is None or posixpath.dirname(path) != self.folder:
                where = _place(path, code, match.start())
                raise JoinError(f'{where}: expected import("./x.js"), in a module beside the main one')
        declarations = list(_DECLARATION.finditer(code))
        for match in declarations:
            self._own(match["name"], _place(path, code, match.start()))
        exported = [match for match in declarations if match["export"]]
        self.exports[path] = frozenset(match["name"] for match in exported)
        words = ((match.start(), match.start() + len("export ")) for match in exported)
        self.bodies[path] = _without(body, words)

    def _follow(self, one: _Import, path: str, importers: tuple[str, ...], where: str) -> None:
        if not one.source.startswith("."):
            raise JoinError(f'{where}: expected a relative path such as "./x.js"; got {one.source!r}')
        target = posixpath.normpath(posixpath.join(posixpath.dirname(path), one.source))
        if one.is_json:
            self._add_json(target, one.names[0], where)
            return
        self.add(target, (*importers, path), where)
        for name in one.names:
            if name not in self.exports[target]:
                raise JoinError(f"{where}: expected a name that {target} exports; got {name!r}")

    def _add_json(self, target: str, name: str, where: str) -> None:
        """Make a JSON file a constant. All modules that import it must use the same name."""
        if target in self.bodies:
            if self.owners.get(name) != target:
                raise JoinError(f"{where}: expected the name that other modules have for {target}; got {name!r}")
            return
        self._own(name, target)
        value = json.dumps(json.loads(self.read(target)), separators=(",", ":"))
        self.bodies[target] = f"const {name} = {value};"

    def _own(self, name: str, where: str) -> None:
        other = self.owners.setdefault(name, where)
        if other != where:
            raise JoinError(f"{where}: expected a top-level name that no other module has; {name!r} is also in {other}")


_MODULE_IMPORT: Final = re.compile(
    r"import\s+\{(?P<names>(?:\s*[\w$]+\s*,)*\s*[\w$]+\s*,?\s*)\}\s+from\s+\"(?P<source>[^\"\n]+\.js)\";"
)
_JSON_IMPORT: Final = re.compile(
    r"import\s+(?P<name>[\w$]+)\s+from\s+\"(?P<source>[^\"\n]+\.json)\"\s+with\s+\{\s*type:\s*\"json\"\s*\};"
)
_AT_IMPORT: Final = re.compile(r"^import\b", re.MULTILINE)

_DECLARATION: Final = re.compile(
    r"^(?P<export>export\s+)?(?:async\s+)?(?:function\s*\*?|class|const|let|var)\s+(?P<name>[\w$]+)", re.MULTILINE
)
"""A declaration of the top level, which begins its line: the modules are formatted."""

_REFUSED: Final = (
    (
        re.compile(r"^export\s+(?!(?:async\s+)?function\b|class\b|const\b).*", re.MULTILINE),
        "`export` before a function, a class or a const",
    ),
    (re.compile(r"import(?<!\w.{6})\s*\..*"), "an import at the start of the file"),
    (re.compile(r"^(?:const|let|var)\s*[\[{].*", re.MULTILINE), "one name for each declaration of the top level"),
    (re.compile(r"^(?:for\s+)?await\b.*", re.MULTILINE), "no `await` outside of functions"),
)
"""Forms that would not work in the joined file, and what is expected in their place. `import` is looked for as a plain
text, and the letter before it is judged then: that takes a tenth of the time of a search for its boundary."""

_LATE_IMPORT: Final = re.compile(r"import(?<!\w.{6})\s*\(")
_LATE_SOURCE: Final = re.compile(r"import\(\"\./\w+\.js\"\)")

_NOT_CODE: Final = re.compile(
    r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'|`(?:\\.|[^`\\])*`", re.DOTALL
)
"""Comments and texts."""


def _blank(text: str) -> str:
    """Return a module with blanks in place of its comments and texts; each line and column stays where it is."""
    return _NOT_CODE.sub(_blank_of, text)


def _blank_of(match: re.Match[str]) -> str:
    found = match[0]
    return _NOT_NEWLINE.sub(" ", found) if "\n" in found else " " * len(found)


_NOT_NEWLINE: Final = re.compile(r"[^\n]")


def _imports_of(path: str, text: str, code: str) -> Iterator[_Import]:
    """Yield the imports of a module."""
    for start in (match.start() for match in _AT_IMPORT.finditer(code)):
        match = _MODULE_IMPORT.match(text, start)
        if match is not None:
            names = tuple(filter(None, (name.strip() for name in match["names"].split(","))))
            yield _Import(start, match.end(), names, match["source"], is_json=False)
            continue
        match = _JSON_IMPORT.match(text, start)
        if match is None:
            got = text[start:].partition("\n")[0]
            raise JoinError(
                f'{_place(path, text, start)}: expected import {{ a, b }} from "./x.js"; with no `as`, default or star;'
                f" got {got!r}"
            )
        yield _Import(start, match.end(), (match["name"],), match["source"], is_json=True)


def _without(text: str, spans: Iterable[tuple[int, int]]) -> str:
    """Return a text with nothing but the ends of lines in its spans, from the first one on."""
    parts: list[str] = []
    last = 0
    for start, end in spans:
        parts += [text[last:start], "\n" * text.count("\n", start, end)]
        last = end
    return "".join([*parts, text[last:]])


def _place(path: str, text: str, position: int) -> str:
    return f"{path}:{text.count(chr(10), 0, position) + 1}"
