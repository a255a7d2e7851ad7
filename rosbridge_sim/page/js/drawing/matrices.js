/** Matrices of 4 x 4 numbers, column by column, as WebGL has them. */

/** @typedef {Float64Array} Matrix */
/** @typedef {[number, number, number]} Vector */

/** @param {Matrix} a @param {Matrix} b @returns {Matrix} a times b */
export function multiply(a, b) {
  const product = new Float64Array(16);
  for (let column = 0; column < 4; column += 1) {
    for (let row = 0; row < 4; row += 1) {
      let sum = 0;
      for (let k = 0; k < 4; k += 1) {
        sum += a[4 * k + row] * b[4 * column + k];
      }
      product[4 * column + row] = sum;
    }
  }
  return product;
}

/**
 * @param {number} fieldOfView - from the lower to the upper edge [rad] @param {number} aspect - width by height
 * @param {number} near - [m] @param {number} far - [m] @returns {Matrix}
 */
export function perspective(fieldOfView, aspect, near, far) {
  const scale = 1 / Math.tan(0.5 * fieldOfView);
  const matrix = new Float64Array(16);
  matrix[0] = scale / aspect;
  matrix[5] = scale;
  matrix[10] = (far + near) / (near - far);
  matrix[11] = -1;
  matrix[14] = (2 * far * near) / (near - far);
  return matrix;
}

/** @param {Vector} eye @param {Vector} forward - of length 1; not straight up or down @returns {Matrix} */
export function lookAlong(eye, forward) {
  const [fx, fy, fz] = forward;
  const across = Math.hypot(fx, fy);
  const [rx, ry] = [fy / across, -fx / across]; // to the right
  const up = [ry * fz, -rx * fz, rx * fy - ry * fx]; // right x forward
  return new Float64Array([
    rx, up[0], -fx, 0,
    ry, up[1], -fy, 0,
    0, up[2], -fz, 0,
    -(rx * eye[0] + ry * eye[1]),
    -(up[0] * eye[0] + up[1] * eye[1] + up[2] * eye[2]),
    fx * eye[0] + fy * eye[1] + fz * eye[2],
    1,
  ]); // prettier-ignore
}

/** @param {Matrix} matrix @param {Vector} point @returns {[number, number, number, number]} */
export function transform(matrix, [x, y, z]) {
  const at = (/** @type {number} */ row) => matrix[row] * x + matrix[4 + row] * y + matrix[8 + row] * z + matrix[12 + row];
  return [at(0), at(1), at(2), at(3)];
}
