/**
 * Numbers of the colours of flat things, so that a buffer stays as it is when light changes to dark.
 */

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
