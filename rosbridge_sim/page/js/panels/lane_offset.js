// The distance of a point to the line of its lane, from the map that the page has: it costs the server nothing.

/** @typedef {{link: string, x: number[], y: number[], left: number[], right: number[]}} LaneLine */

/** Farther from each line than this, a point is on no lane: wider than half of any lane [m]. */
const FARTHEST_LANE = 6;
/** A lane of the opposite direction counts as this much farther away [m]. */
const OPPOSITE_PENALTY = 3;
/** Length of a cell of the index: a few pieces of line in each [m]. */
const LANE_CELL = 25;

/** The lanes of a map, with an index by cells. */
export class LaneIndex {
  /** @param {LaneLine[]} lanes */
  constructor(lanes) {
    this.lanes = lanes;
    /** Pieces of lines that pass each cell, as lane and piece in turn. @type {Map<string, number[]>} */
    this.cells = new Map();
    lanes.forEach((lane, number) => this.addLane(lane, number));
  }

  /** @param {LaneLine} lane @param {number} number */
  addLane({ x, y }, number) {
    for (let piece = 0; piece + 1 < x.length; piece += 1) {
      const [x0, x1, y0, y1] = [entryAt(x, piece), entryAt(x, piece + 1), entryAt(y, piece), entryAt(y, piece + 1)];
      const east = laneCell(Math.max(x0, x1) + FARTHEST_LANE);
      const north = laneCell(Math.max(y0, y1) + FARTHEST_LANE);
      for (let column = laneCell(Math.min(x0, x1) - FARTHEST_LANE); column <= east; column += 1) {
        for (let row = laneCell(Math.min(y0, y1) - FARTHEST_LANE); row <= north; row += 1) {
          const key = `${column},${row}`;
          const pieces = this.cells.get(key);
          if (pieces) {
            pieces.push(number, piece);
          } else {
            this.cells.set(key, [number, piece]);
          }
        }
      }
    }
  }

  /**
   * Find the lane of a point.
   * @param {number} x [m] @param {number} y [m] @param {number} heading [rad]
   * @returns {{link: string, lateral: number, heading: number} | null} lateral: left of the line is positive [m]; heading of the
   * lane [rad]; null beside the road
   */
  nearest(x, y, heading) {
    const pieces = this.cells.get(`${laneCell(x)},${laneCell(y)}`) ?? [];
    let least = Infinity;
    let found = null;
    for (let index = 0; index < pieces.length; index += 2) {
      const lane = /** @type {LaneLine} */ (this.lanes[entryAt(pieces, index)]);
      const piece = entryAt(pieces, index + 1);
      const [x0, y0] = [entryAt(lane.x, piece), entryAt(lane.y, piece)];
      const [dx, dy] = [entryAt(lane.x, piece + 1) - x0, entryAt(lane.y, piece + 1) - y0];
      const length = Math.hypot(dx, dy) || 1e-9;
      const share = Math.min(1, Math.max(0, ((x - x0) * dx + (y - y0) * dy) / length ** 2));
      const distance = Math.hypot(x - x0 - share * dx, y - y0 - share * dy);
      const isAlong = dx * Math.cos(heading) + dy * Math.sin(heading) > 0;
      const cost = distance + (isAlong ? 0 : OPPOSITE_PENALTY);
      const side = dx * (y - y0) - dy * (x - x0) >= 0 ? 1 : -1;
      const reach = side > 0 ? entryAt(lane.left, piece) : entryAt(lane.right, piece);
      if (cost < least && distance <= Math.min(FARTHEST_LANE, Math.abs(reach) + 0.5)) {
        least = cost;
        found = { link: lane.link, lateral: side * distance, heading: Math.atan2(dy, dx) };
      }
    }
    return found;
  }
}

/** @param {number} metres */
function laneCell(metres) {
  return Math.floor(metres / LANE_CELL);
}

/** @param {ArrayLike<number>} list @param {number} index */
function entryAt(list, index) {
  return list[index] ?? 0;
}
