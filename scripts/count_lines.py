"""Lines of the package: all, and those of code, without blanks, comments and docstrings.

    python scripts/count_lines.py [FOLDER]

A line counts as code if a token other than a comment stands on it, and it is no part of a docstring.
"""

from __future__ import annotations

import argparse
import ast
import tokenize
from collections import Counter
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "rosbridge_sim"
NO_CODE = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENCODING, tokenize.ENDMARKER),
}


def code_lines(path: Path) -> int:
    """Return the number of lines of code in a Python file."""
    with tokenize.open(path) as file:
        tokens = [token for token in tokenize.generate_tokens(file.readline) if token.type not in NO_CODE]
    found = {line for token in tokens for line in range(token.start[0], token.end[0] + 1)}
    return len(found - docstring_lines(ast.parse(path.read_bytes())))


def docstring_lines(tree: ast.AST) -> set[int]:
    """Return the lines of all texts that are statements: docstrings, and those below attributes."""
    texts = (node for node in ast.walk(tree) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
    return {
        line
        for node in texts
        if isinstance(node.value.value, str)  # type: ignore[attr-defined] # a Constant, as was asked above
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }


def main() -> None:
    """Print a line for each room, the largest first, and the sum."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=PACKAGE)
    root = parser.parse_args().folder
    code: Counter[str] = Counter()
    whole: Counter[str] = Counter()
    files: Counter[str] = Counter()
    for path in sorted(root.rglob("*.py")):
        room = path.parent.relative_to(root).as_posix()
        code[room] += code_lines(path)
        whole[room] += len(path.read_text().splitlines())
        files[room] += 1
    print(f"{'room':28} {'files':>6} {'lines':>8} {'code':>8}")
    for room, number in [*code.most_common(), ("total", code.total())]:
        is_sum = room == "total"
        num_files, lines = (files.total(), whole.total()) if is_sum else (files[room], whole[room])
        print(f"{room:28} {num_files:6} {lines:8} {number:8}")


if __name__ == "__main__":
    main()
