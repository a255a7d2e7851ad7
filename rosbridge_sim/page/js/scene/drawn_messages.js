/**
 * Messages that programs publish about their plans, as lines, points and texts of the map. A message names a frame; the
 * matrix of this frame takes its places to the map. What is not finite, or more than the limits, is left out.
 */

import { LineBuffer } from "./line_buffer.js";
import { packedColour } from "./materials.js";

/** @typedef {Float64Array<ArrayBuffer>} Matrix - of 12 numbers: nine of the rotation, row by row, then the place */
/** @typedef {{x: number, y: number, z: number}} Vector */
/** @typedef {{position: Vector, orientation: Vector & {w: number}}} Pose */
/** @typedef {{r: number, g: number, b: number, a: number}} Colour - each from 0 to 1 */

/** The most that one topic may draw. */
export const MOST_DRAWN = { pieces: 20_000, points: 20_000, texts: 20, markers: 2_000 };
/** A point is its place, its colour, 0 and its size on the screen [pixels]. */
const POINT_NUMBERS = 6;
const POINT_PIXELS = 2.5;
/** Sizes of what has none: lines of a path, and the arrow of a pose [m]. */
const PATH_WIDTH = 0.25;
const POSE_LENGTH = 3;
const ARROW_HEAD = 0.3;
/** Numbers of `visualization_msgs/Marker`. */
const MARKER = { arrow: 0, cube: 1, sphere: 2, cylinder: 3, strip: 4, list: 5, cubes: 6, spheres: 7, points: 8, text: 9, triangles: 11 };
const REMOVE = 2;
const REMOVE_ALL = 3;
/** Numbers of a field of `sensor_msgs/PointField`: the reader of a DataView for each data type, which is a method's name. */
const POINT_READERS = /** @type {const} */ (["", "getInt8", "getUint8", "getInt16", "getUint16", "getInt32", "getUint32", "getFloat32", "getFloat64"]);

export const IDENTITY = Float64Array.of(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0);

/**
 * Return the matrix of a pose. A quaternion of zeros is no turn: many programs leave it out.
 * @param {Vector} position @param {Vector & {w: number}} orientation @returns {Matrix}
 */
export function matrixOf({ x: px, y: py, z: pz }, { x, y, z, w }) {
  const size = x * x + y * y + z * z + w * w;
  const s = size > 0 ? 2 / size : 0;
  return Float64Array.of(
    1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w),
    s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w),
    s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y),
    px, py, pz,
  ); // prettier-ignore
}

/** Return the matrix that does `b`, then `a`. @param {Matrix} a @param {Matrix} b @returns {Matrix} */
export function compose(a, b) {
  const c = new Float64Array(12);
  for (let row = 0; row < 3; row += 1) {
    const [x, y, z] = a.subarray(3 * row, 3 * row + 3);
    for (let column = 0; column < 3; column += 1) {
      c[3 * row + column] = x * b[column] + y * b[3 + column] + z * b[6 + column];
    }
    c[9 + row] = x * b[9] + y * b[10] + z * b[11] + a[9 + row];
  }
  return c;
}

/**
 * The matrix of a frame at a time, between the two poses around it.
 * @param {{at: number, matrix: Matrix}[]} kept - at least one
 * @param {number} at - [s]; outside of what is kept the last one is the best guess
 */
export function matrixAt(kept, at) {
  const next = kept.findIndex((one) => one.at >= at);
  const [before, after] = next > 0 ? [kept[next - 1], kept[next]] : [kept[kept.length - 1], kept[kept.length - 1]];
  const share = after.at > before.at ? (at - before.at) / (after.at - before.at) : 1;
  return before.matrix.map((value, i) => value + share * (after.matrix[i] - value));
}

/** Drawing of one topic, relative to the origin of the map's buffers. */
export class Sketch {
  /** @param {Vector} origin @param {number} colour - packed; of all that has none of its own */
  constructor(origin, colour) {
    this.origin = origin;
    this.colour = colour;
    this.matrix = IDENTITY;
    this.lines = new LineBuffer();
    /** @type {number[]} */
    this.points = [];
    /** @type {(Vector & {text: string})[]} */
    this.texts = [];
    /** Something was left out, or has a form that is not drawn. */
    this.isCut = false;
  }

  /**
   * @param {number} x @param {number} y @param {number} z
   * @returns {[number, number, number] | null} the place relative to the origin
   */
  place(x, y, z) {
    const m = this.matrix;
    const px = m[0] * x + m[1] * y + m[2] * z + m[9] - this.origin.x;
    const py = m[3] * x + m[4] * y + m[5] * z + m[10] - this.origin.y;
    const pz = m[6] * x + m[7] * y + m[8] * z + m[11] - this.origin.z;
    return Number.isFinite(px + py + pz) ? [px, py, pz] : null;
  }

