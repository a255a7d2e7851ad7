import assert from "node:assert/strict";
import { test } from "node:test";

import { lightMaterial, makeLightBars } from "../../../rosbridge_sim/page/js/scene/light_bars.js";
import { LineBuffer, PIECE_FLOATS, shiftLine } from "../../../rosbridge_sim/page/js/scene/line_buffer.js";
import { laneKinds, makeMapGeometry, pointAlong } from "../../../rosbridge_sim/page/js/scene/map_geometry.js";
import { loadMap } from "../../../rosbridge_sim/page/js/scene/map_loader.js";
import { MATERIALS } from "../../../rosbridge_sim/page/js/scene/materials.js";

/** @typedef {import("../../../rosbridge_sim/page/js/scene/map_types.js").SceneMap} SceneMap */
/** @typedef {import("../../../rosbridge_sim/page/js/scene/map_types.js").MapLane} MapLane */
/** @typedef {import("../../../rosbridge_sim/page/js/scene/map_types.js").MapLight} MapLight */

/**
 * A straight lane to the east.
 * @param {string} link
 * @param {number} x
 * @param {Partial<MapLane>} [others]
 * @returns {MapLane}
 */
function lane(link, x, others = {}) {
  return {
    link, x: [x, x + 20], y: [0, 0], z: [1, 3], left: [2, 2], right: [1, 1], length: 20, width: 3, speed_limit: 10,
    successors: ["next"], left_link: "", right_link: "", light: "", ...others,
  }; // prettier-ignore
}

/**
 * @param {string} name
 * @returns {MapLight}
 */
function light(name) {
  return { name, x: 0, y: 0, z: 5, heading_deg: 0, lamps: 53, is_pedestrian: false, is_warning: false, links: [], controller: "", group: -1 };
}

/**
 * @param {Partial<SceneMap>} parts
 * @returns {SceneMap}
 */
function map(parts) {
  return {
    name: "m", digest: "d", west: 0, south: -10, east: 100, north: 10, lanes: [], borders: [], stop_lines: [], crosswalks: [],
    lights: [], controllers: [], ...parts,
  }; // prettier-ignore
}

/** @param {Float32Array} lines */
function pieces(lines) {
  return Array.from({ length: lines.length / PIECE_FLOATS }, (_, i) => [...lines.subarray(i * PIECE_FLOATS, (i + 1) * PIECE_FLOATS)]);
}

test("the surface of a lane lies between its edges, and keeps its height", () => {
  const { lanes, origin } = makeMapGeometry(map({ lanes: [lane("a", 0)] }));
  assert.deepEqual(origin, { x: 50, y: 0, z: 0 });
  assert.deepEqual([...lanes.vertices], [-50, 2, 1, 0, -50, -1, 1, 0, -30, 2, 3, 0, -30, -1, 3, 0]);
  assert.deepEqual([...lanes.indices], [0, 1, 2, 2, 1, 3]);
});

test("lanes behind a stop line or a light are inside an intersection, and lanes without a successor are dead ends", () => {
  const lanes = [lane("a", 0, { successors: ["b"] }), lane("b", 50), lane("c", 50, { light: "L" }), lane("d", 0, { successors: [] })];
  const stops = [{ link: "a", x: [50, 50], y: [1, -1], z: [0, 0] }];
  const kinds = laneKinds(map({ lanes, stop_lines: stops }));
  assert.deepEqual(kinds, [MATERIALS.lane, MATERIALS.inside, MATERIALS.inside, MATERIALS.deadEnd]);
});

test("a broken line has dashes, a yellow line is yellow, and a double line has two sides", () => {
  const line = { name: "b", x: [0, 10], y: [0, 0], z: [0, 0], type: 501 };
  const borders = [
    { ...line, shape: ["Broken"], colour: ["white"] },
    { ...line, shape: ["Solid", "Broken"], colour: ["yellow"] },
  ];
  const [white, left, right] = pieces(makeMapGeometry(map({ lanes: [lane("a", 0)], borders })).lines);
  assert.ok(white[10] > 0 && white[11] > white[10]);
  assert.equal(white[9], MATERIALS.edge);
  assert.deepEqual([left[9], right[9]], [MATERIALS.yellow, MATERIALS.yellow]);
  assert.ok(left[1] > 0 && right[1] < 0, "from left to right");
  assert.equal(left[11], 0);
  assert.ok(right[11] > 0);
});

test("a map without painted lines shows the edges of its lanes", () => {
  const bare = makeMapGeometry(map({ lanes: [lane("a", 0)] })).lines;
  assert.deepEqual(pieces(bare).map((piece) => piece[1]), [2, -1]);
});

