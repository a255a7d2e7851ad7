/** The static scene as triangles, in pages of `/sim/scene/mesh`: the same that cameras and lidars see. */

/** Longest wait for a page [ms]: the server makes the mesh when it is first asked for, in seconds. */
const MESH_TIMEOUT = 120_000;
/** Bytes of a vertex for the graphics card: x, y, z in steps (int16), two that align, red, green, blue and layer. */
export const MESH_STRIDE = 12;
/** Triangles of these classes are painted on others: lines, crosswalks, stop lines. */
const PAINT_CLASSES = [2, 3, 4, 5, 6];
/** Their layer above the road, as of shaders.js. */
const PAINT_LAYER = 2;
/** Towards the sun, and the light in shade. */
const SUN = [0.34, 0.25, 0.91];
const SHADE = 0.68;

/**
 * A part of the scene, ready for the graphics card: three vertices of MESH_STRIDE bytes for each triangle.
 * @typedef {{x: number, y: number, z: number, scale: number[], radius: number, vertices: ArrayBuffer}} MeshPart
 *   x, y, z: of its middle in the map's frame [m]; scale: length of a step along x, y, z [m]; radius: around it [m]
 */

/**
 * Load the mesh of a map.
 * @param {{call: (service: string, request: object, options: {timeoutMs: number}) => Promise<any>}} connection
 * @param {string} mapDigest @returns {Promise<MeshPart[]>} rejects with the server's reason, or if the map has changed
 */
export async function loadMesh(connection, mapDigest) {
  /** @type {MeshPart[]} */
  const parts = [];
  let digest = "";
  for (let page = 0, numPages = 1; page < numPages; page += 1) {
    const answer = await connection.call("/sim/scene/mesh", { page }, { timeoutMs: MESH_TIMEOUT });
    if (!answer.result || answer.map_digest !== mapDigest || (page > 0 && answer.digest !== digest)) {
      throw new Error(answer.message || "the map has changed");
    }
    ({ digest, num_pages: numPages } = answer);
    parts.push(unpackMesh(answer, await inflate(meshBytes(answer.data))));
  }
  return parts;
}

/** @param {any} page - of `/sim/scene/mesh` @param {ArrayBuffer} data - its data, without compression @returns {MeshPart} */
export function unpackMesh(page, data) {
  const { num_vertices: numVertices, num_triangles: numTriangles } = page;
  const steps = new Int16Array(data, 0, 3 * numVertices);
  const corners = new Uint16Array(data, 6 * numVertices, 3 * numTriangles);
  const colours = new Uint8Array(data, 6 * (numVertices + numTriangles), numTriangles);
  const palette = meshBytes(page.palette);
  const scale = [page.scale_x, page.scale_y, page.scale_z];
  const vertices = new ArrayBuffer(3 * MESH_STRIDE * numTriangles);
  const [places, looks] = [new Int16Array(vertices), new Uint8Array(vertices)];
  for (let row = 0; row < numTriangles; row += 1) {
    const [a, b, c] = [3 * corners[3 * row], 3 * corners[3 * row + 1], 3 * corners[3 * row + 2]];
    const [u, v] = [b, c].map((end) => scale.map((step, i) => step * (steps[end + i] - steps[a + i])));
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const size = Math.max(Math.hypot(...normal), 1e-12) * (normal[2] < 0 ? -1 : 1); // both sides are seen, the upper one more
    const towards = normal.reduce((sum, part, i) => sum + part * SUN[i], 0) / size;
    const light = SHADE + (1 - SHADE) * Math.max(towards, 0);
    const look = 4 * colours[row];
    const layer = PAINT_CLASSES.includes(palette[look + 3]) ? PAINT_LAYER : 0;
    for (const [k, corner] of [a, b, c].entries()) {
      const at = MESH_STRIDE * (3 * row + k);
      places.set([steps[corner], steps[corner + 1], steps[corner + 2]], at / 2);
      looks.set([palette[look] * light, palette[look + 1] * light, palette[look + 2] * light, layer], at + 8);
    }
  }
  const radius = Math.hypot(...[0, 1, 2].map((i) => steps.reduce((most, step, at) => (at % 3 === i ? Math.max(most, Math.abs(step)) : most), 0) * scale[i]));
  return { x: page.x, y: page.y, z: page.z, scale, radius, vertices };
}

/** @param {string | Uint8Array} data - `uint8[]` of the wire: base64 in JSON */
function meshBytes(data) {
  return typeof data === "string" ? Uint8Array.from(atob(data), (character) => character.charCodeAt(0)) : data;
}

/** @param {Uint8Array<any>} data - of zlib */
function inflate(data) {
  return new Response(new Blob([data]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}
