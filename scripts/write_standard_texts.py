#!/usr/bin/env python3
"""Write `standard.msgs` in `rosbridge_sim/schema/definitions/`: the texts of the standard packages, from rosbags.

    python scripts/write_standard_texts.py           writes the file
    python scripts/write_standard_texts.py --check   writes nothing; ends with code 1 if the file is out of date

Do this after an update of rosbags. The import of rosbags and of its definitions takes 160 ms of CPU time and 10 MB, in
the middle of a client's request, so a server reads the finished texts.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "rosbridge_sim" / "schema" / "definitions" / "standard.msgs"


def read_texts() -> tuple[dict[str, str], dict[str, str]]:
    """Return the texts of ROS 1 and of ROS 2 by `pkg/Type`."""
    ros1, ros2 = (_texts(get_typestore(store).fielddefs) for store in (Stores.ROS1_NOETIC, Stores.ROS2_JAZZY))
    # rosbags has ROS 1's `time` and `duration` in a package of ROS 2
    return {name: text for name, text in ros1.items() if not name.startswith("builtin_interfaces/")}, ros2


def _texts(found: Mapping[str, Any]) -> dict[str, str]:
    return {full.replace("/msg/", "/"): _text(*definition) for full, definition in found.items()}


def _text(constants: list[Any], fields: list[Any]) -> str:
    lines = [f"{kind} {constant}={value}" for constant, kind, value in constants]
    # rosbags gives empty messages a byte, as DDS does; their definitions have no field.
    lines += [f"{_type(*desc)} {name}" for name, desc in fields if name != "structure_needs_at_least_one_member"]
    return "".join(f"{line}\n" for line in lines)


def _type(kind: Nodetype, detail: Any) -> str:  # noqa: ANN401 - the library's own tuples
    """Return a field's type as a definition text writes it."""
    if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        element, count = detail
        bound = "<=" if kind == Nodetype.SEQUENCE and count else ""
        return f"{_type(*element)}[{bound}{count or ''}]"
    if kind == Nodetype.NAME:
        package, _, name = detail.split("/")
        return name.lower() if package == "builtin_interfaces" else f"{package}/{name}"
    base, most = detail
    return f"{base}<={most}" if most else str(base)


def write() -> str:
    """Return the text of the file: a head such as `=== ros1 pkg/Type` above each definition, sorted."""
    ros1, ros2 = read_texts()
    both = {name: text for name, text in ros1.items() if ros2.get(name) == text}
    groups = {"both": both, "ros1": ros1, "ros2": ros2}
    return "".join(
        f"=== {group} {one}\n{texts[one]}"
        for group, texts in groups.items()
        for one in sorted(texts)
        if texts is both or one not in both
    )


def main() -> int:
    """Write or check the file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="write nothing; code 1 if the file is out of date")
    options = parser.parse_args()
    text = write()
    if not options.check:
        TARGET.write_text(text, encoding="utf-8")
    elif TARGET.read_text(encoding="utf-8") != text:
        print(f"{TARGET.name} is out of date: run python scripts/write_standard_texts.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
