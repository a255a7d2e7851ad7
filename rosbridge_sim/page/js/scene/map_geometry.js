/**
 * The map as triangles and lines, made once for each map. All places are relative to an origin near the middle of the
 * map, because the graphics card counts with 24 bits.
 */

import { LineBuffer, LONGEST_PIECE, shiftLine } from "./line_buffer.js";
import { MATERIALS } from "./materials.js";
import { SurfaceBuffer } from "./surface_buffer.js";

/** @typedef {import("./map_types.js").SceneMap} SceneMap */
/** @typedef {import("./map_types.js").MapLane} MapLane */
/** @typedef {import("./surface_buffer.js").Surface} Surface */

/**
 * @typedef {object} MapGeometry
 * @property {{x: number, y: number, z: number}} origin - where the buffers have 0, in the map's frame [m]
 * @property {Surface} lanes - the surface of the road
 * @property {Surface} stripes - crosswalks
 * @property {Surface} arrows - directions of lanes, for a near look
 * @property {Float32Array} lines - painted lines and stop lines
 * @property {Float32Array} spines - a line for each lane, for a map on which lanes are thinner than a pixel
 */

/** Width of a painted line [m], and its least width on the screen [pixels]. */
const PAINT = { width: 0.15, minPixels: 1.1 };
/** Between the two lines of a double line [m], as painted: a hand's breadth. */
const DOUBLE_GAP = 0.3;
/** Dash and period of a broken line [m]: 3 m of paint and 5 m of road, as in towns. */
const BROKEN = { dash: 3, period: 8 };
/** Types of MGeo: an edge of the road, and a stop line (they are drawn from `stop_lines`). */
const STOP_BORDER = 530;

/** Make the geometry of a map. @param {SceneMap} map @returns {MapGeometry} */
export function makeMapGeometry(map) {
  const origin = originOf(map);
  const kinds = laneKinds(map);
  const lanes = new SurfaceBuffer();
  const arrows = new SurfaceBuffer();
  const stripes = new SurfaceBuffer();
  const lines = new LineBuffer();
  const spines = new LineBuffer();
  const byKind = map.lanes.map((lane, row) => ({ lane: divided(moved(lane, origin)), kind: kinds[row] }));
  byKind.sort((a, b) => a.kind - b.kind); // lanes, then intersections over them, then dead ends
  for (const { lane, kind } of byKind) {
    const left = shiftLine(lane.x, lane.y, lane.left);
    const right = shiftLine(lane.x, lane.y, lane.right.map((width) => -width));
    lanes.addBand(left, right, lane.z, kind);
    spines.addLine(lane.x, lane.y, lane.z, { width: 0.9 * lane.width, minPixels: 1.2, material: kind });
    addArrows(arrows, lane);
    if (map.borders.length === 0 && kind !== MATERIALS.inside) {
      for (const side of [left, right]) {
        lines.addLine(side.x, side.y, lane.z, { ...PAINT, material: MATERIALS.edge });
      }
    }
  }
  for (const border of map.borders) {
    if (border.type !== STOP_BORDER || map.stop_lines.length === 0) {
      addBorder(lines, { ...border, ...moved(border, origin) });
    }
  }
  for (const crosswalk of map.crosswalks) {
    for (const part of crosswalk.parts) {
      addCrosswalk(stripes, lines, moved(part, origin));
    }
  }
  for (const stop of map.stop_lines) {
    const { x, y, z } = moved(stop, origin);
    lines.addLine(x, y, z, { width: 0.45, minPixels: 1.8, material: MATERIALS.stop });
  }
  return {
    origin,
    lanes: lanes.finish(),
    stripes: stripes.finish(),
    arrows: arrows.finish(),
    lines: lines.view().slice(),
    spines: spines.view().slice(),
  };
}

/**
 * Tell each lane's kind: ordinary, inside an intersection, or dead end.
 * @param {SceneMap} map @returns {number[]} its material
 */
export function laneKinds(map) {
  const stops = new Set(map.stop_lines.map((stop) => stop.link));
  const inside = new Set(map.lanes.filter((lane) => stops.has(lane.link)).flatMap((lane) => lane.successors));
  return map.lanes.map((lane) => {
    if (lane.successors.length === 0) {
      return MATERIALS.deadEnd;
    }
    return lane.light !== "" || inside.has(lane.link) ? MATERIALS.inside : MATERIALS.lane;
  });
}

/** @param {SceneMap} map */
function originOf(map) {
  return { x: Math.round((map.west + map.east) / 2), y: Math.round((map.south + map.north) / 2), z: 0 };
}

/**
 * @template {{x: number[], y: number[], z: number[]}} Line @param {Line} line @param {{x: number, y: number, z: number}} origin
 * @returns {Line}
 */
function moved(line, origin) {
  return {
    ...line,
    x: line.x.map((value) => value - origin.x),
    y: line.y.map((value) => value - origin.y),
    z: line.z.map((value) => value - origin.z),
  };
}

/** Return a lane with more points where they are far apart. @param {MapLane} lane @returns {MapLane} */
function divided(lane) {
  const columns = /** @type {const} */ (["x", "y", "z", "left", "right"]);
  /** @type {MapLane} */
  const finer = { ...lane, x: [], y: [], z: [], left: [], right: [] };
  lane.x.forEach((x, i) => {
    const length = i === 0 ? 0 : Math.hypot(x - lane.x[i - 1], lane.y[i] - lane.y[i - 1]);
    const num = Math.max(1, Math.ceil(length / LONGEST_PIECE));
    for (let k = i === 0 ? num : 1; k <= num; k += 1) {
      for (const name of columns) {
        const column = lane[name];
        finer[name].push(k === num ? column[i] : column[i - 1] + (k / num) * (column[i] - column[i - 1]));
      }
    }
  });
  return finer;
}

