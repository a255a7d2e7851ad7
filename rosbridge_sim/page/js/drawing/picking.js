/** The entity or light under a point of the screen. */

/** @typedef {import("../scene/store.js").SceneState} SceneState */
/** @typedef {import("./top_camera.js").Ray} Ray */
/** @typedef {{x: ArrayLike<number>, y: ArrayLike<number>, z: ArrayLike<number>, heading: ArrayLike<number>}} Poses */

/**
 * Find the nearest entity on a ray.
 * @param {SceneState} state - sizes @param {Poses} poses - as drawn @param {Ray} ray
 * @param {number} smallest - each box counts as at least this large [m] @returns {number} row; -1: there is none
 */
export function pickEntity(state, poses, ray, smallest) {
  const { origin, direction } = ray;
  let nearest = Infinity;
  let found = -1;
  for (let row = 0; row < poses.x.length; row += 1) {
    const [cos, sin] = [Math.cos(poses.heading[row]), Math.sin(poses.heading[row])];
    const reference = state.center_x[row];
    const dx = origin[0] - poses.x[row] - cos * reference;
    const dy = origin[1] - poses.y[row] - sin * reference;
    const height = Math.max(state.height[row], 0.1);
    const distance = distanceToBox(
      [cos * dx + sin * dy, cos * dy - sin * dx, origin[2] - poses.z[row] - 0.5 * height],
      [cos * direction[0] + sin * direction[1], cos * direction[1] - sin * direction[0], direction[2]],
      [0.5 * Math.max(state.length[row], smallest), 0.5 * Math.max(state.width[row], smallest), 0.5 * Math.max(height, 0)],
    );
    if (distance < nearest) {
      nearest = distance;
      found = row;
    }
  }
  return found;
}

/**
 * Return the distance along a ray to a box around 0, in lengths of its direction.
 * @param {number[]} origin @param {number[]} direction @param {number[]} half - half the sides of the box
 * @returns {number} Infinity: the ray misses it
 */
export function distanceToBox(origin, direction, half) {
  let first = 0;
  let last = Infinity;
  for (let axis = 0; axis < 3; axis += 1) {
    if (direction[axis] === 0) {
      if (Math.abs(origin[axis]) > half[axis]) {
        return Infinity;
      }
    } else {
      const a = (-half[axis] - origin[axis]) / direction[axis];
      const b = (half[axis] - origin[axis]) / direction[axis];
      first = Math.max(first, Math.min(a, b));
      last = Math.min(last, Math.max(a, b));
    }
  }
  return first <= last ? first : Infinity;
}

/**
 * Find the nearest of some places on the screen.
 * @param {{x: number, y: number, z: number}[]} places
 * @param {{project: (place: {x: number, y: number, z: number}) => {x: number, y: number} | null}} camera @param {number} px
 * @param {number} py @param {number} reach - [pixels] @returns {number} index; -1: none within reach
 */
export function pickPlaceOnScreen(places, camera, px, py, reach) {
  let nearest = reach;
  let found = -1;
  places.forEach((place, i) => {
    const point = camera.project(place);
    const distance = point === null ? Infinity : Math.hypot(point.x - px, point.y - py);
    if (distance < nearest) {
      nearest = distance;
      found = i;
    }
  });
  return found;
}
