import assert from "node:assert/strict";
import { test } from "node:test";

import { pointsOfCloud } from "../../../rosbridge_sim/page/js/scene/point_cloud.js";

test("a point ahead of a turned lidar on a turned car lies where both turns take it", () => {
  const data = new Uint8Array(6 + 22); // behind other bytes of the frame
  const view = new DataView(data.buffer, 6);
  [10, 0, 0, 50].forEach((value, i) => view.setFloat32(4 * i, value, true));
  const fields = ["x", "y", "z", "intensity", "ring", "time"].map((name, i) => ({ name, offset: i < 5 ? 4 * i : 18 }));
  const cloud = { data: data.subarray(6), point_step: 22, fields };
  const level = { roll: 0, pitch: 0 };
  const vehicle = { x: 100, y: 200, z: 3, ...level, yaw: Math.PI / 2 };
  const mounting = { x: 2, y: 0, z: 1, ...level, pitch: Math.PI / 6, yaw: 0 };
  const points = pointsOfCloud(cloud, vehicle, mounting, { x: 90, y: 190, z: 0 });
  // 2 m and then 10 m cos(30 deg) to the north of the car, and 10 m sin(30 deg) below the lidar
  const expected = [10, 10 + 2 + 10 * Math.cos(Math.PI / 6), 3 + 1 - 5, 50];
  expected.forEach((value, i) => assert.ok(Math.abs(points[i] - value) < 1e-4, `${i}: ${points[i]} for ${value}`));
});

test("roll to the right lowers what is on the right", () => {
  const data = new Uint8Array(16);
  new DataView(data.buffer).setFloat32(4, -1, true); // y: 1 m to the right
  const cloud = { data, point_step: 16, fields: ["x", "y", "z", "intensity"].map((name, i) => ({ name, offset: 4 * i })) };
  const none = { x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0 };
  const points = pointsOfCloud(cloud, { ...none, roll: 0.1 }, none, none);
  assert.ok(points[2] < -0.09);
});
