import assert from "node:assert/strict";
import { test } from "node:test";
import { setImmediate } from "node:timers/promises";

import { FORMS, makeBody } from "../../../rosbridge_sim/page/js/drawing/bodies.js";
import { fillEntities } from "../../../rosbridge_sim/page/js/drawing/entity_filler.js";
import { MeasureTool, PlaceTool } from "../../../rosbridge_sim/page/js/drawing/map_tools.js";
import { makePalette } from "../../../rosbridge_sim/page/js/drawing/palette.js";
import { TopCamera } from "../../../rosbridge_sim/page/js/drawing/top_camera.js";
import { ContactList } from "../../../rosbridge_sim/page/js/scene/contacts.js";
import { PoseTrack, turnBetween } from "../../../rosbridge_sim/page/js/scene/interpolation.js";
import { stateOfView } from "../../../rosbridge_sim/page/js/scene/scene_view.js";
import { SceneStore } from "../../../rosbridge_sim/page/js/scene/store.js";
import { Trails } from "../../../rosbridge_sim/page/js/scene/trails.js";

/** @typedef {import("../../../rosbridge_sim/page/js/scene/store.js").SceneState} SceneState */

/**
 * A state with a row for each [id, kind, x, speed].
 * @param {number} frame
 * @param {[number, number, number, number][]} rows
 * @param {Partial<SceneState>} [others]
 * @returns {SceneState}
 */
function state(frame, rows, others = {}) {
  const column = (/** @type {number} */ k) => rows.map((row) => row[k]);
  const zeros = new Float32Array(rows.length);
  return {
    header: { stamp: { secs: 0, nsecs: 0 } }, frame, map_digest: "d", scenario: "s", id: new Uint32Array(column(0)),
    kind: new Uint8Array(column(1)), x: new Float64Array(column(2)), y: new Float64Array(rows.length), z: zeros, roll: zeros,
    pitch: zeros, heading: zeros, speed: new Float32Array(column(3)), length: zeros.map(() => 4.5), width: zeros.map(() => 2),
    height: zeros.map(() => 1.5), center_x: zeros, shape: new Uint8Array(column(1).map((kind) => (kind === 2 ? 6 : 0))), paint: new Uint32Array(rows.length), lamps: new Uint8Array(rows.length), flags: new Uint8Array(rows.length),
    light_state: new Int16Array(0), light_time_left: new Float32Array(0), ...others,
  }; // prettier-ignore
}

test("poses move from one state to the next, and end at it exactly", () => {
  const track = new PoseTrack();
  track.take(state(0, [[1, 1, 0, 10]]), 1000);
  track.take(state(5, [[1, 1, 1, 10]]), 1100);
  track.update(1150);
  assert.equal(track.x[0], 0.5);
  assert.equal(track.isMoving(1199), true);
  track.update(1200);
  assert.equal(track.x[0], 1);
  assert.equal(track.isMoving(1200), false);
});

test("a step after a pause is seen at once", () => {
  const track = new PoseTrack();
  track.take(state(0, [[1, 1, 0, 10]]), 1000);
  track.take(state(1, [[1, 1, 0.2, 10]]), 9000);
  track.update(9000);
  assert.equal(track.x[0], 0.2);
  assert.equal(track.isMoving(9000), false);
});

test("an entity that was placed elsewhere does not drive there", () => {
  const track = new PoseTrack();
  track.take(state(0, [[1, 1, 0, 10], [2, 1, 0, 0]]), 1000); // prettier-ignore
  track.take(state(5, [[1, 1, 1, 10], [2, 1, 300, 0]]), 1100); // prettier-ignore
  track.update(1100);
  assert.deepEqual([...track.x], [0, 300]);
});

test("entities that come and go keep their own poses", () => {
  const track = new PoseTrack();
  track.take(state(0, [[1, 1, 0, 1], [2, 1, 10, 1]]), 1000); // prettier-ignore
  track.take(state(5, [[2, 1, 10.1, 1], [3, 1, 50, 1]]), 1100); // prettier-ignore
  track.update(1100);
  assert.deepEqual([...track.x], [10, 50]);
});

test("a reset and another map are seen at once", () => {
  for (const next of [state(0, [[1, 1, 1, 99]]), state(6, [[1, 1, 1, 99]], { map_digest: "e" })]) {
    const track = new PoseTrack();
    track.take(state(5, [[1, 1, 0, 99]]), 1000);
    track.take(next, 1050);
    track.update(1050);
    assert.equal(track.x[0], 1);
  }
});

test("a turn takes the shorter way", () => {
  assert.ok(Math.abs(turnBetween(3, -3) - (2 * Math.PI - 6)) < 1e-12);
  assert.equal(turnBetween(0.5, 0.2).toFixed(6), "-0.300000");
});

