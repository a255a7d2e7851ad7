"""TypeScript declarations: what they say of each kind of field, and that the compiler of TypeScript accepts them."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.store import Store
from rosbridge_sim.schema.typescript import declare_package
from rosbridge_sim.shell.files.definitions import read_definitions
from tests.support import ROOT, require_tool

TEXTS = {
    ("p", "msg", "T"): (
        "# A thing.\n# Two lines.\n\nuint8 RED = 1  # a colour\n"
        "uint8[] raw  # its bytes\nint64 count\nbool[] flags\nstring name  # */ ends no comment\n"
        "time stamp\nU[2] parts\nq/V other\n"
    ),
    ("p", "msg", "U"): "float64 x  # [m]\n",
    ("p", "srv", "Ask"): "U what\n---\nbool is_there  # it is\n",
    ("p", "action", "Go"): "float64 far\n---\n---\nfloat64 left\n",
    ("q", "msg", "V"): "U own\n",
    ("q", "msg", "U"): "duration time\n",
    ("q", "msg", "Unused"): "",
}

DECLARED = """\
// Messages of p as they arrive in JSON over rosbridge, in the forms of ROS 2.
// NaN and infinity arrive as null. Fields may be left out of what is sent; they are 0, false or empty then.

export namespace p {
  export interface AskRequest {
    what: U;
  }

  export interface AskResponse {
    /** it is */
    is_there: boolean;
  }

  export interface GoFeedback {
    left: number;
  }

  export interface GoGoal {
    far: number;
  }

  export interface GoResult {
  }

  /**
   * A thing. Two lines.
   * RED = 1
   */
  export interface T {
    /**
     * its bytes
     * bytes: base64; a Uint8Array with compression 'cbor'
     */
    raw: string;
    /** 64 bit: rounded beyond 2^53 */
    count: number;
    flags: boolean[];
    /** * / ends no comment */
    name: string;
    stamp: { sec: number; nanosec: number };
    parts: U[];
    other: q.V;
  }

  export interface U {
    /** [m] */
    x: number;
  }
}

export namespace q {
  export interface U {
    time: { sec: number; nanosec: number };
  }

  export interface V {
    own: U;
  }
}
"""

PROGRAM = """\
import type { morai_msgs } from "./morai_msgs";

export const command: Partial<morai_msgs.CtrlCmd> = { longlCmdType: 2, velocity: 30 };
export const speed = (ego: morai_msgs.EgoVehicleStatus): number => ego.velocity.x;
export const stamp = (ego: morai_msgs.EgoVehicleStatus): number => ego.header.stamp.PART;
"""


def test_each_kind_of_field_has_its_type_and_its_comment() -> None:
    assert declare_package(Store(TEXTS, ros=2), "p") == DECLARED


def test_unknown_type_in_a_definition_is_told() -> None:
    with pytest.raises(TypeNameError, match=r"p/Nothing: package p has no such message"):
        declare_package(Store({("p", "msg", "T"): "p/Nothing field"}), "p")


@pytest.mark.slow
@pytest.mark.parametrize(("release", "ros", "part"), [("22.R2", 1, "secs"), ("26.R1", 2, "sec")])
def test_compiler_of_typescript_accepts_all_packages(release: str, ros: Generation, part: str, tmp_path: Path) -> None:
    store = Store(read_definitions(release), leniency=LENIENCY, ros=ros)
    for package in store.packages():
        (tmp_path / f"{package}.d.ts").write_text(declare_package(store, package))
    (tmp_path / "program.ts").write_text(PROGRAM.replace("PART", part))
    compiler = ROOT / "tests" / "page" / "node_modules" / "typescript" / "bin" / "tsc"
    words = [
        require_tool("node"),
        str(compiler),
        "--noEmit",
        "--strict",
        "--lib",
        "es2020",
        *map(str, sorted(tmp_path.iterdir())),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")
