import assert from "node:assert/strict";
import { test } from "node:test";

import { nameOfClient } from "../../../rosbridge_sim/page/js/panels/drivers_watch.js";
import { isLedByOthers, paceText, timeReasons, timeStateOf, timeStateText } from "../../../rosbridge_sim/page/js/panels/time_state.js";
import { TEXTS as PAGE_TEXTS } from "../../../rosbridge_sim/page/js/texts.js";

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
  return timeStateOf({ sync: FREE, process: PROCESS, drivers: null, userId: "page", ...OPEN, ...changes }, PAGE_TEXTS.clientNames);
}

function driversOf(/** @type {string} */ master, /** @type {string[]} */ addresses) {
  return { master, master_clients: addresses, barrier_members: [], time_step: 100, real_time_factor: 1, egos: [] };
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
  const drivers = { ...driversOf("/sim/barrier", ["10.0.0.1:7", "10.0.0.2:7"]), barrier_members: ["planner", "referee"] };
  assert.equal(stateOf({ sync: { ...FREE, master_id: "/sim/barrier", status: true }, drivers }).master, "planner, referee");
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

test("the state says how fast the world moves, as it was measured, and where it stands", () => {
  const sync = { ...FREE, master_id: "planner", status: true };
  const replay = { current_mode: 16, current_status: 1 };
  const pause = { current_mode: 1, current_status: 16 };
  for (const [changes, factor, text] of /** @type {[object, number | null, string][]} */ ([
    [{}, 0.2496, "Running 0.25 ×"],
    [{}, 1.012, "Running 1.0 ×"],
    [{}, 20.3, "Running 20 ×"],
    [{}, 0, "Running 0.00 ×"],
    [{}, null, "Running – ×"],
    [{ process: pause }, 0.4, "Paused "],
    [{ process: replay }, 2, "Replay 2.0 ×"],
    [{ sync }, 0.5, "Synchronous 0.50 ×"],
    [{ sync }, 0, "Synchronous stands"],
    [{ sync, process: pause }, 0.5, "Synchronous, paused "],
  ])) {
    const state = stateOf(changes);
    assert.equal(`${timeStateText(state, PAGE_TEXTS.time.states)} ${paceText(state, factor, PAGE_TEXTS.time)}`, text);
  }
});

test("a client has one name, as the master and as a driver", () => {
  const own = "10.0.0.9:1";
  const names = PAGE_TEXTS.clientNames;
  for (const [master, name] of /** @type {const} */ ([["page-1a", "another page (10.0.0.1:7)"], ["planner", "planner (10.0.0.1:7)"]])) {
    const drivers = driversOf(master, ["10.0.0.1:7"]);
    const state = stateOf({ sync: { ...FREE, master_id: master, status: true }, drivers });
    assert.deepEqual([state.master, nameOfClient("10.0.0.1:7", own, drivers, names)], [name, name]);
    assert.equal(state.timeStep, 100);
    assert.deepEqual(["10.0.0.2:7", own].map((one) => nameOfClient(one, own, drivers, names)), ["client 10.0.0.2:7", "this page"]);
  }
});