test("a trail has the way of an ego, and a jump begins it anew", () => {
  const trails = new Trails();
  for (const [frame, x] of [[0, 0], [1, 0.4], [2, 1.2], [3, 2.4], [4, 200]]) { // prettier-ignore
    trails.take(state(frame, [[0, 0, x, 10], [7, 1, x, 10]]), -1); // prettier-ignore
    if (frame === 3) {
      assert.deepEqual([...trails.trails.keys()], [-1], "other vehicles have none");
      assert.deepEqual(trails.trails.get(-1)?.points.filter((_, i) => i % 3 === 0), [0, 1.2, 2.4]);
    }
  }
  assert.equal(trails.trails.get(-1)?.length, 1);
  trails.take(state(5, [[0, 0, 200, 0], [7, 1, 0, 10]]), 1); // prettier-ignore
  assert.deepEqual([...trails.trails.keys()], [-1, 7], "the selected one has");
  trails.take(state(0, [[0, 0, 0, 0]]), -1);
  assert.deepEqual([...trails.trails.keys()], [-1]);
  assert.equal(trails.trails.get(-1)?.length, 1);
});

test("a trail does not grow without end", () => {
  const trails = new Trails();
  for (let frame = 0; frame < 3000; frame += 1) {
    trails.take(state(frame, [[0, 0, 2 * frame, 100]]), -1);
  }
  assert.equal(trails.trails.get(-1)?.length, 600);
});

test("collisions are listed with the newest first, and those of undone frames go", () => {
  const list = new ContactList();
  for (let frame = 1; frame <= 7; frame += 1) {
    list.add({ frame, id: [0, 1], kind: [0, 1], name: ["a", "b"], x: 0, y: 0, z: 0, relative_speed: 1 }, 1000 * frame);
  }
  assert.deepEqual(list.contacts.map(({ frame }) => frame), [7, 6, 5, 4, 3]);
  assert.equal(list.total, 7);
  assert.deepEqual(list.fresh(8000).map(({ frame }) => frame), [7, 6]);
  assert.equal(list.dropAfter(5), true);
  assert.equal(list.contacts[0].frame, 5);
  assert.equal(list.dropAfter(5), false);
});

/** A store on a connection that never answers. */
function storeWithoutServer() {
  const connection = /** @type {any} */ ({ onState: () => undefined, subscribe: () => ({ close: () => undefined }), call: () => new Promise(() => undefined) });
  return new SceneStore(connection);
}

test("a map that could not be loaded is asked for again while the world stands", async (context) => {
  context.mock.timers.enable({ apis: ["setTimeout"] });
  let calls = 0;
  const call = () => {
    calls += 1;
    return calls === 1 ? Promise.reject(new Error("busy")) : Promise.resolve({ digest: "d", num_pages: 1 });
  };
  const store = new SceneStore(/** @type {any} */ ({ onState: () => undefined, subscribe: () => ({ close: () => undefined }), call }));
  store.takeState(state(0, []));
  const loaded = new Promise((resolve) => store.onMap(() => resolve(store.map?.digest)));
  await setImmediate();
  assert.equal(store.map, null);
  context.mock.timers.tick(60_000);
  assert.equal(await loaded, "d");
});

test("an ego and an object with the same number are told apart", () => {
  const store = storeWithoutServer();
  store.takeState(state(0, [[2, 1, 0, 0], [2, 0, 5, 0], [3, 1, 9, 0]])); // prettier-ignore
  assert.equal(store.indexOf(2), 1, "the number is the ego's");
  assert.equal(store.indexOf(2, false), 0);
  assert.equal(store.indexOf(3), 2);
  assert.equal(store.indexOf(3, true), -1);
  assert.equal(store.indexOf(99), -1);
  store.select(2, false);
  assert.equal(store.selectedRow(), 0);
  store.select(2, true);
  assert.equal(store.selectedRow(), 1);
  assert.deepEqual(store.egos().map(({ number, x }) => [number, x]), [[2, 5]]);
});

test("an entity that has gone is no longer selected", () => {
  const store = storeWithoutServer();
  store.takeState(state(0, [[4, 1, 0, 0]]));
  let told = 0;
  store.onSelect(() => (told += 1));
  store.select(4);
  store.select(4);
  assert.equal(told, 1);
  store.takeState(state(1, []));
  assert.equal(store.selectedId, null);
  assert.equal(told, 2);
});

