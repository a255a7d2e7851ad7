// The real-time factor that the page shows is measured against its own clock.

import assert from "node:assert/strict";
import { test } from "node:test";

import { FrameRate } from "../../../rosbridge_sim/page/js/panels/frame_rate.js";

/** @param {number} perSecond @param {number} seconds @param {FrameRate} [rate] @param {number} [start] [ms] */
function run(perSecond, seconds, rate = new FrameRate(), start = 0) {
  for (let at = 0; at <= seconds * 1000; at += 200) {
    rate.add(start + at, Math.floor((perSecond * at) / 1000));
  }
  return rate;
}

test("frames are counted over two seconds, whatever factor was set", () => {
  assert.equal(run(12.5, 10).at(10_000), 12.5);
  assert.ok(Math.abs((run(6, 10).at(10_100) ?? 0) - 6) < 0.5);
});

test("nothing is said before half a second, and a world that stands is told within two seconds", () => {
  assert.equal(new FrameRate().at(0), null);
  assert.equal(run(50, 0.2).at(200), null);
  assert.equal(run(50, 0.6).at(600), 50);
  const rate = run(50, 4);
  assert.ok((rate.at(5000) ?? 0) < 30);
  assert.equal(rate.at(6000), 0);
  assert.equal(run(0, 0).at(600), 0, "a world that stands sends one message");
});

test("a world that has gone back to an earlier frame is measured anew", () => {
  const rate = run(50, 4);
  rate.add(4100, 0);
  assert.equal(rate.at(4200), null);
  assert.equal(run(50, 1, rate, 4200).at(5200), 1000 * 50 / 1100);
});
