import assert from "node:assert/strict";
import { test } from "node:test";

import { ChaseCamera } from "../../../rosbridge_sim/page/js/drawing/chase_camera.js";
import { transform } from "../../../rosbridge_sim/page/js/drawing/matrices.js";
import { distanceToBox, pickEntity, pickPlaceOnScreen } from "../../../rosbridge_sim/page/js/drawing/picking.js";
import { lengthText, roundLength } from "../../../rosbridge_sim/page/js/drawing/scale_bar.js";
import { nearestPlaces, TopCamera } from "../../../rosbridge_sim/page/js/drawing/top_camera.js";

/** @param {number} a @param {number} b */
const near = (a, b, within = 1e-6) => assert.ok(Math.abs(a - b) < within, `${a} is not ${b}`);

function topCamera() {
  const camera = new TopCamera();
  camera.resize(800, 600);
  camera.x = 100;
  camera.y = -50;
  camera.scale = 4;
  camera.rotation = 0.7;
  return camera;
}

function chaseCamera() {
  const camera = new ChaseCamera();
  camera.resize(800, 600);
  camera.follow({ x: 500_000, y: -20, z: 3, heading: 2 }, 0);
  return camera;
}

/** Two cars: at 0, 0 to the east, and at 20, 0 to the north; the box begins 1 m behind the reference point. */
const STATE = /** @type {any} */ ({
  length: [5, 5], width: [2, 2], height: [1.5, 1.5], center_x: [1.5, 1.5],
}); // prettier-ignore
const POSES = { x: [0, 20], y: [0, 0], z: [0, 0], heading: [0, Math.PI / 2] };

test("the place under a point of the screen is drawn at that point", () => {
  const camera = topCamera();
  const place = camera.placeAt(123, 456);
  const point = camera.project({ ...place, z: 0 });
  near(point.x, 123);
  near(point.y, 456);
});

test("zoom and turn at a point keep the place under it", () => {
  const camera = topCamera();
  const before = camera.placeAt(700, 90);
  camera.zoomAt(700, 90, 3.7);
  camera.rotateAt(700, 90, -1.1);
  const after = camera.placeAt(700, 90);
  near(after.x, before.x);
  near(after.y, before.y);
  camera.zoomAt(700, 90, 1e9);
  assert.ok(Number.isFinite(camera.scale) && camera.scale < 1000);
});

test("a drag moves the place with the pointer", () => {
  const camera = topCamera();
  const place = { ...camera.placeAt(400, 300), z: 0 };
  camera.panBy(30, -40);
  const point = camera.project(place);
  near(point.x, 430);
  near(point.y, 260);
});

test("the whole map fits, and an empty one too", () => {
  const camera = topCamera();
  camera.fit({ west: 0, south: 0, east: 1000, north: 100 });
  const corner = camera.project({ x: 1000, y: 100, z: 0 });
  assert.ok(corner.x <= 800 && corner.y >= 0);
  camera.fit({ west: 0, south: 0, east: 0, north: 0 });
  assert.ok(camera.scale > 0 && Number.isFinite(camera.scale));
});

test("the matrix of each camera agrees with its points on the screen", () => {
  for (const camera of [topCamera(), chaseCamera()]) {
    const base = camera instanceof ChaseCamera ? { ...camera.target, z: 0 } : { x: 100, y: -50, z: 0 };
    const place = { x: base.x - 4, y: base.y + 6, z: 2 };
    const clip = transform(Float64Array.from(camera.matrix(base)), [-4, 6, 2]);
    const point = camera.project(place);
    near(400 * (1 + clip[0] / clip[3]), point?.x ?? NaN, 0.01);
    near(300 * (1 - clip[1] / clip[3]), point?.y ?? NaN, 0.01);
  }
});

test("the camera behind the car looks along its heading, and sees nothing behind itself", () => {
  const camera = chaseCamera();
  const { x, y, z } = camera.target;
  const ahead = camera.project({ x: x + 20 * Math.cos(2), y: y + 20 * Math.sin(2), z: z + 1 });
  near(ahead?.x ?? NaN, 400, 0.01);
  assert.equal(camera.project({ x: x - 40 * Math.cos(2), y: y - 40 * Math.sin(2), z }), null);
  const left = camera.project({ x: x + 20 * Math.cos(2) - 5 * Math.sin(2), y: y + 20 * Math.sin(2) + 5 * Math.cos(2), z });
  assert.ok((left?.x ?? 400) < 400);
});

test("the ground under a point is found behind the car, and none in the sky", () => {
  const camera = chaseCamera();
  const place = camera.placeAt(300, 500);
  assert.ok(place);
  const point = camera.project({ ...place, z: camera.target.z });
  near(point?.x ?? NaN, 300, 0.01);
  near(point?.y ?? NaN, 500, 0.01);
  assert.equal(camera.placeAt(300, 0), null);
});