test("only entities on the screen are drawn, and distant ones in a simple form", () => {
  const camera = new TopCamera();
  camera.resize(800, 600);
  const rows = /** @type {[number, number, number, number][]} */ ([[1, 1, 0, 0], [2, 1, 1000, 0], [3, 2, 41, 0]]); // prettier-ignore
  const scene = state(0, rows);
  /** @type {any} */
  const layers = FORMS.map(() => ({ count: 0, values: new Float32Array(1000), next() { return 16 * this.count++; } })); // prettier-ignore
  const count = () => FORMS.map((name, i) => `${name} ${layers[i].count}`).filter((text) => !text.endsWith(" 0"));
  camera.scale = 10;
  fillEntities(layers, scene, scene, { x: 0, y: 0, z: 0 }, camera.matrix({ x: 0, y: 0, z: 0 }), camera.pixelSize);
  assert.deepEqual(count(), ["car 1", "person 1"]);
  camera.scale = 0.3;
  fillEntities(layers, scene, scene, { x: 0, y: 0, z: 0 }, camera.matrix({ x: 0, y: 0, z: 0 }), camera.pixelSize);
  assert.deepEqual(count(), ["car 1", "person 2", "far 2"]);
});

test("bodies stay within the box of their entity, and fill its length", () => {
  for (const name of FORMS) {
    const body = makeBody(name);
    assert.equal(body.length % 12, 0);
    const along = [];
    for (let i = 0; i < body.length; i += 4) {
      const [u, v, h, part] = body.subarray(i, i + 4);
      assert.ok(Math.abs(u) <= 0.5 && Math.abs(v) <= 0.5 && h >= 0 && h <= 1 && part <= 10, `${name}: ${[u, v, h, part].join(" ")}`);
      along.push(u);
    }
    assert.ok(Math.max(...along) - Math.min(...along) > 0.35, name);
  }
});

test("light and dark have a colour for everything", () => {
  for (const isDark of [false, true]) {
    const { materials, kinds } = makePalette(isDark);
    assert.ok([...materials, ...kinds].every((part) => part >= 0 && part <= 1));
    assert.equal(kinds.length, 12);
  }
});

test("two clicks measure, and a third one begins anew", () => {
  const tool = new MeasureTool();
  tool.tap({ x: 0, y: 0 });
  assert.equal(tool.distance, null);
  tool.tap({ x: 3, y: 4 });
  assert.equal(tool.distance, 5);
  tool.tap({ x: 1, y: 1 });
  assert.equal(tool.distance, null);
});

test("a click is a place without a heading, a drag one with it, and the sky is none", () => {
  /** @type {any[]} */
  const found = [];
  const tool = new PlaceTool((place) => found.push(place));
  tool.drag({ x: 1, y: 2 }, { x: 1, y: 2.1 }, 3, true);
  tool.drag({ x: 1, y: 2 }, { x: 1, y: 9 }, 50, true);
  tool.drag(null, { x: 1, y: 9 }, 50, true);
  tool.drag({ x: 1, y: 2 }, null, 50, true);
  tool.cancel();
  assert.deepEqual(found, [{ x: 1, y: 2, heading: null }, { x: 1, y: 2, heading: Math.PI / 2 }, { x: 1, y: 2, heading: null }, null]); // prettier-ignore
});

test("a view gives the state that it was made from", () => {
  const none = { roll: new Int16Array(0), pitch: new Int16Array(0), flags: new Uint8Array(0), lamps: new Uint8Array(0), z: new Float32Array(0) };
  const found = stateOfView({
    ...state(3, [[0, 0, 0, 0], [7, 1, 0, 0]]), ...none, origin_x: 1e6, origin_y: -2, origin_z: 5, x: Float32Array.of(0, 1.5), y: Float32Array.of(0, 2),
    heading: Int16Array.of(-31416, 15708), speed: Int16Array.of(-50, 1234), look: Uint16Array.of(2, 1), shapes: Uint8Array.of(3, 4), paints: Uint32Array.of(0xff0000, 0xff), sizes: Float32Array.of(4, 2, 1.5, 1.25, 8, 3, 2.5, 2),
    light_time_left: Uint16Array.of(65535, 31), light_state: Int16Array.of(-1, 16),
  }); // prettier-ignore
  assert.deepEqual([[...found.x], [...found.y], [...found.z]], [[1e6, 1e6 + 1.5], [-2, 0], [5, 5]]);
  assert.deepEqual([[...found.length], [...found.width], [...found.height], [...found.center_x]], [[8, 4], [3, 2], [2.5, 1.5], [2, 1.25]]);
  assert.ok(Math.abs(found.heading[0] + Math.PI) < 1e-4 && Math.abs(found.speed[1] - 12.34) < 1e-3);
  assert.deepEqual([[...found.flags], [...found.lamps], [...found.roll]], [[0, 0], [0, 0], [0, 0]]);
  assert.deepEqual([[...found.shape], [...found.paint]], [[4, 3], [0xff0000, 0xff]]);
  assert.ok(found.light_time_left[0] === -1 && Math.abs(found.light_time_left[1] - 3.1) < 1e-6);
});
