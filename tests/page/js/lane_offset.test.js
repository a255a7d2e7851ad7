import assert from "node:assert/strict";
import { test } from "node:test";

import { LaneIndex } from "../../../rosbridge_sim/page/js/panels/lane_offset.js";

/**
 * A straight lane.
 * @param {string} link
 * @param {[number, number]} from
 * @param {[number, number]} to
 */
function lane(link, [x0, y0], [x1, y1]) {
  return { link, x: [x0, x1], y: [y0, y1], left: [1.75, 1.75], right: [1.75, 1.75] };
}

const EAST = lane("east", [0, 0], [1000, 0]);
const WEST = lane("west", [1000, 3.5], [0, 3.5]);

test("left of the lane's line is positive", () => {
  const index = new LaneIndex([EAST, WEST]);
  const left = index.nearest(500, 1, 0);
  assert.equal(left?.link, "east");
  assert.ok(Math.abs((left?.lateral ?? 0) - 1) < 1e-9);
  assert.equal(index.nearest(500, -1.2, 0)?.lateral.toFixed(3), "-1.200");
});

test("the lane of the own direction counts where two overlap", () => {
  const index = new LaneIndex([EAST, lane("back", [1000, 0], [0, 0])]);
  assert.equal(index.nearest(20, 0.1, 0)?.link, "east");
  assert.equal(index.nearest(20, 0.1, Math.PI)?.link, "back");
});

test("beside the road there is no lane", () => {
  const index = new LaneIndex([EAST, WEST]);
  assert.equal(index.nearest(500, 30, 0), null);
  assert.equal(index.nearest(500, -4, 0), null);
  assert.equal(new LaneIndex([]).nearest(0, 0, 0), null);
});

test("the direction of the lane is known, and a doubled point does no harm", () => {
  const index = new LaneIndex([{ link: "a", x: [0, 0, 0], y: [0, 0, 10], left: [2, 2, 2], right: [2, 2, 2] }]);
  assert.equal(index.nearest(0.5, 5, 1)?.heading, Math.PI / 2);
});
