/** The message SceneView, which rounds poses and tells equal sizes once, as a SceneState. */

/**
 * Its definition has the units.
 * @typedef {Omit<import("./store.js").SceneState, "x" | "y" | "shape" | "paint" | "roll" | "pitch" | "heading" | "speed" | "light_time_left"> & {
 *   origin_x: number, origin_y: number, origin_z: number, x: Float32Array, y: Float32Array, roll: Int16Array,
 *   pitch: Int16Array, heading: Int16Array, speed: Int16Array, look: Uint16Array, sizes: Float32Array, shapes: Uint8Array, paints: Uint32Array,
 *   light_time_left: Uint16Array}} SceneView
 */

const ANGLE = 1e-4;
const SPEED = 0.01;
const TIME = 0.1;
const UNKNOWN_TIME = 65_535;

/** @param {SceneView} view @returns {import("./store.js").SceneState} */
export function stateOfView(view) {
  const num = view.id.length;
  /** @type {(values: ArrayLike<number>, unit?: number, from?: number) => Float32Array} */
  const column = (values, unit = 1, from = 0) => Float32Array.from({ length: num }, (_, row) => from + unit * (values[row] ?? 0));
  const sizeOf = (/** @type {number} */ look) => Math.floor(look / view.paints.length);
  const size = (/** @type {number} */ part) => Float32Array.from(view.look, (look) => view.sizes[4 * sizeOf(look) + part]);
  return {
    ...view,
    x: Float64Array.from(view.x, (x) => view.origin_x + x),
    y: Float64Array.from(view.y, (y) => view.origin_y + y),
    z: column(view.z, 1, view.origin_z),
    roll: column(view.roll, ANGLE),
    pitch: column(view.pitch, ANGLE),
    heading: column(view.heading, ANGLE),
    speed: column(view.speed, SPEED),
    length: size(0),
    width: size(1),
    height: size(2),
    center_x: size(3),
    shape: Uint8Array.from(view.look, (look) => view.shapes[sizeOf(look)]),
    paint: Uint32Array.from(view.look, (look) => view.paints[look % view.paints.length]),
    lamps: view.lamps.length > 0 ? view.lamps : new Uint8Array(num),
    flags: view.flags.length > 0 ? view.flags : new Uint8Array(num),
    light_time_left: Float32Array.from(view.light_time_left, (left) => (left === UNKNOWN_TIME ? -1 : left * TIME)),
  };
}
