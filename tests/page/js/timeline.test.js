import assert from "node:assert/strict";
import { test } from "node:test";

import { kindOfWay, Timeline, TIMELINE_BYTES } from "../../../rosbridge_sim/page/js/scene/timeline.js";

/** @param {number} frame @param {object} [others] @returns {any} */
const view = (frame, others = {}) => ({ frame, map_digest: "m", scenario: "town", x: new Float32Array(100), ...others });

/** @param {number} num @param {number} [step] - frames */
function timelineOf(num, step = 5) {
  const timeline = new Timeline();
  for (let i = 0; i < num; i += 1) {
    timeline.add(view(i * step), i * step * 0.02);
  }
  return timeline;
}

test("two minutes are kept, and marks of that time", () => {
  const timeline = timelineOf(1000);
  timeline.mark("lane", "a, b");
  assert.equal(timeline.moments.length, 1000);
  timeline.mark("red", "light", 5);
  assert.deepEqual(timeline.marks.map(({ kind }) => kind), ["red", "lane"]);
  for (let i = 1000; i < 1260; i += 1) {
    timeline.add(view(5 * i), 0.1 * i);
  }
  assert.ok(Math.abs(timeline.end - timeline.start - 120) < 0.2);
  assert.deepEqual(timeline.marks.map(({ kind }) => kind), ["lane"]);
  assert.equal(timeline.bytes, timeline.moments.length * 1400);
});

test("a large crowd is kept for a shorter time, within the bytes", () => {
  const timeline = new Timeline();
  for (let i = 0; i < 100; i += 1) {
    timeline.add(view(i, { y: new Float32Array(200_000) }), 0.02 * i);
  }
  assert.ok(timeline.bytes <= TIMELINE_BYTES && timeline.bytes > 0.9 * TIMELINE_BYTES);
  assert.equal(timeline.end, 0.02 * 99);
});

test("what has not happened is forgotten: after a snapshot, and with another scene", () => {
  const timeline = timelineOf(100);
  timeline.mark("collision", "a, b", 9);
  timeline.mark("collision", "a, b", 2);
  timeline.add(view(200), 4);
  assert.deepEqual([timeline.moments.length, timeline.end, timeline.marks.length], [41, 4, 1]);
  timeline.add(view(900, { scenario: "loop" }), 18);
  assert.deepEqual([timeline.moments.length, timeline.marks.length, timeline.bytes], [1, 0, 1400]);
});

test("a moment is found by its time", () => {
  const timeline = timelineOf(10);
  assert.deepEqual([-1, 0, 0.19, 0.2, 99].map((time) => timeline.at(time)?.frame), [0, 0, 5, 10, 45]);
  assert.equal(new Timeline().at(1), undefined);
});

test("a way to the lane beside is a lane change, and one into a crossing at red is told", () => {
  const before = { link: "a", successors: ["b", "c"], left_link: "l", right_link: "" };
  const way = (/** @type {string} */ link, isRed = false, light = "") => kindOfWay(before, { link, light }, isRed);
  assert.deepEqual([way("b"), way("l"), way("x"), way("b", true), way("b", true, "L1"), way("b", false, "L1")], [null, "lane", null, null, "red", null]);
});
