import assert from "node:assert/strict";
import { test } from "node:test";

import { inputOfKeys } from "../../../rosbridge_sim/page/js/panels/driving_model.js";
import { COMMAND_INTERVAL, DrivingSession } from "../../../rosbridge_sim/page/js/panels/driving_session.js";

/** A page around a session: its clock, its car, and what it has sent. */
function makeDrive({ isInSteps = false } = {}) {
  /** @type {any[]} */
  const sent = [];
  /** @type {any[]} */
  const called = [];
  const page = { now: 0, isInSteps, sent, called };
  const session = new DrivingSession({
    send: (operation) => sent.push(operation),
    callInSteps: (operation) => called.push(operation),
    now: () => page.now,
    car: () => ({ ego: 2, speed: 0, steerLimit: 0.6 }),
    isInSteps: () => page.isInSteps,
  });
  const run = (/** @type {number} */ updates) => {
    for (let update = 0; update < updates; update += 1) {
      page.now += COMMAND_INTERVAL;
      session.update();
    }
  };
  return { page, session, run, sent };
}

test("nothing is sent before the drive begins, and nothing without a key", () => {
  const { session, run, sent } = makeDrive();
  session.setInput("keys", inputOfKeys(["KeyW"]));
  run(10);
  session.lift();
  session.begin();
  run(10);
  assert.deepEqual(sent, []);
});

test("a held key is sent thirty times a second, to the topic of the ego", () => {
  const { session, run, sent } = makeDrive();
  session.begin();
  session.setInput("keys", inputOfKeys(["KeyW"]));
  run(30);
  assert.equal(sent.length, 30);
  assert.equal(sent[0].name, "/Ego-2/ctrl_cmd");
  assert.ok(sent[29].values.accel > 0.99);
});

test("letting go lifts the pedals at once, straightens the wheels, and then is silent", () => {
  const { session, run, sent } = makeDrive();
  session.begin();
  session.setInput("keys", inputOfKeys(["KeyW", "KeyA"]));
  run(15);
  sent.length = 0;
  session.setInput("keys", inputOfKeys([]));
  run(60);
  assert.equal(sent[0].values.accel, 0);
  assert.deepEqual(sent.at(-1).values, { longlCmdType: 1, accel: 0, brake: 0, steering: 0 });
  assert.ok(sent.length < 30, `${sent.length} commands`);
});

test("the end of a drive lifts the pedals with its last command", () => {
  const { session, run, sent } = makeDrive();
  session.begin();
  session.setInput("keys", inputOfKeys(["KeyW"]));
  run(15);
  session.end();
  const num = sent.length;
  assert.deepEqual(sent.at(-1).values, { longlCmdType: 1, accel: 0, brake: 0, steering: 0 });
  session.end();
  run(10);
  assert.equal(sent.length, num);
});

test("in steps nothing is published, and a step takes the keys along", () => {
  const { session, run, sent } = makeDrive({ isInSteps: true });
  assert.equal(session.commandForStep(0.1), null);
  session.begin();
  session.setInput("keys", inputOfKeys(["KeyW"]));
  run(30);
  assert.deepEqual(sent, []);
  assert.deepEqual(session.commandForStep(0.4), { ego: 2, command: { accel: 0.5, brake: 0, steering: 0 } });
});

test("the end of a drive in steps lifts the pedals that the last step has pressed", () => {
  for (const letGo of ["end", "lift"]) {
    const { page, session } = makeDrive({ isInSteps: true });
    session.begin();
    session.setInput("keys", inputOfKeys(["KeyW"]));
    session.commandForStep(0.4);
    session[/** @type {"end"} */ (letGo)]();
    assert.deepEqual(page.called[0]?.values.request.command, { longlCmdType: 1, accel: 0, brake: 0, steering: 0 });
    session.end();
    assert.deepEqual([page.called.length, page.sent.length], [1, 0]);
  }
});

test("keys that are let go in steps lift the pedals when time runs again", () => {
  const { page, session, run, sent } = makeDrive({ isInSteps: true });
  session.begin();
  session.setInput("keys", inputOfKeys(["KeyW"]));
  session.commandForStep(0.4);
  session.setInput("keys", inputOfKeys([]));
  page.isInSteps = false;
  run(1);
  assert.equal(sent[0]?.values.accel, 0);
});

test("a page that slept does not press the pedals for the time it slept", () => {
  const { page, session, run, sent } = makeDrive();
  session.begin();
  session.setInput("keys", inputOfKeys(["KeyW"]));
  page.now += 60_000;
  run(1);
  assert.ok(sent[0].values.accel < 0.2);
});
