"""Install extras alone, each in a clean environment, and run what their pages tell the reader to run first.

    python scripts/try_extras.py                every extra that users install
    python scripts/try_extras.py campaign gym   some of them

The environment that runs the tests has all extras, so it cannot show that one of them lacks a package. Each command
stands on its page word for word; a server is stopped by SIGINT once it listens. Ends with 1 if one fails.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import tomllib
import venv
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).parents[1]

NOT_FOR_USERS: Final = frozenset({"test", "docs", "lint"})
"""Extras of those who change the project; other jobs install them."""


class FirstUse(NamedTuple):
    """First commands with an extra, from a page of the documentation."""

    page: str
    install: str
    """The command, without `pip install`."""
    run: tuple[str, ...]
    """Texts on the page: a line of a shell, or the first line of a block, which is run whole."""


FIRST_USES: Final[Mapping[str, FirstUse]] = {
    "sensors": FirstUse(
        "docs/reference/sensors.md", "'.[sensors]'", ("rosbridge-sim clip --scenario town -o town.webp",)
    ),
    "ros2": FirstUse("docs/guides/ros2.md", "'rosbridge-sim[ros2]'", ("rosbridge-sim serve --ros2-domain 7",)),
    "gym": FirstUse("docs/guides/gymnasium.md", '"rosbridge-sim[gym]"', ("import gymnasium",)),
    "campaign": FirstUse("docs/guides/campaigns.md", '"rosbridge-sim[campaign]"', ("cat > first.toml <<END",)),
    "fast": FirstUse("docs/operation.md", '"rosbridge-sim[fast]"', ("rosbridge-sim serve --traffic 100",)),
    "ray": FirstUse(
        "docs/guides/campaigns.md",
        '"rosbridge-sim[campaign,ray]"',
        ("cat > first.toml <<END", "rosbridge-sim campaign run first.toml --ray local --output on_ray"),
    ),
}


def main() -> int:
    """Try the extras that are named; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("extras", nargs="*", metavar="EXTRA", help=f"of {', '.join(FIRST_USES)}; default: all")
    names = parser.parse_args().extras or list(FIRST_USES)
    unknown = [name for name in names if name not in FIRST_USES]
    if unknown:
        parser.error(f"no extra of users is named {', '.join(unknown)}: expected {', '.join(FIRST_USES)}")
    failed = [name for name in names if not try_extra(name)]
    print(f"failed: {', '.join(failed)}" if failed else "each extra works alone")
    return 1 if failed else 0


def declared_extras() -> set[str]:
    """Names of all extras in pyproject.toml."""
    return set(tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"])


def try_extra(name: str) -> bool:
    """Install an extra alone, and run its first use; return whether that worked."""
    use = FIRST_USES[name]
    language, script = first_script(use)
    with tempfile.TemporaryDirectory(prefix=f"extra_{name}_") as folder:
        place = Path(folder)
        venv.create(place / "env", with_pip=True)
        (place / "work").mkdir()
        wanted = re.search(r"\[[\w,]+\]", use.install)
        assert wanted is not None
        print(f"{name}: pip install {use.install}", flush=True)
        install = [
            str(place / "env/bin/pip"),
            "install",
            "--quiet",
            "--disable-pip-version-check",
            f"{ROOT}{wanted[0]}",
        ]
        if subprocess.run(install, check=False).returncode:  # noqa: S603 - our own extra
            return False
        print(f"{name}: {script.splitlines()[0]}", flush=True)
        return run_first(place, language, script)


def first_script(use: FirstUse) -> tuple[str, str]:
    """Return the language and the text of what a page runs first.

    Raises:
        ValueError: the page has not these words.
    """
    text = (ROOT / use.page).read_text("utf-8")
    if f"pip install {use.install}" not in text:
        raise ValueError(f"{use.page}: expected the command pip install {use.install}")
    blocks = re.findall(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    language, parts = "shell", []
    for start in use.run:
        if start not in text:
            raise ValueError(f"{use.page}: expected {start!r}")
        language, part = next((block for block in blocks if block[1].startswith(start)), ("shell", start))
        parts.append(part)
    return language, "\n".join(parts)


def run_first(place: Path, language: str, script: str) -> bool:
    """Run a script in a folder, with the environment there; return whether it ended well."""
    env = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "ROSBRIDGE_SIM_"))}
    env["PATH"] = f"{place}/env/bin:{env['PATH']}"
    if " serve " in script:
        return run_server(place, script.split(), env)
    words = ["python", "-c", script] if language == "python" else ["bash", "-e", "-c", script]
    return subprocess.run(words, cwd=place / "work", env=env, check=False).returncode == 0  # noqa: S603 - our own page


def run_server(place: Path, words: list[str], env: Mapping[str, str]) -> bool:
    """Start a server, stop it once it listens; return whether it ended well."""
    with subprocess.Popen(  # noqa: S603 - as above
        [*words, "--port", "0"], cwd=place / "work", env=env, stdout=subprocess.PIPE, stderr=sys.stderr, text=True
    ) as server:
        assert server.stdout is not None
        is_up = "listening on" in server.stdout.readline()
        server.send_signal(signal.SIGINT)
        return server.wait() == 0 and is_up


if __name__ == "__main__":
    sys.exit(main())
