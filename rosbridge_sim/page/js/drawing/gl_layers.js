/** Things that are drawn, with their buffers on the graphics card. */

import { PIECE_FLOATS } from "../scene/line_buffer.js";

/** @param {WebGL2RenderingContext} gl @param {ArrayLike<number>} values @param {number} target */
function makeBuffer(gl, values, target) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(target, buffer);
  gl.bufferData(target, /** @type {Float32Array} */ (values), gl.STATIC_DRAW);
  return buffer;
}

/**
 * Make a vertex array of buffers of floats.
 * @param {WebGL2RenderingContext} gl
 * @param {[WebGLBuffer | null, number[], number][]} parts - each a buffer, the sizes of its attributes in turn, and their divisor
 * @param {WebGLBuffer | null} [indices]
 */
export function makeVertexArray(gl, parts, indices = null) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  let place = 0;
  for (const [buffer, sizes, divisor] of parts) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    const stride = 4 * sizes.reduce((sum, size) => sum + size, 0);
    let offset = 0;
    for (const size of sizes) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
      gl.vertexAttribDivisor(place, divisor);
      offset += 4 * size;
      place += 1;
    }
  }
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
  gl.bindVertexArray(null);
  return array;
}

/** Triangles that never change. */
export class SurfaceLayer {
  /** @param {WebGL2RenderingContext} gl @param {import("../scene/surface_buffer.js").Surface} surface */
  constructor(gl, { vertices, indices }) {
    this.gl = gl;
    this.count = indices.length;
    this.buffers = [makeBuffer(gl, vertices, gl.ARRAY_BUFFER), makeBuffer(gl, indices, gl.ELEMENT_ARRAY_BUFFER)];
    this.array = makeVertexArray(gl, [[this.buffers[0] ?? null, [4], 0]], this.buffers[1]);
  }

  draw() {
    if (this.count > 0) {
      this.gl.bindVertexArray(this.array);
      this.gl.drawElements(this.gl.TRIANGLES, this.count, this.gl.UNSIGNED_INT, 0);
    }
  }

  delete() {
    this.buffers.forEach((buffer) => this.gl.deleteBuffer(buffer));
    this.gl.deleteVertexArray(this.array);
  }
}

/** A buffer of instances that is filled again and again. */
class InstanceBuffer {
  /** @param {WebGL2RenderingContext} gl @param {number} floats - of one instance */
  constructor(gl, floats) {
    this.gl = gl;
    this.floats = floats;
    this.buffer = gl.createBuffer();
    this.capacity = 0;
    this.count = 0;
  }

  /** @param {Float32Array} values @param {number} count - instances */
  fill(values, count) {
    const { gl } = this;
    this.count = count;
    if (count === 0) {
      return;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    if (count > this.capacity) {
      this.capacity = Math.ceil(1.25 * count);
      gl.bufferData(gl.ARRAY_BUFFER, 4 * this.floats * this.capacity, gl.DYNAMIC_DRAW);
    }
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, values, 0, count * this.floats);
  }
}

/** Lines, as pieces of `LineBuffer`. */
export class LineLayer {
  /** @param {WebGL2RenderingContext} gl @param {Float32Array} [values] */
  constructor(gl, values) {
    this.gl = gl;
    this.corners = makeBuffer(gl, new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]), gl.ARRAY_BUFFER);
    this.pieces = new InstanceBuffer(gl, PIECE_FLOATS);
    this.array = makeVertexArray(gl, [[this.corners, [2], 0], [this.pieces.buffer, [3, 3, 4, 2], 1]]);
    if (values) {
      this.fill(values);
    }
  }

  /** @param {Float32Array} values */
  fill(values) {
    this.pieces.fill(values, values.length / PIECE_FLOATS);
  }

  draw() {
    if (this.pieces.count > 0) {
      this.gl.bindVertexArray(this.array);
      this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, this.pieces.count);
    }
  }

  delete() {
    this.gl.deleteBuffer(this.corners);
    this.gl.deleteBuffer(this.pieces.buffer);
    this.gl.deleteVertexArray(this.array);
  }
}

/** Floats of one entity: place and roll, body, looks, direction and pitch, colour. */
export const ENTITY_FLOATS = 16;

/** Entities with one mesh, and the rectangles of their shadows. */
export class EntityLayer {
  /**
   * @param {WebGL2RenderingContext} gl @param {Float32Array} mesh
   * @param {readonly [number, number]} lampHeight - where lamps are, as shares of the height
   */
  constructor(gl, mesh, lampHeight) {
    this.gl = gl;
    this.lampHeight = lampHeight;
    this.numVertices = mesh.length / 4;
    this.entities = new InstanceBuffer(gl, ENTITY_FLOATS);
    this.bodies = this.makeArray(mesh);
    this.shadows = this.makeArray(new Float32Array([-0.5, -0.5, 0, 0, 0.5, -0.5, 0, 0, -0.5, 0.5, 0, 0, 0.5, 0.5, 0, 0]));
    this.values = new Float32Array(64 * ENTITY_FLOATS);
    this.count = 0;
  }

  /** Begin to fill it anew. */
  clear() {
    this.count = 0;
  }

  /** @returns {number} index of the next entity's first value in `values` */
  next() {
    const at = this.count * ENTITY_FLOATS;
    if (at + ENTITY_FLOATS > this.values.length) {
      const larger = new Float32Array(2 * this.values.length);
      larger.set(this.values);
      this.values = larger;
    }
    this.count += 1;
    return at;
  }

  upload() {
    this.entities.fill(this.values, this.count);
  }

  /** @param {number} first - vertex from which on the body is drawn */
  draw(first) {
    if (this.count > 0) {
      this.gl.bindVertexArray(this.bodies);
      this.gl.drawArraysInstanced(this.gl.TRIANGLES, first, this.numVertices - first, this.count);
    }
  }

  drawShadows() {
    if (this.count > 0) {
      this.gl.bindVertexArray(this.shadows);
      this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, this.count);
    }
  }

  /** @param {Float32Array} vertices */
  makeArray(vertices) {
    const { gl, entities } = this;
    return makeVertexArray(gl, [[makeBuffer(gl, vertices, gl.ARRAY_BUFFER), [4], 0], [entities.buffer, [4, 4, 4, 4], 1]]);
  }
}

/** A triangle over the whole screen. */
export class ScreenLayer {
  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    this.array = makeVertexArray(gl, [[makeBuffer(gl, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.ARRAY_BUFFER), [2], 0]]);
  }

  draw() {
    this.gl.bindVertexArray(this.array);
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }
}