test("a crosswalk with four corners has stripes, and another one its outline", () => {
  const part = { x: [0, 4, 4, 0], y: [0, 0, 8, 8], z: [0, 0, 0, 0] };
  const four = makeMapGeometry(map({ crosswalks: [{ name: "c", parts: [part], lights: [] }] }));
  assert.equal(four.stripes.indices.length, 8 * 6);
  const three = { x: [0, 4, 4], y: [0, 0, 8], z: [0, 0, 0] };
  const other = makeMapGeometry(map({ crosswalks: [{ name: "c", parts: [three], lights: [] }] }));
  assert.equal(other.stripes.indices.length, 0);
  assert.equal(pieces(other.lines).length, 3);
});

test("an empty map, a lane with one point and an area without corners make no mistake", () => {
  assert.equal(makeMapGeometry(map({})).lanes.indices.length, 0);
  const point = { x: [1], y: [1], z: [0] };
  const odd = makeMapGeometry(
    map({
      lanes: [lane("a", 0, { ...point, left: [1], right: [1], length: 0 })],
      crosswalks: [{ name: "c", parts: [{ x: [], y: [], z: [] }], lights: [] }],
    }),
  );
  assert.equal(odd.lanes.indices.length, 0);
});

test("a doubled point does not bend a line", () => {
  const { x, y } = shiftLine([0, 0, 10], [0, 0, 0], 1);
  assert.deepEqual([x[2], y[2]], [10, 1]);
  const buffer = new LineBuffer(1);
  buffer.addLine([0, 0, 10, 20], [0, 0, 0, 0], [0, 0, 0, 0], { width: 1, minPixels: 1, material: 0 });
  assert.deepEqual(pieces(buffer.view()).map((piece) => piece[8]), [0, 10]);
  assert.equal(pointAlong({ x: [0, 0], y: [0, 0], z: [0, 0] }, 1), null);
  assert.equal(pointAlong({ x: [0, 10], y: [0, 0], z: [0, 2] }, 5)?.z, 1);
});

test("long pieces of lines and lanes are divided, and dashes go on", () => {
  const long = lane("a", 0, { x: [0, 100], length: 100 });
  const borders = [{ name: "b", x: [0, 100], y: [0, 0], z: [0, 10], type: 503, shape: ["Broken"], colour: ["white"] }];
  const { lanes, lines } = makeMapGeometry(map({ lanes: [long], borders }));
  assert.equal(lanes.vertices.length / 8, 4);
  const found = pieces(lines);
  assert.deepEqual(found.map((piece) => Math.round(piece[8])), [0, 33, 67]);
  assert.equal(found[2][3], 50);
  assert.equal(found[2][5], 10);
});

test("lights of lanes that begin at one point share the width of the lane", () => {
  const lanes = [lane("a", 0, { light: "L" }), lane("b", 0, { light: "M" }), lane("c", 0, { light: "L" }), lane("d", 0, { light: "?" })];
  const bars = makeLightBars(map({ lanes, lights: [light("L"), light("M")] }), { x: 0, y: 0, z: 0 });
  assert.deepEqual(bars.map((bar) => bar.light), [0, 1]);
  assert.ok(bars[0].y0 > 0 && bars[1].y0 < 0);
});

test("a light has the colour of what it allows", () => {
  const states = [-1, 0, 1, 4, 16, 32, 33, 48, 5];
  const { lightDark, lightRed, lightYellow, lightGreen } = MATERIALS;
  assert.deepEqual(states.map(lightMaterial), [
    lightDark, lightDark, lightRed, lightYellow, lightGreen, lightGreen, lightGreen, lightGreen, lightYellow,
  ]); // prettier-ignore
});

test("a map that changes while its pages are read is read again", async () => {
  /** @type {[string, number][]} */
  const answers = [["old", 2], ["new", 2], ["new", 2], ["new", 2]]; // prettier-ignore
  /** @type {number[]} */
  const asked = [];
  const call = async (/** @type {string} */ _, /** @type {any} */ { page }) => {
    asked.push(page);
    const [digest, num] = /** @type {[string, number]} */ (answers.shift());
    return { ...map({ digest, lanes: [lane(`${digest}${page}`, 0)] }), num_pages: num, result: true };
  };
  const loaded = await loadMap({ call });
  assert.deepEqual(asked, [0, 1, 0, 1]);
  assert.deepEqual(loaded.lanes.map((one) => one.link), ["new0", "new1"]);
});

test("a map that never comes to rest is given up", async () => {
  let number = 0;
  const call = async () => ({ ...map({ digest: String((number += 1)) }), num_pages: 2, result: true });
  await assert.rejects(loadMap({ call }), /changes all the time/);
});
