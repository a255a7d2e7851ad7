/** Points of a lidar in the map's frame. */

import { multiply } from "../drawing/matrices.js";

/** Place of a frame in another one [m], [rad]; a positive pitch looks down. @typedef {{x: number, y: number, z: number, roll: number, pitch: number, yaw: number}} Place */

/** Floats of a point: place and intensity. */
export const POINT_FLOATS = 4;

/** Return the matrix that takes places of a frame to the one that it is placed in. @param {Place} place */
export function placeMatrix({ x, y, z, roll, pitch, yaw }) {
  const [a, b, c, d, e, f] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch), Math.cos(roll), Math.sin(roll)];
  return new Float64Array([
    a * c, b * c, -d, 0,
    a * d * f - b * e, b * d * f + a * e, c * f, 0,
    a * d * e + b * f, b * d * e - a * f, c * e, 0,
    x, y, z, 1,
  ]); // prettier-ignore
}

/**
 * Return the points of a cloud.
 * @param {any} cloud - `sensor_msgs/PointCloud2` from CBOR, with x, y, z and intensity as 32-bit floats
 * @param {Place} vehicle - in the map's frame
 * @param {Place} mounting - of the lidar on it
 * @param {{x: number, y: number, z: number}} origin - where the map's buffers have 0
 * @returns {Float32Array} POINT_FLOATS for each
 */
export function pointsOfCloud(cloud, vehicle, mounting, { x, y, z }) {
  const m = multiply(placeMatrix({ ...vehicle, x: vehicle.x - x, y: vehicle.y - y, z: vehicle.z - z }), placeMatrix(mounting));
  const { data, point_step: step, fields } = cloud;
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const places = ["x", "y", "z", "intensity"].map((name) => fields.find((/** @type {any} */ field) => field.name === name)?.offset ?? 0);
  const count = Math.floor(data.byteLength / step);
  const points = new Float32Array(POINT_FLOATS * count);
  for (let i = 0; i < count; i += 1) {
    const [px, py, pz, intensity] = places.map((at) => view.getFloat32(step * i + at, true));
    for (let row = 0; row < 3; row += 1) {
      points[POINT_FLOATS * i + row] = m[row] * px + m[4 + row] * py + m[8 + row] * pz + m[12 + row];
    }
    points[POINT_FLOATS * i + 3] = intensity;
  }
  return points;
}
