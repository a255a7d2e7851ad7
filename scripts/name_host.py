"""Give README.md and pyproject.toml the address of the repository, for the page of a package index.

    python scripts/name_host.py https://HOST/OWNER/NAME TAG

Links of README.md are relative. That is right in a checkout, and means nothing on the page of an index. A checkout does
not know where it is hosted, but the workflow that builds a release does: it runs this first, and commits nothing.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]

LINK: Final = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!https?://|#)([^)\s]+)\)")
"""A link or picture of Markdown to a file: mark of a picture, text, path."""


def main(words: list[str]) -> int:
    """Change both files; return the exit code."""
    if len(words) != 2 or not words[0].startswith("https://"):
        print("name_host.py: expected https://HOST/OWNER/NAME TAG", file=sys.stderr)
        return 2
    name_host(ROOT, words[0].rstrip("/"), words[1])
    return 0


def name_host(folder: Path, url: str, tag: str) -> None:
    """Make the links of README.md absolute, and add the addresses of the project to pyproject.toml.

    Args:
        folder: of both files.
        url: of the repository, without a slash at its end.
        tag: of the version: a page of it shows the files as they were.

    Raises:
        ValueError: a link names a file that is not there.
    """
    readme = folder / "README.md"
    readme.write_text(absolute_links(readme.read_text("utf-8"), folder, url, tag), "utf-8")
    project = folder / "pyproject.toml"
    text = project.read_text("utf-8")
    urls = {"Source": url, "Documentation": f"{url}/tree/{tag}/docs", "Changelog": f"{url}/blob/{tag}/CHANGELOG.md"}
    lines = [f'{name} = "{address}"' for name, address in urls.items()]
    mark = "[project.scripts]\n"
    assert text.count(mark) == 1
    project.write_text(text.replace(mark, "\n".join(["[project.urls]", *lines, "", mark])), "utf-8")


def absolute_links(text: str, folder: Path, url: str, tag: str) -> str:
    """Return a text of Markdown whose links to files name the repository.

    Raises:
        ValueError: a link names a file that is not there.
    """

    def rewrite(match: re.Match[str]) -> str:
        picture, shown, target = match.groups()
        path, _, part = target.partition("#")
        if not (folder / path).exists():
            raise ValueError(f"README.md: expected a file, got {path}")
        kind = "raw" if picture else "tree" if (folder / path).is_dir() else "blob"
        return f"{picture}[{LINK.sub(rewrite, shown)}]({url}/{kind}/{tag}/{path}{'#' if part else ''}{part})"

    return LINK.sub(rewrite, text)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
