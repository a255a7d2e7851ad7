/** Drawings of topics of programs, as lines and points of the graphics card. */

import { GlProgram } from "./gl_program.js";
import { LineLayer } from "./gl_layers.js";
import { PointLayer } from "./point_layer.js";
import { COLOUR, FOG, HEAD, LAYER } from "./shaders.js";

/** Points of clouds: squares of one size on the screen. */
const PLAN_POINT_SHADERS = {
  vertex: `${HEAD}${LAYER}${COLOUR}
layout(location = 0) in vec3 vertex;
layout(location = 1) in vec3 point; // colour, nothing, pixels
uniform mat4 view;
uniform float ratio;
flat out vec4 colour;
void main() {
  colour = colourOf(point.x);
  gl_PointSize = max(point.z * ratio, 1.0);
  gl_Position = lifted(view * vec4(vertex, 1.0));
}`,
  fragment: `${HEAD}${FOG}
flat in vec4 colour;
out vec4 result;
void main() { result = vec4(fade(colour.rgb), colour.a); }`,
};

/** Draws the sketches of all topics. */
export class PlanLayer {
  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    this.program = new GlProgram(gl, PLAN_POINT_SHADERS);
    this.lines = new LineLayer(gl);
    this.points = new PointLayer(gl, 3);
    this.version = -1;
    /** @type {object | null} */
    this.origin = null;
  }

  /**
   * Fill the buffers, if something has changed.
   * @param {import("../scene/drawn_topics.js").DrawnTopics} drawn @param {{x: number, y: number, z: number}} origin
   */
  fill(drawn, origin) {
    if (this.version === drawn.version && this.origin === origin) {
      return;
    }
    const sketches = drawn.sketches(origin);
    this.version = drawn.version;
    this.origin = origin;
    const pieces = sketches.map(({ lines }) => lines.view());
    const values = new Float32Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
    let at = 0;
    for (const piece of pieces) {
      values.set(piece, at);
      at += piece.length;
    }
    this.lines.fill(values);
    this.points.fill(Float32Array.from(sketches.flatMap(({ points }) => points)));
  }

  /**
   * Draw; from above nothing hides it, because many programs leave z at 0.
   * @param {GlProgram} lineProgram @param {Record<string, any>} uniforms
   */
  draw(lineProgram, uniforms) {
    const { gl, program, points } = this;
    if (uniforms.fog[3] === 0) {
      gl.disable(gl.DEPTH_TEST);
    }
    lineProgram.use();
    lineProgram.set({ ...uniforms, layer: 5, opacity: 1 });
    this.lines.draw();
    if (points.count > 0) {
      program.use();
      program.set({ ...uniforms, layer: 5 });
      points.draw();
    }
    gl.enable(gl.DEPTH_TEST);
  }
}
