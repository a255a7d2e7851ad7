/** Lines as pieces from point to point, in the form in which the graphics card draws them. */

/** Floats of one piece: both ends (x, y, z), width [m], least width [pixels], distance along the line [m], material,
    dash [m] and period [m]. */
export const PIECE_FLOATS = 12;
/** Longer pieces are divided [m]: beside the camera, the depth of a longer one is not exact enough to lie on its road. */
export const LONGEST_PIECE = 40;

/**
 * @typedef {object} LineStyle
 * @property {number} width - [m]
 * @property {number} minPixels - least width on the screen [pixels]
 * @property {number} material - index of the palette
 * @property {number} [dash] - length of a dash [m]; with a period of 0 the line is solid
 * @property {number} [period] - from dash to dash [m]
 */

/** A growing list of pieces. */
export class LineBuffer {
  constructor(capacity = 256) {
    this.values = new Float32Array(capacity * PIECE_FLOATS);
    this.length = 0;
  }

  clear() {
    this.length = 0;
  }

  /**
   * Add one piece.
   * @param {number} x0 @param {number} y0 @param {number} z0 @param {number} x1 @param {number} y1 @param {number} z1
   * @param {LineStyle} style @param {number} along - distance of the first end along the line [m]
   */
  add(x0, y0, z0, x1, y1, z1, style, along = 0) {
    const at = this.length * PIECE_FLOATS;
    if (at + PIECE_FLOATS > this.values.length) {
      const larger = new Float32Array(2 * this.values.length);
      larger.set(this.values);
      this.values = larger;
    }
    const { values } = this;
    values[at] = x0;
    values[at + 1] = y0;
    values[at + 2] = z0;
    values[at + 3] = x1;
    values[at + 4] = y1;
    values[at + 5] = z1;
    values[at + 6] = style.width;
    values[at + 7] = style.minPixels;
    values[at + 8] = along;
    values[at + 9] = style.material;
    values[at + 10] = style.dash ?? 0;
    values[at + 11] = style.period ?? 0;
    this.length += 1;
  }

  /**
   * Add a line through points.
   * @param {ArrayLike<number>} x @param {ArrayLike<number>} y @param {ArrayLike<number>} z @param {LineStyle} style
   * @param {{isClosed?: boolean}} [options]
   */
  addLine(x, y, z, style, { isClosed = false } = {}) {
    let along = 0;
    const num = x.length;
    for (let i = 0; i + 1 < num + (isClosed && num > 2 ? 1 : 0); i += 1) {
      const j = (i + 1) % num;
      const length = Math.hypot(x[j] - x[i], y[j] - y[i]);
      const numPieces = length > 0 ? Math.ceil(length / LONGEST_PIECE) : 0;
      for (let piece = 0; piece < numPieces; piece += 1) {
        const [a, b] = [piece / numPieces, (piece + 1) / numPieces];
        const [dx, dy, dz] = [x[j] - x[i], y[j] - y[i], z[j] - z[i]];
        this.add(x[i] + a * dx, y[i] + a * dy, z[i] + a * dz, x[i] + b * dx, y[i] + b * dy, z[i] + b * dz, style, along + a * length);
      }
      along += length;
    }
  }

  /** @returns {Float32Array} the pieces so far, as a view */
  view() {
    return this.values.subarray(0, this.length * PIECE_FLOATS);
  }
}

/**
 * Move a line to its left.
 * @param {ArrayLike<number>} x @param {ArrayLike<number>} y
 * @param {ArrayLike<number> | number} offset - for each point, left is positive [m] @returns {{x: number[], y: number[]}}
 */
export function shiftLine(x, y, offset) {
  const num = x.length;
  const shifted = { x: new Array(num), y: new Array(num) };
  for (let i = 0; i < num; i += 1) {
    const before = Math.max(i - 1, 0);
    const after = Math.min(i + 1, num - 1);
    const dx = x[after] - x[before];
    const dy = y[after] - y[before];
    const length = Math.hypot(dx, dy) || 1;
    const by = typeof offset === "number" ? offset : offset[i];
    shifted.x[i] = x[i] - (by * dy) / length;
    shifted.y[i] = y[i] + (by * dx) / length;
  }
  return shifted;
}
