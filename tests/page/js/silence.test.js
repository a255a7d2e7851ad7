import assert from "node:assert/strict";
import { mock, test } from "node:test";
import { SilenceWatch } from "../../../rosbridge_sim/page/js/wire/silence.js";

/** Times of the watch, in a test's own clock [ms]. */
function watched() {
  mock.timers.enable({ apis: ["setInterval", "Date"] });
  mock.method(performance, "now", () => Date.now());
  /** @type {string[]} */
  const events = [];
  const watch = new SilenceWatch(
    () => void events.push("asks"),
    (isSilent) => void events.push(isSilent ? "silent" : "heard"),
  );
  watch.start();
  return { watch, events };
}

test("an idle server is asked, and is silent if no answer comes", (context) => {
  context.after(() => mock.reset());
  const { watch, events } = watched();
  mock.timers.tick(2500);
  assert.deepEqual(events, ["asks"]);
  watch.hear();
  mock.timers.tick(2500);
  assert.deepEqual(events, ["asks", "asks"]);
  mock.timers.tick(3000);
  assert.deepEqual(events, ["asks", "asks", "silent"]);
  watch.hear();
  assert.deepEqual(events, ["asks", "asks", "silent", "heard"]);
});

test("a busy server is never asked, and a closed socket is not silent", (context) => {
  context.after(() => mock.reset());
  const { watch, events } = watched();
  for (let i = 0; i < 20; i++) {
    mock.timers.tick(1000);
    watch.hear();
  }
  assert.deepEqual(events, []);
  watch.stop();
  mock.timers.tick(60_000);
  assert.deepEqual(events, []);
});
