import assert from "node:assert/strict";
import { test } from "node:test";

import {
  inputOfGamepad,
  inputOfKeys,
  inputOfPads,
  isDrivingKey,
  mergeInputs,
  NO_INPUT,
  PedalControls,
  steerLimitAt,
} from "../../../rosbridge_sim/page/js/panels/driving_model.js";

const CAR = { speed: 0, steerLimit: 0.6 };

/**
 * Hold an input for a time, in steps of a thirtieth of a second.
 * @param {PedalControls} controls
 * @param {import("../../../rosbridge_sim/page/js/panels/driving_model.js").DriverInput} input
 * @param {number} seconds
 */
function hold(controls, input, seconds, car = CAR) {
  for (let step = 0; step < Math.round(seconds * 30); step += 1) {
    controls.update(input, 1 / 30, car);
  }
  return controls.command();
}

test("arrows and WASD are the same controls", () => {
  assert.deepEqual(inputOfKeys(["ArrowUp", "ArrowLeft"]), inputOfKeys(["KeyW", "KeyA"]));
  assert.deepEqual(inputOfKeys(["ArrowDown", "ArrowRight"]), inputOfKeys(["KeyS", "KeyD"]));
  assert.ok(isDrivingKey("Space") && !isDrivingKey("KeyQ") && !isDrivingKey("toString"));
});

test("opposite keys and unknown keys do nothing", () => {
  assert.equal(inputOfKeys(["KeyA", "KeyD", "constructor"]).steer, 0);
});

test("throttle and brake together are a brake", () => {
  assert.deepEqual(inputOfKeys(["KeyW", "KeyS"]), { throttle: 0, brake: 1, steer: 0, isAnalog: false });
});

test("the throttle follows a key smoothly and is up at once when the key is let go", () => {
  const controls = new PedalControls();
  const tapped = hold(controls, inputOfKeys(["KeyW"]), 0.2).accel;
  assert.ok(tapped > 0.1 && tapped < 0.5, String(tapped));
  assert.equal(hold(controls, inputOfKeys(["KeyW"]), 1).accel, 1);
  assert.equal(controls.update(NO_INPUT, 1 / 30, CAR).accel, 0);
});

test("the wheels turn less at speed, and left is positive", () => {
  const slow = hold(new PedalControls(), inputOfKeys(["KeyA"]), 3);
  const fast = hold(new PedalControls(), inputOfKeys(["KeyA"]), 3, { speed: 25, steerLimit: 0.6 });
  assert.equal(slow.steering, 0.6);
  assert.ok(fast.steering > 0 && fast.steering < 0.05, String(fast.steering));
  const reverse = hold(new PedalControls(), inputOfKeys(["KeyD"]), 3, { speed: -25, steerLimit: 0.6 });
  assert.equal(reverse.steering, -fast.steering);
});

test("the limit at speed keeps the sideways acceleration comfortable", () => {
  for (const speed of [5, 10, 20, 40]) {
    const angle = steerLimitAt(speed, 0.6);
    assert.ok((speed * speed * Math.tan(angle)) / 2.8 <= 4 + 1e-9);
  }
});

test("wheels return to the middle and the controls come to rest", () => {
  const controls = new PedalControls();
  hold(controls, inputOfKeys(["KeyA"]), 1);
  assert.equal(controls.isAtRest, false);
  hold(controls, NO_INPUT, 1);
  assert.equal(controls.isAtRest, true);
});

test("release lifts everything at once", () => {
  const controls = new PedalControls();
  hold(controls, inputOfKeys(["KeyW", "KeyA"]), 1);
  assert.deepEqual(controls.release(), { accel: 0, brake: 0, steering: 0 });
});

test("a worn stick at rest does nothing, and a full one is full", () => {
  const buttons = Array.from({ length: 17 }, () => ({ value: 0 }));
  assert.deepEqual(inputOfGamepad({ axes: [0.05, 0], buttons }), { ...NO_INPUT, isAnalog: true });
  buttons[7] = { value: 1 };
  assert.deepEqual(inputOfGamepad({ axes: [-1, 0], buttons }), { throttle: 1, brake: 0, steer: 1, isAnalog: true });
  assert.deepEqual(inputOfGamepad({ axes: [], buttons: [] }), { ...NO_INPUT, isAnalog: true });
});

test("the right touch pad is throttle upwards and brake downwards", () => {
  assert.equal(inputOfPads({ steer: 0, pedal: 1 }).throttle, 1);
  assert.equal(inputOfPads({ steer: 0, pedal: -1 }).brake, 1);
  assert.equal(inputOfPads({ steer: 3, pedal: 0 }).steer, 1);
});

test("the strongest wish of several inputs counts", () => {
  const merged = mergeInputs([inputOfKeys(["KeyW"]), inputOfPads({ steer: -0.5, pedal: 0 })]);
  assert.equal(merged.throttle, 1);
  assert.ok(merged.steer < 0 && merged.isAnalog);
  assert.deepEqual(mergeInputs([]), NO_INPUT);
});
