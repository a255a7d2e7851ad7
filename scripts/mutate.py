#!/usr/bin/env python3
"""Mutation test of the central files: find small faults that the tests do not notice.

    .venv/bin/python scripts/mutate.py                        every file of the table, at most 45 minutes
    .venv/bin/python scripts/mutate.py protocol/outbox.py     one file, or one folder
    .venv/bin/python scripts/mutate.py --num 1500 --seed 1    another random sample, of so many mutants
    .venv/bin/python scripts/mutate.py --sample 3 --minutes 5 --least 80    three files, chosen by the seed; it fails
                                                              if less than 80 % are noticed or live for a known reason
    .venv/bin/python scripts/mutate.py --quick --num 1500     by the quick tests alone, which notice nearly as much
    .venv/bin/python scripts/mutate.py --again LOG            the survivors that an earlier run printed, with new tests
    .venv/bin/python scripts/mutate.py graph/guard.py --tests graph/test_guard.py      a file, by some tests alone

A mutant is the file with one change: a comparison, an operator, a number, a condition, or a call left out.
Mutants are tried in random order, so a run that ends early still gives a fair score. Each one runs in a fork of one
process that has imported the tests, with the tests alone that reach the changed line: see `mutation/warm_tests.py`.
So a mutant that is noticed takes a tenth of a second to a second. A mutant that no test notices is printed as
`file:line: old -> new`, with the number of tests that reach it. Those that live for a reason, most of all because they
are equivalent to the original, stand in `mutation/survivors.toml`. They are counted apart, and not printed.

The script has its own operators, because mutmut and cosmic-ray write the mutants to disk and start Python for each of
them; and mutmut's trampolines do not work with `__slots__`.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import time
import tomllib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from scripts.mutation.mutants import has_mutants  # noqa: E402 - needs the path above
from scripts.mutation.warm_tests import PACKAGE, Target, Tests, run_warm  # noqa: E402 - the same
from tests.world.processors import WITHOUT_AVX_512, is_without_avx_512  # noqa: E402 - as above

SURVIVORS = ROOT / "scripts" / "mutation" / "survivors.toml"
"""The mutants that live for a reason."""

FEW = 60
"""A smaller number of mutants is not judged by `--least`: chance decides too much."""

_WORLD = (
    "world/drivers world/lane_changes world/followers world/people world/vehicle world/test_step.py "
    "simulator/sim_services/test_describe.py simulator/test_drivers.py"
)
_DRIVES = "world/test_ego_drives.py world/test_traffic_drives.py world/test_view_driver.py world/many_worlds"

TESTS = {
    "protocol/outbox.py": "protocol",
    "protocol/session.py": "protocol graph/test_vectors.py graph/peers/test_peer.py",
    "protocol/subscription.py": "protocol graph/peers/test_peer.py",
    "simulator/sync": "simulator/sync simulator/sim_services/test_barrier_services.py simulator/test_simulator_node.py",
    "simulator/kernel/sync_driver.py": (
        "simulator/test_simulator_node.py simulator/kernel simulator/morai_services/test_loads.py "
        "simulator/bus/test_publishers.py simulator/sim_services/test_barrier_services.py "
        "simulator/sim_services/test_step_service.py"
    ),
    "simulator/kernel/frame_stepper.py": (
        "simulator/test_simulator_node.py simulator/kernel simulator/sim_services/test_real_time_factor.py "
        "simulator/sim_services/test_step_service.py"
    ),
    "simulator/snapshots/saved_loads.py": (
        "simulator/sim_services/test_forged_snapshots.py simulator/sim_services/test_traffic_demand.py "
        "simulator/snapshots"
    ),
    "simulator/snapshots/snapshot_checks.py": (
        "simulator/sim_services/test_forged_snapshots.py simulator/sim_services/test_traffic_demand.py "
        "simulator/snapshots"
    ),
    "graph/topic_table.py": "graph",
    "graph/delivery.py": "graph",
    "graph/service_table.py": "graph",
    "graph/guard.py": "graph",
    "world/step.py": f"{_WORLD} {_DRIVES} world/contacts/test_collisions.py world/state",
    "world/drivers": f"{_WORLD} {_DRIVES} world/roads/test_turn_shares.py",
    "world/lane_changes": f"{_WORLD} {_DRIVES}",
    "world/followers": f"{_WORLD} {_DRIVES}",
    "world/people": f"{_WORLD} {_DRIVES}",
    "world/vehicle": f"{_WORLD} {_DRIVES}",
    "simulator/sensors": "simulator/sensors",
    "simulator/sensor_rigs": "simulator/sensor_rigs simulator/sensors",
    "simulator/sensor_data": "simulator/sensor_data simulator/sensors",
    "scenery": "scenery",
    "environments": "environments",
    "worlds": "worlds environments/test_remote_env.py",
    "campaigns": "campaigns",
    "campaign_runs": "campaign_runs",
    "graph/ros2": "graph/ros2 graph/gateway",
    "graph/gateway": "graph/ros2 graph/gateway",
    "shell/rendering": "shell/rendering",
    "contracts": "contracts",
    "doctor": "doctor",
    "maps/opendrive": "maps",
    "scenarios/openscenario": "scenarios/openscenario simulator/story",
    "mock": "mock",
}
"""The central files and folders, with the tests that should notice their mutants."""

APART: Final = frozenset({"campaign_runs"})
"""Folders that are tried only by name: most of their code runs in processes of its own, which have no mutant."""


def files_of(name: str) -> list[str]:
    """Return the files of a central file or folder.

    Args:
        name: a path within the package.

    Returns:
        Those of its files that have mutants, as paths within the package.
    """
    path = ROOT / PACKAGE / name
    found = sorted(path.rglob("*.py")) if path.is_dir() else [path]
    return [each.relative_to(ROOT / PACKAGE).as_posix() for each in found if has_mutants(each.read_text())]


def known_survivors() -> dict[tuple[str, str, str], str]:
    """Return why some mutants live: by file, as a path within the package, text of the line, and change."""
    groups = tomllib.loads(SURVIVORS.read_text())["survivors"]
    return {
        (file, line, change): group["reason"]
        for group in groups
        for file, places in group["files"].items()
        for line, change in places
    }


def are_enough(num_tried: int, num_explained: int, least: float) -> bool:
    """Return whether as many mutants as wanted are noticed, or live for a known reason.

    Args:
        num_tried: mutants; of less than `FEW` it is true.
        num_explained: those that are noticed, or live for a known reason.
        least: wanted share [%].
    """
    return num_tried < FEW or num_explained >= 0.01 * least * num_tried


def _told(target: Target, line: int, change: str) -> str:
    return f"{target.file}:{line}: {change}"


def _try_all(tests: Tests, targets: Sequence[Target], arguments: argparse.Namespace) -> bool:
    """Try the mutants; return whether as many as wanted are noticed, or live for a known reason."""
    for name in tests.measure():
        print(f"{name} fails without any change, and is not used", flush=True)
    print(f"{len(tests.took)} tests, {sum(tests.took):.0f} s of CPU with their lines recorded", flush=True)
    queue = [(target, mutant) for target in targets for mutant in target.mutants]
    num_all = len(queue)
    if arguments.again:
        wanted = {line.partition("  (reached by")[0] for line in arguments.again.read_text().splitlines()}
        queue = [(target, mutant) for target, mutant in queue if _told(target, mutant.line, mutant.change) in wanted]
    random.Random(arguments.seed).shuffle(queue)  # noqa: S311 - no secret
    end = time.monotonic() + 60.0 * arguments.minutes
    tried, noticed, known = ({target.file: 0 for target in targets} for _ in range(3))
    reasons = known_survivors()
    with suppress(KeyboardInterrupt):  # print the score so far
        for target, mutant in queue[: arguments.num]:
            if time.monotonic() > end:
                break
            killer, num = tests.killer(target, mutant, arguments.budget)
            tried[target.file] += 1
            noticed[target.file] += killer is not None
            if killer is None and (target.file, target.line_of(mutant), mutant.change) in reasons:
                known[target.file] += 1
            elif killer is None:
                print(f"{_told(target, mutant.line, mutant.change)}  (reached by {num} tests)", flush=True)
            elif arguments.killers:
                print(f"noticed by {killer}: {_told(target, mutant.line, mutant.change)}", flush=True)
    for target in targets:
        num = tried[target.file]
        share = f"{noticed[target.file] / num:.1%}" if num else "-"
        told = f"noticed {noticed[target.file]} of {num} tried ({share}), {known[target.file]} live for a known reason"
        print(f"{target.file}: {told}; {len(target.mutants)} in all")
    total, num_noticed, num_known = (sum(each.values()) for each in (tried, noticed, known))
    score = f"{num_noticed / max(total, 1):.1%} of {total} tried, of {num_all}"
    print(f"score: {score}; {num_known} more live for a known reason", flush=True)
    return are_enough(total, num_noticed + num_known, arguments.least)


def main() -> int:
    """Try mutants until all are tried or the time is over."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    rooms = [room for room in TESTS if room not in APART]
    parser.add_argument("files", nargs="*", metavar="FILE", default=rooms, help=f"within {PACKAGE}/; all if none")
    parser.add_argument("--minutes", type=float, default=45.0, help="longest run (default: 45)")
    parser.add_argument("--num", type=int, default=1_000_000, metavar="N", help="only so many mutants, by the seed")
    parser.add_argument("--budget", type=float, default=10.0, metavar="S", help="CPU time of tests for a mutant [s]")
    parser.add_argument("--seed", type=int, default=0, help="of the order in which mutants are tried (default: 0)")
    parser.add_argument("--sample", type=int, metavar="N", help="only so many files, by the seed")
    parser.add_argument("--again", type=Path, metavar="LOG", help="only the survivors that an earlier run has printed")
    parser.add_argument(
        "--least", type=float, default=0.0, metavar="PERCENT", help="fail if less are noticed or known (default: 0)"
    )
    parser.add_argument("--tests", metavar="PATHS", help="only these tests, as paths within tests/ with blanks between")
    parser.add_argument("--quick", action="store_true", help="leave out the tests that are marked slow")
    parser.add_argument("--killers", action="store_true", help="print also which test has noticed a mutant")
    arguments = parser.parse_args()
    tests: dict[str, str] = {}
    for name in arguments.files:
        room = next((room for room in TESTS if name == room or name.startswith(f"{room}/")), None)
        if room is None or not (ROOT / PACKAGE / name).exists():
            parser.error(f"{name}: expected one of {', '.join(TESTS)}, or a file in one of them")
        tests.update(dict.fromkeys(files_of(name), arguments.tests or TESTS[room]))
    if arguments.sample is not None and arguments.sample < len(tests):
        chosen = random.Random(arguments.seed).sample(list(tests), arguments.sample)  # noqa: S311 - no secret
        tests = {file: tests[file] for file in chosen}
    # The digests of drives are those of a processor without AVX-512. numpy reads this when it is imported.
    if not is_without_avx_512():
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **WITHOUT_AVX_512})  # noqa: S606 - ourselves
    os.chdir(ROOT)
    targets = [Target(file) for file in tests]
    folders = sorted({folder for words in tests.values() for folder in words.split()})
    are_enough: list[bool] = []
    code = run_warm(
        targets, folders, lambda warm: are_enough.append(_try_all(warm, targets, arguments)), is_quick=arguments.quick
    )
    if are_enough == [False]:
        print(f"less than {arguments.least:g} % of the mutants are noticed, or live for a known reason", flush=True)
        return 1
    return code


if __name__ == "__main__":
    sys.exit(main())
