/** Entities of a state as rows of the graphics card's buffers. */

import { FAR_FORM, LAST_VEHICLE } from "./bodies.js";

/** @typedef {import("../scene/store.js").SceneState} SceneState */
/** @typedef {import("./gl_layers.js").EntityLayer} EntityLayer */
/** Vehicles that are shorter on the screen have the simplest form, without a shadow [pixels]. */
const FAR_PIXELS = 22;
/** The same behind the car, where a length is seen foreshortened: about 110 m away [pixels]. */
const FAR_PIXELS_BEHIND = 30;
/** Behind the car, entities are drawn up to here; farther away the fog hides them [m]. */
const FARTHEST_ENTITY = 900;
/** Least length on the screen of vehicles and of people, so that they are found on a large map [pixels]. */
const LEAST_VEHICLE = 11;
const LEAST_PERSON = 7;

/**
 * Fill the layers with all entities on the screen.
 * @param {EntityLayer[]} layers - one for each of `FORMS` @param {SceneState | null} state
 * @param {import("./picking.js").Poses} poses - as drawn @param {{x: number, y: number, z: number}} origin
 * @param {ArrayLike<number>} view - from buffers to the clip space
 * @param {number} pixel - size of a pixel by the fourth clip coordinate [m]
 * @param {number} [hidden] - row that is not drawn: the camera is in it
 */
export function fillEntities(layers, state, poses, origin, view, pixel, hidden = -1) {
  if (state === null) {
    return;
  }
  const isAbove = view[3] === 0 && view[7] === 0;
  const farPixels = isAbove ? FAR_PIXELS : FAR_PIXELS_BEHIND;
  const across = Math.hypot(view[0], view[4], view[8]);
  const upwards = Math.hypot(view[1], view[5], view[9]);
  for (let row = 0; row < state.kind.length; row += 1) {
    const [x, y, z] = [poses.x[row] - origin.x, poses.y[row] - origin.y, poses.z[row] - origin.z];
    const w = view[3] * x + view[7] * y + view[11] * z + view[15];
    const pixels = state.length[row] / (pixel * Math.max(w, 0.1));
    const kind = state.kind[row];
    const least = kind === 2 ? LEAST_PERSON : LEAST_VEHICLE;
    // The whole body is near the reference point, and so is an enlarged one.
    const reach = (state.length[row] + state.height[row]) * Math.max(1, least / pixels);
    const isSeen =
      row !== hidden &&
      w > -reach &&
      w < FARTHEST_ENTITY &&
      Math.abs(view[0] * x + view[4] * y + view[8] * z + view[12]) <= w + reach * across &&
      Math.abs(view[1] * x + view[5] * y + view[9] * z + view[13]) <= w + reach * upwards;
    if (isSeen) {
      const layer = layers[state.shape[row] <= LAST_VEHICLE && pixels < farPixels ? FAR_FORM : state.shape[row]];
      const at = layer.next();
      const { values } = layer;
      values[at] = x;
      values[at + 1] = y;
      values[at + 2] = z;
      values[at + 3] = state.roll[row];
      values[at + 4] = state.length[row];
      values[at + 5] = state.width[row];
      values[at + 6] = state.height[row];
      values[at + 7] = state.center_x[row];
      values[at + 8] = Math.min(kind, 3);
      values[at + 9] = state.lamps[row];
      values[at + 10] = state.flags[row];
      values[at + 11] = least;
      values[at + 12] = Math.cos(poses.heading[row]);
      values[at + 13] = Math.sin(poses.heading[row]);
      values[at + 14] = state.pitch[row];
      values[at + 15] = state.paint[row];
    }
  }
}
