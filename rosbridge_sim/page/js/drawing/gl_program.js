/** A program of the graphics card with its uniforms. */

/** A linked program. */
export class GlProgram {
  /**
   * @param {WebGL2RenderingContext} gl @param {{vertex: string, fragment: string}} sources
   * @throws {Error} it does not compile; the text has the driver's reason
   */
  constructor(gl, sources) {
    this.gl = gl;
    const program = gl.createProgram();
    for (const [type, source] of /** @type {const} */ ([
      [gl.VERTEX_SHADER, sources.vertex],
      [gl.FRAGMENT_SHADER, sources.fragment],
    ])) {
      const shader = gl.createShader(type);
      if (shader === null) {
        throw new Error("the graphics context is lost");
      }
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(`a shader does not compile: ${gl.getShaderInfoLog(shader)}`);
      }
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`a program does not link: ${gl.getProgramInfoLog(program)}`);
    }
    this.program = program;
    /** @type {Map<string, WebGLUniformLocation | null>} */
    this.places = new Map();
  }

  use() {
    this.gl.useProgram(this.program);
  }

  /**
   * Set uniforms. A number is a float, a list of 2 to 4 a vector, 16 numbers a matrix, a longer list an array of
   * three-vectors.
   * @param {Record<string, number | ArrayLike<number>>} values
   */
  set(values) {
    const { gl } = this;
    for (const [name, value] of Object.entries(values)) {
      const place = this.placeOf(name);
      if (typeof value === "number") {
        gl.uniform1f(place, value);
      } else if (value.length === 2) {
        gl.uniform2f(place, value[0], value[1]);
      } else if (value.length === 3) {
        gl.uniform3f(place, value[0], value[1], value[2]);
      } else if (value.length === 4) {
        gl.uniform4f(place, value[0], value[1], value[2], value[3]);
      } else if (value.length === 16) {
        gl.uniformMatrix4fv(place, false, /** @type {Float32Array} */ (value));
      } else {
        gl.uniform3fv(place, /** @type {Float32Array} */ (value));
      }
    }
  }

  /** @param {string} name */
  placeOf(name) {
    let place = this.places.get(name);
    if (place === undefined) {
      place = this.gl.getUniformLocation(this.program, name);
      this.places.set(name, place);
    }
    return place;
  }
}