/**
 * Add a painted line, or two beside each other, by their shapes and colours from left to right.
 * @param {LineBuffer} lines @param {import("./map_types.js").MapBorder} border
 */
function addBorder(lines, border) {
  const num = Math.max(border.shape.length, 1);
  for (let i = 0; i < num; i += 1) {
    const offset = (0.5 * (num - 1) - i) * DOUBLE_GAP;
    const { x, y } = offset === 0 ? border : shiftLine(border.x, border.y, offset);
    const isBroken = /broken|dash/i.test(border.shape[i] ?? "");
    const colour = border.colour[Math.min(i, border.colour.length - 1)] ?? "white";
    lines.addLine(x, y, border.z, { ...PAINT, ...(isBroken ? BROKEN : {}), material: paintOf(colour) });
  }
}

/** @param {string} colour */
function paintOf(colour) {
  const name = colour.toLowerCase();
  return name === "yellow" ? MATERIALS.yellow : name === "blue" ? MATERIALS.blue : MATERIALS.edge;
}

/**
 * Add a crosswalk: stripes along the driving direction if it has four corners, and its outline.
 * @param {SurfaceBuffer} stripes @param {LineBuffer} lines @param {{x: number[], y: number[], z: number[]}} area
 */
function addCrosswalk(stripes, lines, area) {
  /** @type {[number, number, number][]} */
  let corners = area.x.map((x, i) => [x, area.y[i], area.z[i]]);
  const [head, tail] = [corners[0], corners[corners.length - 1]];
  if (corners.length > 1 && head[0] === tail[0] && head[1] === tail[1]) {
    corners.pop();
  }
  if (corners.length !== 4) {
    lines.addLine(area.x, area.y, area.z, { ...PAINT, material: MATERIALS.stripes }, { isClosed: true });
    return;
  }
  const side = (/** @type {number} */ i) =>
    Math.hypot(corners[(i + 1) % 4][0] - corners[i][0], corners[(i + 1) % 4][1] - corners[i][1]);
  if (side(0) + side(2) < side(1) + side(3)) {
    corners = [...corners.slice(1), corners[0]];
  }
  const [a, b, c, d] = corners; // people walk from a to b, and in parallel from d to c
  const num = Math.max(1, Math.round(Math.hypot(b[0] - a[0], b[1] - a[1])));
  for (let i = 0; i < num; i += 1) {
    const [first, last] = [(i + 0.2) / num, (i + 0.7) / num];
    stripes.addFan([between(a, b, first), between(a, b, last), between(d, c, last), between(d, c, first)], MATERIALS.stripes);
  }
}

/**
 * @param {[number, number, number]} a @param {[number, number, number]} b @param {number} share
 * @returns {[number, number, number]}
 */
function between(a, b, share) {
  return [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])];
}

/** From arrow to arrow on a long lane, and the longest arrow [m]. */
const ARROW_APART = 40;
const LONGEST_ARROW = 3;

/** Add arrows in the direction of a lane. @param {SurfaceBuffer} arrows @param {MapLane} lane - relative to the origin */
function addArrows(arrows, lane) {
  const size = Math.min(LONGEST_ARROW, 0.25 * lane.length);
  const num = Math.max(1, Math.floor(lane.length / ARROW_APART));
  if (size < 1) {
    return;
  }
  for (let i = 0; i < num; i += 1) {
    // Before the middle, so that the arrows of two opposite lanes are not side by side.
    const place = pointAlong(lane, ((i + 0.42) * lane.length) / num);
    if (place !== null) {
      addArrow(arrows, place, size);
    }
  }
}

/**
 * @param {SurfaceBuffer} arrows @param {{x: number, y: number, z: number, dx: number, dy: number}} place
 * @param {number} size - [m]
 */
function addArrow(arrows, { x, y, z, dx, dy }, size) {
  /** @type {(u: number, v: number) => [number, number, number]} */
  const corner = (u, v) => [x + size * (u * dx - v * dy), y + size * (u * dy + v * dx), z];
  arrows.addFan([corner(-0.5, 0.05), corner(-0.5, -0.05), corner(0.1, -0.05), corner(0.1, 0.05)], MATERIALS.arrow);
  arrows.addFan([corner(0.1, 0.17), corner(0.1, -0.17), corner(0.5, 0)], MATERIALS.arrow);
}

/**
 * Return the point at a distance along a line, with its direction.
 * @param {{x: ArrayLike<number>, y: ArrayLike<number>, z: ArrayLike<number>}} line @param {number} distance - [m]
 * @returns {{x: number, y: number, z: number, dx: number, dy: number} | null} null: the line has no length
 */
export function pointAlong({ x, y, z }, distance) {
  let left = distance;
  let last = null;
  for (let i = 0; i + 1 < x.length; i += 1) {
    const length = Math.hypot(x[i + 1] - x[i], y[i + 1] - y[i]);
    if (length > 0) {
      const [dx, dy] = [(x[i + 1] - x[i]) / length, (y[i + 1] - y[i]) / length];
      const share = Math.min(1, Math.max(0, left) / length);
      last = { x: x[i] + share * length * dx, y: y[i] + share * length * dy, z: z[i] + share * (z[i + 1] - z[i]), dx, dy };
      if (left <= length) {
        return last;
      }
      left -= length;
    }
  }
  return last;
}
