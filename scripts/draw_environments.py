#!/usr/bin/env python3
"""Draw docs/images/env_NAME.png: each environment from above, after some seconds of driving by a rule.

python scripts/draw_environments.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium
import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
sys.path.insert(0, str(ROOT / "scripts" / "examples"))

from drive_environments import ParkByRule, by_rule  # noqa: E402

from rosbridge_sim.environments.registration import TASKS, register_all  # noqa: E402

SEED, SECONDS = 1, 4.0
SIZE = (450, 300)


def main() -> None:
    """Draw all pictures."""
    register_all()
    for name, task in TASKS.items():
        many = gymnasium.make_vec(
            name,
            num_envs=1,
            vectorization_mode="vector_entry_point",
            autoreset_mode="Disabled",
            render_mode="rgb_array",
        )
        park = ParkByRule(1)
        seen, _ = many.reset(seed=SEED)
        for _ in range(round(SECONDS * 10.0)):
            seen, *_ = many.step(park(seen) if task.goal == "bay" else by_rule(seen, task))
        whole = Image.fromarray(np.asarray(many.render()[0])).resize(SIZE, Image.Resampling.LANCZOS)
        picture = whole.quantize(64, method=Image.Quantize.MAXCOVERAGE)  # by median cuts a small ego turns blue
        path = ROOT / "docs" / "images" / f"env_{name.partition('/')[2][:-3].lower()}.png"
        picture.save(path, optimize=True)
        print(path.name, path.stat().st_size)


if __name__ == "__main__":
    main()
