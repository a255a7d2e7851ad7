/** Points: heads of traffic lights, and those of programs and sensors. */

import { NUM_MATERIALS } from "../scene/materials.js";
import { makeVertexArray } from "./gl_layers.js";
import { FOG, HEAD } from "./shaders.js";

/** Points, each with its place and some more numbers. */
export class PointLayer {
  /** @param {WebGL2RenderingContext} gl @param {number} looks - numbers of a point behind its place */
  constructor(gl, looks) {
    this.gl = gl;
    this.floats = 3 + looks;
    this.buffer = gl.createBuffer();
    this.array = makeVertexArray(gl, [[this.buffer, [3, looks], 0]]);
    this.count = 0;
  }

  /** @param {Float32Array} values */
  fill(values) {
    this.count = values.length / this.floats;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, values, this.gl.DYNAMIC_DRAW);
  }

  draw() {
    if (this.count > 0) {
      this.gl.bindVertexArray(this.array);
      this.gl.drawArrays(this.gl.POINTS, 0, this.count);
    }
  }
}

/** Heads of traffic lights: a disc for red, a diamond for yellow, an arrow for green, so that not colour alone tells. */
export const HEAD_SHADERS = {
  vertex: `${HEAD}
layout(location = 0) in vec3 vertex;
layout(location = 1) in vec3 light; // material, direction, least pixels
uniform mat4 view;
uniform float pixel;
uniform float ratio; // of the screen's pixels to those of the page
uniform float spin; // turn of the picture; above 50 the arrows point upwards
uniform vec3 palette[${NUM_MATERIALS}];
flat out vec3 colour;
flat out float shape;
flat out vec2 turn;
flat out float sharp;
void main() {
  gl_Position = view * vec4(vertex, 1.0);
  if (spin > 50.0) gl_Position.z -= 0.8 / max(gl_Position.w, 0.5); // by 1 m, before the housing of the scene's mesh
  float unit = pixel * max(gl_Position.w, 0.01);
  float size = clamp(1.5 / unit, light.z, 26.0);
  gl_PointSize = size * ratio;
  sharp = 2.5 / (size * ratio);
  colour = palette[int(light.x)];
  shape = light.x - 13.0;
  float angle = spin > 50.0 ? 1.5708 : light.y + spin;
  turn = vec2(cos(angle), sin(angle));
}`,
  fragment: `${HEAD}${FOG}
flat in vec3 colour;
flat in float shape;
flat in vec2 turn;
flat in float sharp;
out vec4 result;
void main() {
  vec2 at = vec2(2.0 * gl_PointCoord.x - 1.0, 1.0 - 2.0 * gl_PointCoord.y);
  vec2 p = vec2(turn.x * at.x + turn.y * at.y, turn.x * at.y - turn.y * at.x);
  float round = length(at);
  float inner = 0.62 - round; // above 0 inside
  if (shape == 2.0) inner = 0.72 - abs(at.x) - abs(at.y);
  if (shape == 3.0) inner = min(0.62 - p.x - 0.0, min(p.x + 0.5, 0.5 * (0.72 - p.x) - abs(p.y)));
  if (shape == 0.0) inner = 0.28 - round;
  float disc = 1.0 - smoothstep(0.98 - sharp, 0.98, round);
  vec3 ground = vec3(0.08, 0.09, 0.10);
  vec3 lit = shape == 0.0 ? vec3(0.42) : colour;
  result = vec4(fade(mix(ground, lit, smoothstep(-0.5 * sharp, 0.5 * sharp, inner))), disc);
}`,
};
