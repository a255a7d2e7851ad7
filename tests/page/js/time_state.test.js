import assert from "node:assert/strict";
import { test } from "node:test";

import { isLedByOthers, masterName, timeReasons, timeStateOf } from "../../../rosbridge_sim/page/js/panels/time_state.js";

const TEXTS = {
  notConnected: "not connected",
  moving: "moving",
  otherMaster: (/** @type {string} */ name) => `${name} is the master`,
  alreadyPaused: "is paused",
  alreadyRuns: "runs",
  syncStands: "stands",
  alreadyMaster: "is master",
  notMaster: "is not master",
  replaying: "replays",
  noFactorInSync: "no factor",
};
const OPEN = { isOpen: true, isMoving: false };
const PROCESS = { current_mode: 1, current_status: 1 };
const FREE = { master_id: "", status: false, frame: 7, can_send_tick: false };

function stateOf(changes = {}) {
  return timeStateOf({ sync: FREE, process: PROCESS, barrier: null, userId: "page", ...OPEN, ...changes });
}

test("nothing is possible before the first message", () => {
  const reasons = timeReasons(stateOf({ sync: null, process: null }), OPEN, TEXTS);
  assert.deepEqual(new Set(Object.values(reasons)), new Set(["not connected"]));
});

test("real time may be paused, not run again", () => {
  const reasons = timeReasons(stateOf(), OPEN, TEXTS);
  assert.deepEqual([reasons.pause, reasons.run, reasons.step, reasons.leave], ["", "runs", "", "is not master"]);
});

test("a paused world may run and step", () => {
  const state = stateOf({ process: { current_mode: 1, current_status: 16 } });
  const reasons = timeReasons(state, OPEN, TEXTS);
  assert.equal(state.kind, "paused");
  assert.deepEqual([reasons.pause, reasons.run, reasons.step], ["is paused", "", ""]);
});

test("another master is respected and named", () => {
  const state = stateOf({ sync: { ...FREE, master_id: "planner", status: true } });
  const reasons = timeReasons(state, OPEN, TEXTS);
  assert.ok(isLedByOthers(state));
  for (const name of /** @type {const} */ (["step", "take", "run", "restore", "reset", "load", "drive"])) {
    assert.equal(reasons[name], "planner is the master", name);
  }
  assert.equal(reasons.pause, "", "a pause holds the master's ticks");
});

test("the members of a barrier are the masters", () => {
  const barrier = { members: ["planner", "referee"], time_step: 20, waited_for: [] };
  const state = stateOf({ sync: { ...FREE, master_id: "/sim/barrier", status: true }, barrier });
  assert.equal(masterName(state), "planner, referee");
});

test("the page as master may step, drive and leave", () => {
  const reasons = timeReasons(stateOf({ sync: { ...FREE, master_id: "page", status: true } }), OPEN, TEXTS);
  assert.deepEqual([reasons.step, reasons.drive, reasons.leave, reasons.run], ["", "", "", ""]);
  assert.deepEqual([reasons.pause, reasons.take, reasons.factor], ["stands", "is master", "no factor"]);
});

test("a world that waits for its first master may be taken", () => {
  const state = stateOf({ sync: { ...FREE, status: true } });
  assert.equal(isLedByOthers(state), false);
  assert.equal(timeReasons(state, OPEN, TEXTS).take, "");
});

test("nobody drives a replayed ego", () => {
  const state = stateOf({ process: { current_mode: 16, current_status: 1 } });
  assert.equal(timeReasons(state, OPEN, TEXTS).drive, "replays");
});
