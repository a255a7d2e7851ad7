import assert from "node:assert/strict";
import { test } from "node:test";

import { addVelocities, meetingsOf, timeToCollision } from "../../../rosbridge_sim/page/js/drawing/motion_marks.js";
import { LineBuffer } from "../../../rosbridge_sim/page/js/scene/line_buffer.js";

/** Cars of 4 x 2 m around their reference points. @param {{x: number, y: number, heading?: number, speed?: number, z?: number}[]} cars @returns {any} */
function stateOf(cars) {
  const column = (/** @type {"x" | "y" | "z" | "heading" | "speed"} */ name) => cars.map((car) => car[name] ?? 0);
  const all = (/** @type {number} */ value) => cars.map(() => value);
  return { x: column("x"), y: column("y"), z: column("z"), heading: column("heading"), speed: column("speed"), length: all(4), width: all(2), center_x: all(0) };
}

test("the time to a collision is that of the nearest edges", () => {
  const time = (/** @type {any} */ other, speed = 10) => {
    const state = stateOf([{ x: 0, y: 0, speed }, other]);
    return timeToCollision(state, state, 0, 1);
  };
  assert.equal(time({ x: 24, y: 0 }), 2); // 20 m of room at 10 m/s
  assert.equal(time({ x: 24, y: 0, speed: 10 }), Infinity);
  assert.equal(time({ x: 24, y: 0, heading: Math.PI, speed: 10 }), 1);
  assert.equal(time({ x: 24, y: 2.1 }), Infinity); // beside it
  assert.equal(time({ x: -24, y: 0 }), Infinity); // behind it
  assert.equal(time({ x: 3, y: 0 }), 0);
  const crossing = time({ x: 20, y: -20, heading: Math.PI / 2, speed: 10 });
  assert.ok(Math.abs(crossing - 1.7) < 1e-9, String(crossing)); // both have 17 m to the other's side
});

test("of those that would be met, the next ones are told, and none on a bridge", () => {
  const state = stateOf([{ x: 0, y: 0, speed: 10 }, { x: 44, y: 0 }, { x: 24, y: 0 }, { x: 24, y: 0, z: 6 }, { x: 200, y: 0 }]); // prettier-ignore
  assert.deepEqual(meetingsOf(state, state, 0), [{ other: 2, time: 2 }, { other: 1, time: 4 }]); // prettier-ignore
  assert.deepEqual(meetingsOf(state, state, -1), []);
});

test("a vector has the length of a second, and none is drawn for what stands or has the camera", () => {
  const state = stateOf([{ x: 0, y: 0, speed: 10 }, { x: 50, y: 0, speed: -4 }, { x: 90, y: 0 }]);
  const lines = new LineBuffer();
  addVelocities(lines, state, state, { x: 0, y: 0, z: 0 }, -1);
  assert.equal(lines.length, 6);
  assert.deepEqual([lines.view()[0], lines.view()[3], lines.view()[36], lines.view()[39]], [2, 12, 48, 44]);
  lines.clear();
  addVelocities(lines, state, state, { x: 0, y: 0, z: 0 }, 0);
  assert.equal(lines.length, 3);
});
