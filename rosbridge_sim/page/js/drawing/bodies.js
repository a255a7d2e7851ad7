/** Bodies of entities: the shapes that cameras and lidars see, as shares of the box around each entity. */

import bodies from "../../bodies.json" with { type: "json" };

/** Forms by the values of `shape`, and last that of vehicles that are far away. */
export const FORMS = /** @type {(keyof typeof bodies)[]} */ (Object.keys(bodies));
export const FAR_FORM = FORMS.length - 1;
/** Shapes up to this one have four wheels. */
export const LAST_VEHICLE = FORMS.indexOf("bus");
/** First vertex of the roof of the distant form, behind those of its four sides: more is not seen from above. */
export const FAR_ROOF = 24;
/** Lamps on the map, where real ones would not be seen: their place as shares of the height; above 1 there are none. */
const NO_LAMPS = /** @type {[number, number]} */ ([2, 2]);
/** @type {[number, number][]} */
const LAMP_HEIGHTS = [[0.4, 0.66], [0.25, 0.38], [0.25, 0.38], [0.25, 0.38]]; // prettier-ignore

/** Return a form's lamps on the map. @param {number} shape */
export function lampHeight(shape) {
  return LAMP_HEIGHTS[shape] ?? NO_LAMPS;
}

/**
 * Make the vertices of a form.
 * @param {keyof typeof bodies} name @returns {Float32Array} along, across, up and the part, see shaders.js
 */
export function makeBody(name) {
  const { vertices, triangles, parts } = bodies[name];
  return new Float32Array(triangles.flatMap((corner, i) => [...vertices.slice(3 * corner, 3 * corner + 3).map((part) => part / 1000), parts[Math.floor(i / 3)]]));
}
