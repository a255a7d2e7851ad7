/** Numbers of the colours of flat things, so that a buffer stays as it is when light changes to dark. */

/** Colour of a vertex or a line: an index of the palette in drawing/palette.js. */
export const MATERIALS = /** @type {const} */ ({
  lane: 0,
  inside: 1,
  deadEnd: 2,
  stripes: 3,
  arrow: 4,
  edge: 5,
  yellow: 6,
  blue: 7,
  stop: 8,
  ego: 9,
  selected: 10,
  measure: 11,
  contact: 12,
  lightDark: 13,
  lightRed: 14,
  lightYellow: 15,
  lightGreen: 16,
  ink: 17,
});

/** Number of colours in the palette. */
export const NUM_MATERIALS = 18;

/**
 * Return a colour of its own in place of an index of the palette: a number below 0, which a float holds exactly.
 * @param {number} red - 0 to 1, as all parts @param {number} green @param {number} blue @param {number} alpha
 */
export function packedColour(red, green, blue, alpha) {
  const part = (/** @type {number} */ value, /** @type {number} */ most) => Math.round(Math.min(1, Math.max(0, value || 0)) * most);
  return -1 - (((part(red, 63) * 64 + part(green, 63)) * 64 + part(blue, 63)) * 32 + part(alpha, 31));
}