test("the camera turns with the car the short way, and comes to rest", () => {
  const camera = new ChaseCamera();
  camera.follow({ x: 0, y: 0, z: 0, heading: 3 }, 0);
  const target = { x: 0, y: 0, z: 0, heading: -3 };
  assert.equal(camera.follow(target, 0.02), true);
  assert.ok(camera.heading > 3);
  let steps = 0;
  while (camera.follow(target, 0.02) && steps < 500) {
    steps += 1;
  }
  assert.ok(steps < 500);
});

test("a click finds the entity under it", () => {
  const down = /** @type {[number, number, number]} */ ([0, 0, -1]);
  const pick = (/** @type {number} */ x, /** @type {number} */ y, smallest = 0) =>
    pickEntity(STATE, POSES, { origin: [x, y, 100], direction: down }, smallest);
  assert.equal(pick(3.9, 0.9), 0);
  assert.equal(pick(-1.1, 0), -1);
  assert.equal(pick(20.9, 3.9), 1);
  assert.equal(pick(23, 1.5), -1);
  assert.equal(pick(23, 1.5, 8), 1, "a click beside a tiny picture of it counts");
});

test("of two entities on a ray the nearer one is found", () => {
  const ray = { origin: /** @type {[number, number, number]} */ ([-50, 0, 0.7]), direction: /** @type {[number, number, number]} */ ([1, 0, 0]) };
  assert.equal(pickEntity(STATE, POSES, ray, 0), 0);
  assert.equal(pickEntity(STATE, POSES, { ...ray, direction: [-1, 0, 0] }, 0), -1, "none is behind the ray");
  assert.equal(distanceToBox([0, 0, 0], [1, 0, 0], [1, 1, 1]), 0);
});

test("the nearest light within reach of a click is found", () => {
  const camera = topCamera();
  const lights = [camera.placeAt(100, 100), camera.placeAt(108, 100)].map((place) => ({ ...place, z: 5 }));
  assert.equal(pickPlaceOnScreen(lights, camera, 107, 100, 12), 1);
  assert.equal(pickPlaceOnScreen(lights, camera, 200, 100, 12), -1);
});

test("the scale bar has a round length with its unit", () => {
  assert.deepEqual([0.3, 7, 99, 100, 2600].map(roundLength), [0.2, 5, 50, 100, 2000]);
  assert.deepEqual([0.2, 12.345, 2000].map(lengthText), ["20 cm", "12.35 m", "2 km"]);
});

test("the first picture has the nearest traffic, and follows it while the ego stands", () => {
  const camera = new TopCamera();
  camera.resize(900, 600);
  const state = (/** @type {number} */ away) => /** @type {any} */ ({
    id: [0, 1, 2], kind: [0, 1, 3], x: [0, away, 5], y: [0, 0, 0], speed: [0, 20, 0],
  });
  camera.fitAround({ x: 0, y: 0 }, nearestPlaces(state(100), 0));
  assert.ok(camera.project({ x: 100, y: 0, z: 0 }).x < 900, "the obstacle is nearer, but no traffic");
  assert.equal(camera.hasLost(state(120), 0), false);
  assert.equal(camera.hasLost(state(200), 0), true);
  assert.equal(camera.hasLost(state(20_000), 0), false);
  camera.zoomAt(0, 0, 1.1); // by the user
  assert.equal(camera.hasLost(state(200), 0), false);
});

test("at the driver's seat the eye turns and nods with the car, to the left of its middle", () => {
  const camera = new ChaseCamera();
  camera.mode = "seat";
  camera.follow({ x: 10, y: 20, z: 1, heading: Math.PI / 2, pitch: 0.1, length: 4.6, width: 1.8, height: 1.5, center: 1.3 }, 0.02);
  const [x, y, z] = camera.eye();
  near(x, 10 - 0.36);
  near(y, 21.3);
  near(z, 2.2);
  const [fx, fy, fz] = camera.forward();
  near(fx, 0);
  assert.ok(fy > 0.98 && fz < -0.14);
  camera.zoomBy(2);
  near(camera.eye()[1], 21.3);
});

test("the camera around the car keeps its direction while the car turns", () => {
  const camera = new ChaseCamera();
  camera.mode = "orbit";
  camera.follow({ x: 0, y: 0, z: 0, heading: 0 }, 0);
  const before = camera.forward();
  camera.follow({ x: 50, y: 0, z: 0, heading: 2 }, 0.02);
  assert.deepEqual(camera.forward(), before);
  const middle = camera.project({ x: 50, y: 0, z: 1.1 });
  camera.resize(800, 600);
  assert.ok(middle);
  near(camera.project({ x: 50, y: 0, z: 1.1 })?.x ?? NaN, 400, 0.01);
  camera.orbitBy(0.5, 0);
  assert.notDeepEqual(camera.forward(), before);
});
