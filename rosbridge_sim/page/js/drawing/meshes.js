/**
 * Bodies of entities: triangles as shares of the box around each, with the part that each belongs to.
 */

/** Parts: paint, glass, tyres, skin, the mark at the front, and the roof of a distant vehicle. */
const PAINT_PART = 0;
const GLASS = 1;
const TYRE = 2;
const SKIN = 3;
const FRONT_MARK = 4;
const ROOF = 5;

/** @typedef {[number, number, number]} Corner along, across and up, as shares of length, width and height */

/** Triangles of one body. From outside their corners go counter-clockwise, so that inner faces are not drawn. */
class MeshBuilder {
  /** @type {number[]} */
  values = [];

  /**
   * @param {Corner} a
   * @param {Corner} b
   * @param {Corner} c
   * @param {number} part
   */
  triangle(a, b, c, part) {
    this.values.push(...a, part, ...b, part, ...c, part);
  }

  /**
   * @param {Corner} a
   * @param {Corner} b
   * @param {Corner} c
   * @param {Corner} d
   * @param {number} part
   */
  quad(a, b, c, d, part) {
    this.triangle(a, b, c, part);
    this.triangle(a, c, d, part);
  }

  /**
   * @param {Corner} a
   * @param {Corner} b
   * @param {Corner} c
   * @param {Corner} d
   * @param {number} part
   * @param {boolean} isReversed - the corners go clockwise
   */
  side(a, b, c, d, part, isReversed) {
    if (isReversed) {
      this.quad(d, c, b, a, part);
    } else {
      this.quad(a, b, c, d, part);
    }
  }

  /**
   * Add a body with one side view: from the lower rear up, forward and down.
   * @param {[number, number, number, number][]} profile - along, up, half the width, and the part of the face to the next
   * @param {number} sides - part of both sides
   */
  extrude(profile, sides) {
    profile.forEach(([u, h, w, part], i) => {
      const [u2, h2, w2] = profile[(i + 1) % profile.length];
      this.quad([u, w, h], [u, -w, h], [u2, -w2, h2], [u2, w2, h2], part);
      if (i > 1) {
        const [u0, h0, w0] = profile[0];
        const [u1, h1, w1] = profile[i - 1];
        this.triangle([u0, w0, h0], [u1, w1, h1], [u, w, h], sides);
        this.triangle([u0, -w0, h0], [u, -w, h], [u1, -w1, h1], sides);
      }
    });
  }

  /**
   * Add an upright column with eight sides.
   * @param {number} radius - as a share of length and width
   * @param {number} top - radius at the top
   * @param {number} low
   * @param {number} high
   * @param {number} part
   */
  column(radius, top, low, high, part) {
    for (let i = 0; i < 8; i += 1) {
      const [a, b] = [(i * Math.PI) / 4, ((i + 1) * Math.PI) / 4];
      /** @type {(angle: number, r: number, h: number) => Corner} */
      const at = (angle, r, h) => [r * Math.cos(angle), r * Math.sin(angle), h];
      this.quad(at(a, radius, low), at(b, radius, low), at(b, top, high), at(a, top, high), part);
      this.triangle(at(a, top, high), at(b, top, high), [0, 0, high], part);
    }
  }

  finish() {
    return new Float32Array(this.values);
  }
}

/**
 * Make all bodies.
 * @returns {Record<"car" | "van" | "person" | "box" | "far", Float32Array>} vertices: place and part
 */
export function makeMeshes() {
  return { car: carMesh(), van: vanMesh(), person: personMesh(), box: boxMesh(), far: farMesh() };
}

function carMesh() {
  const mesh = new MeshBuilder();
  addWheels(mesh, 0.32, 0.4);
  mesh.extrude(
    [
      [-0.5, 0.16, 0.48, PAINT_PART],
      [-0.495, 0.58, 0.47, PAINT_PART],
      [-0.4, 0.63, 0.46, PAINT_PART],
      [0.22, 0.62, 0.46, PAINT_PART],
      [0.46, 0.52, 0.45, PAINT_PART],
      [0.5, 0.44, 0.43, PAINT_PART],
      [0.5, 0.16, 0.45, PAINT_PART],
    ],
    PAINT_PART,
  );
  mesh.extrude(
    [
      [-0.42, 0.6, 0.44, GLASS],
      [-0.31, 0.98, 0.37, PAINT_PART],
      [0.05, 1, 0.37, GLASS],
      [0.25, 0.6, 0.44, GLASS],
    ],
    GLASS,
  );
  return mesh.finish();
}

