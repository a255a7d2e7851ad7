// The word for what the ego does, from speed, lamps, driver and the lights ahead.

import assert from "node:assert/strict";
import { test } from "node:test";

import { activityOf, isAtRedLight } from "../../../rosbridge_sim/page/js/panels/ego_activity.js";

test("each activity of an ego has one word", () => {
  for (const [speed, isBraking, driver, isRed, word] of /** @type {const} */ ([
    [5, false, "client", true, "drives"],
    [5, true, "client", true, "brakes"],
    [-1, false, "client", false, "reverses"],
    [3, false, "nobody", false, "drives"],
    [0, true, "nobody", true, "waits"],
    [0, true, "self-driving", true, "red"],
    [0.01, false, "client", true, "red"],
    [0, true, "self-driving", false, "stands"],
    [0, false, "replay", false, "stands"],
  ])) {
    assert.equal(activityOf({ speed, isBraking, driver, isAtRed: () => isRed }), word);
  }
});

test("an ego is at red at the end of a lane whose lights are red for all ways", () => {
  const lane = (/** @type {string} */ link, /** @type {string} */ light, /** @type {string[]} */ successors) => ({ link, light, successors, x: [0, 50], y: [0, 0] });
  const lanes = [lane("a", "", ["straight", "left"]), lane("straight", "S", []), lane("left", "L", []), lane("free", "", []), lane("b", "", ["straight", "free"])];
  const map = /** @type {any} */ ({ lanes, lights: [{ name: "S" }, { name: "L" }] });
  const [red, green, off] = [1, 16, -1];
  for (const [link, x, states, isRed] of /** @type {[string, number, number[], boolean][]} */ ([
    ["a", 46, [red, red], true],
    ["a", 30, [red, red], false], // in the queue, which may have other reasons
    ["a", 46, [green, red], false], // which way it goes is not known
    ["a", 46, [off, red], false],
    ["b", 46, [red, red], false], // the way to the right has no light
    ["free", 46, [red, red], false],
    ["", 46, [red, red], false],
  ])) {
    assert.equal(isAtRedLight({ x, y: 1 }, link, map, states), isRed, `${link} ${x} ${states}`);
  }
});
