import assert from "node:assert/strict";
import { test } from "node:test";

import { compose, DRAWN_TYPES, IDENTITY, keepMarkers, matrixAt, matrixOf, MOST_DRAWN, Sketch } from "../../../rosbridge_sim/page/js/scene/drawn_messages.js";
import { packedColour } from "../../../rosbridge_sim/page/js/scene/materials.js";

const ORIGIN = { x: 100, y: 0, z: 0 };
const NO_TURN = { x: 0, y: 0, z: 0, w: 1 };
const QUARTER = { x: 0, y: 0, z: Math.SQRT1_2, w: Math.SQRT1_2 };

/**
 * @param {string} type
 * @param {any} message
 * @param {import("../../../rosbridge_sim/page/js/scene/drawn_messages.js").Matrix} matrix - of its frame
 */
function drawn(type, message, matrix = IDENTITY) {
  const sketch = new Sketch(ORIGIN, -5);
  sketch.matrix = matrix;
  DRAWN_TYPES.get(type)?.(sketch, message);
  return sketch;
}

/** @param {Sketch} sketch */
function ends(sketch) {
  const values = sketch.lines.view();
  return Array.from({ length: sketch.lines.length }, (_, i) => [...values.subarray(12 * i, 12 * i + 6)].map((value) => Math.round(100 * value) / 100));
}

/** @param {object} change */
function marker(change) {
  return { ns: "", id: 0, type: 4, action: 0, pose: { position: { x: 0, y: 0, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 0 } },
    scale: { x: 0.2, y: 1, z: 1 }, color: { r: 1, g: 0, b: 0, a: 1 }, points: [], colors: [], text: "", ...change }; // prettier-ignore
}

test("a path is a line in the map, whose frame turns and moves it", () => {
  const poses = [0, 3].map((x) => ({ pose: { position: { x, y: 0, z: 0 }, orientation: NO_TURN } }));
  assert.deepEqual(ends(drawn("nav_msgs/Path", { poses })), [[-100, 0, 0, -97, 0, 0]]);
  const frame = matrixOf({ x: 110, y: 5, z: 1 }, QUARTER);
  assert.deepEqual(ends(drawn("nav_msgs/Path", { poses }, frame)), [[10, 5, 1, 10, 8, 1]]);
});

test("matrices act one after the other, and a quaternion of zeros is no turn", () => {
  const both = compose(matrixOf({ x: 1, y: 0, z: 0 }, QUARTER), matrixOf({ x: 2, y: 0, z: 0 }, { x: 0, y: 0, z: 0, w: 0 }));
  assert.deepEqual([...both].slice(9).map(Math.round), [1, 2, 0]);
});

test("a line breaks where a point is not finite, and ends at the limit", () => {
  const poses = [0, 1, NaN, 3, 4].map((x) => ({ pose: { position: { x, y: 0, z: 0 }, orientation: NO_TURN } }));
  assert.equal(drawn("nav_msgs/Path", { poses }).lines.length, 2);
  const many = Array.from({ length: MOST_DRAWN.pieces + 5 }, (_, x) => ({ pose: { position: { x, y: 0, z: 0 }, orientation: NO_TURN } }));
  const sketch = drawn("nav_msgs/Path", { poses: many });
  assert.equal(sketch.lines.length, MOST_DRAWN.pieces);
  assert.ok(sketch.isCut);
});

test("markers keep their colour, or take that of the topic", () => {
  const points = [{ x: 0, y: 0, z: 0 }, { x: 1, y: 0, z: 0 }]; // prettier-ignore
  const own = drawn("visualization_msgs/Marker", marker({ points }));
  assert.equal(own.lines.view()[9], packedColour(1, 0, 0, 1));
  const none = drawn("visualization_msgs/Marker", marker({ points, color: { r: 0, g: 0, b: 0, a: 0 } }));
  assert.equal(none.lines.view()[9], -5);
  assert.equal(drawn("visualization_msgs/Marker", marker({ type: 1 })).lines.length, 12);
  assert.equal(drawn("visualization_msgs/Marker", marker({ type: 7, points })).points.length, 12);
  assert.deepEqual(drawn("visualization_msgs/Marker", marker({ type: 9, text: "stop" })).texts, [{ x: 0, y: 0, z: 0, text: "stop" }]);
  assert.ok(drawn("visualization_msgs/Marker", marker({ type: 10 })).isCut);
});

