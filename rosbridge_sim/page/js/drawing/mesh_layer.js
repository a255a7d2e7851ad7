/** The static scene, for the camera behind the car: the mesh that cameras and lidars see. */

import { MESH_STRIDE } from "../scene/mesh_loader.js";
import { FOG, HEAD } from "./shaders.js";

/** It is drawn up to here; farther away the fog hides it [m]. */
const FARTHEST_MESH = 1000;
/** The scene's mesh: places in steps of its part; the light of the sun is in its colours. */
export const MESH_SHADERS = {
  vertex: `${HEAD}
layout(location = 0) in vec3 steps;
layout(location = 1) in vec4 look; // colour, and the layer as a 255th
uniform mat4 view;
uniform vec3 middle, scale;
uniform float lift, light;
flat out vec3 colour;
void main() {
  colour = look.rgb * light;
  gl_Position = view * vec4(steps * scale + middle, 1.0);
  gl_Position.z -= 255.0 * look.a * (4e-6 * gl_Position.w + lift);
}`,
  fragment: `${HEAD}${FOG}
flat in vec3 colour;
out vec4 result;
void main() { result = vec4(fade(colour), 1.0); }`,
};

/** Parts of the scene's mesh. */
export class MeshLayer {
  /** @param {WebGL2RenderingContext} gl @param {import("../scene/mesh_loader.js").MeshPart[]} parts */
  constructor(gl, parts) {
    this.gl = gl;
    this.parts = parts.map((part) => {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, part.vertices, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.SHORT, false, MESH_STRIDE, 0);
      gl.enableVertexAttribArray(1);
      gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, MESH_STRIDE, 8);
      gl.bindVertexArray(null);
      const { x, y, z, scale, radius, vertices } = part;
      return { array, buffer, place: { x, y, z }, scale, radius, count: vertices.byteLength / MESH_STRIDE };
    });
  }

  /**
   * Draw the parts that are on the screen.
   * @param {import("./gl_program.js").GlProgram} program @param {{x: number, y: number, z: number}} origin
   * @param {ArrayLike<number>} view - from buffers to the clip space
   */
  draw(program, origin, view) {
    const [across, upwards] = [Math.hypot(view[0], view[4], view[8]), Math.hypot(view[1], view[5], view[9])];
    for (const { array, place, scale, radius, count } of this.parts) {
      const middle = [place.x - origin.x, place.y - origin.y, place.z - origin.z];
      const [cx, cy, , cw] = [0, 1, 2, 3].map((i) => view[i] * middle[0] + view[4 + i] * middle[1] + view[8 + i] * middle[2] + view[12 + i]);
      const isSeen = cw > -radius && cw < FARTHEST_MESH + radius && Math.abs(cx) <= cw + radius * (1 + across) && Math.abs(cy) <= cw + radius * (1 + upwards);
      if (isSeen) {
        program.set({ middle, scale });
        this.gl.bindVertexArray(array);
        this.gl.drawArrays(this.gl.TRIANGLES, 0, count);
      }
    }
  }

  delete() {
    for (const { array, buffer } of this.parts) {
      this.gl.deleteBuffer(buffer);
      this.gl.deleteVertexArray(array);
    }
  }
}