  /**
   * Add a line through points; it is broken where a point is not finite.
   * @param {Iterable<[number, number, number]>} points @param {number} [width] - [m] @param {number} [material]
   */
  line(points, width = PATH_WIDTH, material = this.colour) {
    const style = { width, minPixels: 2, material };
    let before = null;
    for (const point of points) {
      const now = this.place(...point);
      if (now !== null && before !== null) {
        if (this.lines.length >= MOST_DRAWN.pieces) {
          this.isCut = true;
          return;
        }
        this.lines.add(...before, ...now, style);
      }
      before = now;
    }
  }

  /** @param {number} x @param {number} y @param {number} z @param {number} [material] */
  point(x, y, z, material = this.colour) {
    const place = this.place(x, y, z);
    if (this.points.length >= POINT_NUMBERS * MOST_DRAWN.points) {
      this.isCut = true;
    } else if (place !== null) {
      this.points.push(...place, material, 0, POINT_PIXELS);
    }
  }

  /** Add an arrow along x. @param {number} length - [m] @param {number} [material] */
  arrow(length, material) {
    const [back, side] = [(1 - ARROW_HEAD) * length, 0.5 * ARROW_HEAD * length];
    this.line([[0, 0, 0], [length, 0, 0], [back, side, 0]], undefined, material); // prettier-ignore
    this.line([[length, 0, 0], [back, -side, 0]], undefined, material); // prettier-ignore
  }
}

/** Makers of the types that are drawn. @type {Map<string, (sketch: Sketch, message: any) => void>} */
export const DRAWN_TYPES = new Map(
  Object.entries({
    "nav_msgs/Path": (/** @type {Sketch} */ sketch, /** @type {{poses: {pose: Pose}[]}} */ { poses }) =>
      sketch.line(poses.map(({ pose: { position } }) => [position.x, position.y, position.z])),
    "geometry_msgs/PoseStamped": (/** @type {Sketch} */ sketch, /** @type {{pose: Pose}} */ { pose }) => drawPose(sketch, pose),
    "nav_msgs/Odometry": (/** @type {Sketch} */ sketch, /** @type {{pose: {pose: Pose}}} */ { pose }) => drawPose(sketch, pose.pose),
    "visualization_msgs/Marker": drawMarker,
    "visualization_msgs/MarkerArray": drawMarker,
    "sensor_msgs/LaserScan": drawScan,
    "sensor_msgs/PointCloud2": drawCloud,
  }),
);

/** @param {string} type - of a topic, in the form of ROS 1 or ROS 2 */
export function drawnType(type) {
  return type.replace("/msg/", "/");
}

/**
 * Keep the markers of a topic by their names, as a message changes them.
 * @param {Map<string, any>} kept - is changed; at most `MOST_DRAWN.markers` @param {any} message - a Marker or a MarkerArray
 * @param {(marker: any) => any} prepare - of each new marker
 */
export function keepMarkers(kept, message, prepare) {
  for (const marker of message.markers ?? [message]) {
    const key = `${marker.ns} ${marker.id}`;
    if (marker.action === REMOVE_ALL) {
      kept.clear();
    } else if (marker.action === REMOVE) {
      kept.delete(key);
    } else if (kept.has(key) || kept.size < MOST_DRAWN.markers) {
      kept.set(key, prepare(marker));
    }
  }
}

/** @param {Sketch} sketch @param {Pose} pose */
function drawPose(sketch, { position, orientation }) {
  sketch.matrix = compose(sketch.matrix, matrixOf(position, orientation));
  sketch.arrow(POSE_LENGTH);
}