test("markers are kept by name until they are removed", () => {
  /** @type {Map<string, any>} */
  const kept = new Map();
  const take = (/** @type {any} */ message) => keepMarkers(kept, message, (one) => one);
  take({ markers: [marker({ id: 1 }), marker({ id: 2 })] });
  take(marker({ id: 2, type: 9 }));
  assert.equal(kept.size, 2);
  assert.equal(kept.get(" 2").type, 9);
  take(marker({ id: 1, action: 2 }));
  assert.equal(kept.size, 1);
  take({ markers: Array.from({ length: MOST_DRAWN.markers + 9 }, (_, id) => marker({ id })) });
  assert.equal(kept.size, MOST_DRAWN.markers);
  take(marker({ action: 3 }));
  assert.equal(kept.size, 0);
});

test("a scan and a cloud are points; a cloud that lies about its size is cut", () => {
  const scan = { angle_min: 0, angle_increment: Math.PI / 2, range_min: 0.1, range_max: 10, ranges: [2, 20, NaN, 4] };
  const points = drawn("sensor_msgs/LaserScan", scan).points.map((value) => Math.round(value * 10) / 10);
  assert.deepEqual([points.slice(0, 3), points.slice(6, 9)], [[-98, 0, 0], [-100, -4, 0]]); // prettier-ignore
  const data = new Uint8Array(new Float32Array([1, 2, 3, 4, 5, 6]).buffer);
  const fields = ["x", "y", "z"].map((name, i) => ({ name, offset: 4 * i, datatype: 7, count: 1 }));
  const cloud = { width: 2, height: 1, fields, is_bigendian: false, point_step: 12, row_step: 24, data };
  assert.deepEqual(drawn("sensor_msgs/PointCloud2", cloud).points.slice(6, 9), [-96, 5, 6]);
  const longer = drawn("sensor_msgs/PointCloud2", { ...cloud, width: 1000 });
  assert.deepEqual([longer.points.length, longer.isCut], [12, true]);
  const beyond = { ...cloud, fields: fields.map((field) => ({ ...field, offset: field.offset + 9 })) };
  assert.equal(drawn("sensor_msgs/PointCloud2", beyond).points.length, 0);
});

test("the points of a lidar have the colour of their intensity", () => {
  const data = new Uint8Array(new Float32Array([1, 2, 3, 0, 4, 5, 6, 100]).buffer);
  const fields = ["x", "y", "z", "intensity"].map((name, i) => ({ name, offset: 4 * i, datatype: 7, count: 1 }));
  const cloud = { width: 2, height: 1, fields, is_bigendian: false, point_step: 16, row_step: 32, data };
  const { points } = drawn("sensor_msgs/PointCloud2", cloud);
  assert.deepEqual([points[3], points[9]], [packedColour(0.05, 0.35, 0.95, 1), packedColour(1, 0.85, 0.1, 1)]);
});

test("a frame that moves is where it was at the time of the message", () => {
  const pose = (/** @type {number} */ at, /** @type {number} */ x) => ({ at, matrix: Float64Array.of(1, 0, 0, 0, 1, 0, 0, 0, 1, x, 0, 0) });
  const kept = [pose(1, 0), pose(2, 10), pose(3, 30)];
  assert.deepEqual([1.5, 2, 2.25, 9, 0].map((at) => matrixAt(kept, at)[9]), [5, 10, 15, 30, 30]);
});
