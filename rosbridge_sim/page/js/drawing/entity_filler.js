/**
 * Entities of a state as rows of the graphics card's buffers.
 */

/** @typedef {import("../scene/store.js").SceneState} SceneState */
/** @typedef {import("./gl_layers.js").EntityLayer} EntityLayer */
/** @typedef {Record<"car" | "van" | "person" | "box", EntityLayer>} EntityLayers */

/** Vehicles from this height on are drawn as vans, trucks and buses [m]. */
const VAN_HEIGHT = 2;
/** Vehicles below this length are two-wheelers and other small things, which are drawn as boxes [m]. */
const CAR_LENGTH = 2.6;
/** Least length on the screen of vehicles and of people, so that they are found on a large map [pixels]. */
const LEAST_VEHICLE = 11;
const LEAST_PERSON = 7;
/** Posts of traffic lights: kind (a colour) and thickness [m]. */
const POST_KIND = 4;
const POST = 0.16;

/**
 * Return the form in which an entity is drawn.
 * @param {number} kind
 * @param {number} length - [m]
 * @param {number} height - [m]
 */
export function meshOf(kind, length, height) {
  if (kind === 2) {
    return "person";
  }
  if (kind > 2 || length < CAR_LENGTH) {
    return "box";
  }
  return height >= VAN_HEIGHT ? "van" : "car";
}

/**
 * Fill the layers with all entities.
 * @param {EntityLayers} layers
 * @param {SceneState | null} state
 * @param {import("./picking.js").Poses} poses - as drawn
 * @param {{x: number, y: number, z: number}} origin
 */
export function fillEntities(layers, state, poses, origin) {
  if (state !== null) {
    for (let row = 0; row < state.kind.length; row += 1) {
      const kind = state.kind[row];
      const layer = layers[meshOf(kind, state.length[row], state.height[row])];
      const at = layer.next();
      const { values } = layer;
      values[at] = poses.x[row] - origin.x;
      values[at + 1] = poses.y[row] - origin.y;
      values[at + 2] = poses.z[row] - origin.z;
      values[at + 3] = poses.heading[row];
      values[at + 4] = state.length[row];
      values[at + 5] = state.width[row];
      values[at + 6] = state.height[row];
      values[at + 7] = state.center_x[row];
      values[at + 8] = Math.min(kind, 3);
      values[at + 9] = state.lamps[row];
      values[at + 10] = state.flags[row];
      values[at + 11] = kind === 2 ? LEAST_PERSON : LEAST_VEHICLE;
      values[at + 12] = state.roll[row];
      values[at + 13] = state.pitch[row];
    }
  }
}

/**
 * Add the posts of traffic lights, for the camera behind the car.
 * @param {EntityLayer} layer
 * @param {{x: number, y: number, z: number}[]} lights
 * @param {{x: number, y: number, z: number}} origin
 */
export function fillPosts(layer, lights, origin) {
  for (const light of lights) {
    const at = layer.next();
    layer.values.fill(0, at, at + 14);
    layer.values.set([light.x - origin.x, light.y - origin.y, Math.min(light.z, 0) - origin.z, 0, POST, POST], at);
    layer.values[at + 6] = Math.abs(light.z);
    layer.values[at + 8] = POST_KIND;
  }
}