function vanMesh() {
  const mesh = new MeshBuilder();
  addWheels(mesh, 0.34, 0.28);
  mesh.extrude(
    [
      [-0.5, 0.1, 0.5, PAINT_PART],
      [-0.5, 1, 0.48, PAINT_PART],
      [0.43, 1, 0.48, GLASS],
      [0.49, 0.5, 0.5, PAINT_PART],
      [0.5, 0.1, 0.5, PAINT_PART],
    ],
    PAINT_PART,
  );
  for (const side of [0.505, -0.505]) {
    mesh.side([-0.44, side, 0.55], [0.4, side, 0.55], [0.37, side * 0.97, 0.85], [-0.44, side * 0.97, 0.85], GLASS, side > 0);
  }
  mesh.triangle([0.2, 0.26, 1.005], [0.2, -0.26, 1.005], [0.38, 0, 1.005], FRONT_MARK);
  return mesh.finish();
}

function personMesh() {
  const mesh = new MeshBuilder();
  mesh.column(0.2, 0.3, 0, 0.48, TYRE);
  mesh.column(0.34, 0.46, 0.46, 0.76, PAINT_PART);
  mesh.column(0.46, 0.16, 0.76, 0.85, PAINT_PART);
  mesh.column(0.2, 0.2, 0.85, 1, SKIN);
  return mesh.finish();
}

/** First vertex of the roof of `far`, behind those of its four sides: more is not seen from above. */
export const FAR_ROOF = 24;

/** A vehicle from far away: a box with a windscreen. */
function farMesh() {
  const mesh = new MeshBuilder();
  /** @type {Corner[]} */
  const low = [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]; // prettier-ignore
  const high = low.map(([u, w]) => /** @type {Corner} */ ([u, w, 0.9]));
  low.forEach((corner, i) => mesh.quad(corner, low[(i + 1) % 4], high[(i + 1) % 4], high[i], PAINT_PART));
  mesh.quad(high[0], high[1], high[2], high[3], ROOF);
  mesh.quad([0.05, -0.42, 0.95], [0.28, -0.48, 0.95], [0.28, 0.48, 0.95], [0.05, 0.42, 0.95], GLASS);
  return mesh.finish();
}

function boxMesh() {
  const mesh = new MeshBuilder();
  mesh.extrude(
    [
      [-0.5, 0, 0.5, PAINT_PART],
      [-0.5, 1, 0.5, PAINT_PART],
      [0.5, 1, 0.5, PAINT_PART],
      [0.5, 0, 0.5, PAINT_PART],
    ],
    PAINT_PART,
  );
  return mesh.finish();
}

/**
 * @param {MeshBuilder} mesh
 * @param {number} place - of the axles, before and behind the middle
 * @param {number} height - of the wheels
 */
function addWheels(mesh, place, height) {
  for (const axle of [-place, place]) {
    for (const side of [-0.42, 0.42]) {
      const [u, w, h] = [0.075, 0.075, height];
      /** @type {(a: number, b: number, c: number) => Corner} */
      const at = (a, b, c) => [axle + a * u, side + b * w, c * h];
      for (const b of [-1, 1]) {
        mesh.side(at(-0.6, b, 0), at(0.6, b, 0), at(1, b, 0.4), at(-1, b, 0.4), TYRE, b > 0);
        mesh.side(at(-1, b, 0.4), at(1, b, 0.4), at(0.6, b, 1), at(-0.6, b, 1), TYRE, b > 0);
      }
      for (const a of [-1, 1]) {
        mesh.side(at(a, -1, 0.4), at(a, 1, 0.4), at(0.6 * a, 1, 1), at(0.6 * a, -1, 1), TYRE, a < 0);
        mesh.side(at(a, -1, 0.4), at(a, 1, 0.4), at(0.6 * a, 1, 0), at(0.6 * a, -1, 0), TYRE, a > 0);
      }
    }
  }
}
