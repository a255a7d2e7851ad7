/** Flat areas as triangles, in the form in which the graphics card draws them. */

/** Floats of one vertex: x, y, z and material. */
export const VERTEX_FLOATS = 4;

/** A growing list of triangles. */
export class SurfaceBuffer {
  constructor() {
    /** @type {number[]} */
    this.vertices = [];
    /** @type {number[]} */
    this.indices = [];
  }

  get numVertices() {
    return this.vertices.length / VERTEX_FLOATS;
  }

  /**
   * Add a band between two lines with equally many points.
   * @param {{x: ArrayLike<number>, y: ArrayLike<number>}} left @param {{x: ArrayLike<number>, y: ArrayLike<number>}} right
   * @param {ArrayLike<number>} z - of both @param {number} material
   */
  addBand(left, right, z, material) {
    const first = this.numVertices;
    for (let i = 0; i < z.length; i += 1) {
      this.vertices.push(left.x[i], left.y[i], z[i], material, right.x[i], right.y[i], z[i], material);
      if (i > 0) {
        const a = first + 2 * (i - 1);
        this.indices.push(a, a + 1, a + 2, a + 2, a + 1, a + 3);
      }
    }
  }

  /** Add a convex area. @param {[number, number, number][]} corners - in turn @param {number} material */
  addFan(corners, material) {
    const first = this.numVertices;
    corners.forEach(([x, y, z], i) => {
      this.vertices.push(x, y, z, material);
      if (i > 1) {
        this.indices.push(first, first + i - 1, first + i);
      }
    });
  }

  /** @returns {Surface} */
  finish() {
    return { vertices: new Float32Array(this.vertices), indices: new Uint32Array(this.indices) };
  }
}

/** @typedef {{vertices: Float32Array, indices: Uint32Array}} Surface */