/** @param {Sketch} sketch @param {any} marker */
function drawMarker(sketch, { type, pose, scale, color, points, colors, text }) {
  sketch.matrix = compose(sketch.matrix, matrixOf(pose.position, pose.orientation));
  const colourAt = (/** @type {number} */ i) => materialOf(colors[i] ?? color, sketch.colour);
  const material = materialOf(color, sketch.colour);
  const xyz = (/** @type {Vector} */ { x, y, z }) => /** @type {[number, number, number]} */ ([x, y, z]);
  switch (type) {
    case MARKER.arrow:
      if (points.length === 2) {
        sketch.line(points.map(xyz), scale.x, material);
        break;
      }
      sketch.arrow(scale.x, material);
      break;
    case MARKER.cube:
      drawBox(sketch, scale, material);
      break;
    case MARKER.sphere:
    case MARKER.cylinder:
      sketch.line(Array.from({ length: 25 }, (_, i) => [0.5 * scale.x * Math.cos((i * Math.PI) / 12), 0.5 * scale.y * Math.sin((i * Math.PI) / 12), 0]), 0.1, material);
      break;
    case MARKER.strip:
      sketch.line(points.map(xyz), scale.x, material);
      break;
    case MARKER.list:
      for (let i = 0; i + 1 < points.length; i += 2) {
        sketch.line([xyz(points[i]), xyz(points[i + 1])], scale.x, colourAt(i));
      }
      break;
    case MARKER.triangles:
      for (let i = 0; i + 2 < points.length; i += 3) {
        sketch.line([points[i], points[i + 1], points[i + 2], points[i]].map(xyz), 0.05, colourAt(i));
      }
      break;
    case MARKER.cubes:
    case MARKER.spheres:
    case MARKER.points:
      points.forEach((/** @type {Vector} */ point, /** @type {number} */ i) => sketch.point(point.x, point.y, point.z, colourAt(i)));
      break;
    case MARKER.text: {
      const place = sketch.place(0, 0, 0);
      if (place !== null && sketch.texts.length < MOST_DRAWN.texts) {
        const { x, y, z } = sketch.origin;
        sketch.texts.push({ x: place[0] + x, y: place[1] + y, z: place[2] + z, text: String(text).slice(0, 80) });
      }
      break;
    }
    default:
      sketch.isCut = true; // a mesh of a file
  }
}

/** @param {Sketch} sketch @param {Vector} scale - sides [m] @param {number} material */
function drawBox(sketch, { x, y, z }, material) {
  const [a, b, c] = [0.5 * x, 0.5 * y, 0.5 * z];
  for (const up of [-c, c]) {
    sketch.line([[a, b, up], [-a, b, up], [-a, -b, up], [a, -b, up], [a, b, up]], 0.1, material); // prettier-ignore
  }
  for (const [u, v] of [[a, b], [-a, b], [-a, -b], [a, -b]]) { // prettier-ignore
    sketch.line([[u, v, -c], [u, v, c]], 0.1, material); // prettier-ignore
  }
}

/**
 * @param {Sketch} sketch
 * @param {{angle_min: number, angle_increment: number, range_min: number, range_max: number, ranges: ArrayLike<number>}} scan
 */
function drawScan(sketch, { angle_min: first, angle_increment: step, range_min: least, range_max: most, ranges }) {
  const stride = Math.ceil(ranges.length / MOST_DRAWN.points);
  for (let i = 0; i < ranges.length; i += stride) {
    const range = ranges[i];
    if (range >= least && range <= most) {
      sketch.point(range * Math.cos(first + i * step), range * Math.sin(first + i * step), 0);
    }
  }
}

/** Draw a cloud; of a large one each second, third, ... point. @param {Sketch} sketch @param {any} cloud */
function drawCloud(sketch, { width, height, fields, is_bigendian: isBig, point_step: step, row_step: rowStep, data }) {
  if (!(data instanceof Uint8Array)) {
    return;
  }
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const readers = ["x", "y", "z", "intensity"].map((name) => {
    const field = fields.find((/** @type {{name: string}} */ one) => one.name === name);
    const method = POINT_READERS[field?.datatype ?? 0];
    const size = Number(/\d+$/.exec(method ?? "")?.[0] ?? 0) / 8;
    return method && field.offset + size <= step ? (/** @type {number} */ at) => view[method](at + field.offset, !isBig) : null;
  });
  const [x, y, z, intensity] = readers;
  const total = Number(width) * Number(height);
  const stride = Math.max(1, Math.ceil(total / MOST_DRAWN.points));
  sketch.isCut ||= stride > 1 || !x || !y;
  for (let i = 0; x && y && i < total; i += stride) {
    const at = Math.floor(i / width) * rowStep + (i % width) * step;
    if (at + step > data.length) {
      sketch.isCut = true; // shorter than its own figures say
      return;
    }
    sketch.point(x(at), y(at), z ? z(at) : 0, intensity ? intensityColour(intensity(at)) : undefined);
  }
}

/** Asphalt is dark blue, paint and plates are yellow. @param {number} intensity - of a lidar, 0 to 100 */
function intensityColour(intensity) {
  const part = (/** @type {number} */ low, /** @type {number} */ high) => low + (high - low) * Math.min(intensity / 100, 1);
  return packedColour(part(0.05, 1), part(0.35, 0.85), part(0.95, 0.1), 1);
}

/** @param {Colour | undefined} colour - transparent where a program has left it out @param {number} otherwise */
function materialOf(colour, otherwise) {
  return colour && colour.a > 0 ? packedColour(colour.r, colour.g, colour.b, colour.a) : otherwise;
}
