import assert from "node:assert/strict";
import { test } from "node:test";

import { storyChanges } from "../../../rosbridge_sim/page/js/scene/story_changes.js";

/** @param {number} time @param {[string, number]} event - state, executions @param {boolean} holds @param {string} result @returns {any} */
const message = (time, [state, executions], holds = false, result = "") => ({
  name: "cut-in",
  time,
  elements: [
    { kind: "Maneuver", name: "m", state, executions, parent: -1 },
    { kind: "Event", name: "change", state, executions, parent: 0 },
  ],
  conditions: [{ name: "near", kind: "DistanceCondition", is_looked_at: true, holds, value: 3 }],
  verdict: { result, group: "", time: -1, reason: "" },
});

test("events that begin and end, conditions that hold and the verdict are told once", () => {
  const waits = message(2, ["standby", 0]);
  const runs = message(2.2, ["running", 1], true);
  const done = message(2.4, ["complete", 1], true, "failure");
  assert.deepEqual(storyChanges(waits, runs), [{ what: "begins", name: "change" }, { what: "holds", name: "near" }]);
  assert.deepEqual(storyChanges(runs, runs), []);
  assert.deepEqual(storyChanges(runs, done), [{ what: "ends", name: "change" }, { what: "verdict", name: "failure" }]);
  assert.deepEqual(storyChanges(waits, message(2.2, ["complete", 1])), [{ what: "begins", name: "change" }, { what: "ends", name: "change" }]);
});

test("a story that is first seen in its middle has no changes, one from its start has, and so has one that begins again", () => {
  const runs = message(0.1, ["running", 1]);
  assert.deepEqual(storyChanges(null, runs), [{ what: "begins", name: "change" }]);
  assert.deepEqual(storyChanges(null, message(5, ["running", 1])), []);
  assert.deepEqual(storyChanges(message(5, ["running", 1]), runs), [{ what: "begins", name: "change" }]);
});
