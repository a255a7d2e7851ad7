/** Trails: the places where the egos and the selected entity have been. */

/** @typedef {import("./store.js").SceneState} SceneState */

/** Points of a trail, and the shortest distance between two of them [m]: the last 600 m or so of a way. */
const TRAIL_POINTS = 600;
const TRAIL_STEP = 1;
/** More metres than this beside what the speed explains are a jump, and begin a new trail [m]. */
const TRAIL_JUMP = 3;
/** More trails than this would hide the map. */
const MOST_TRAILS = 8;

/** The last points of one entity, the oldest first. */
export class Trail {
  constructor() {
    /** @type {number[]} */
    this.points = []; // x, y, z of each
  }

  get length() {
    return this.points.length / 3;
  }

  /**
   * Add a place, if it is far enough from the last one.
   * @param {number} x @param {number} y @param {number} z @param {number} longest - distance above which it is a jump [m]
   */
  add(x, y, z, longest) {
    const { points } = this;
    const num = points.length;
    if (num > 0) {
      const away = Math.hypot(x - points[num - 3], y - points[num - 2]);
      if (away > longest) {
        points.length = 0;
      } else if (away < TRAIL_STEP) {
        return;
      }
    }
    points.push(x, y, z);
    if (points.length > 3 * TRAIL_POINTS) {
      points.splice(0, points.length - 3 * TRAIL_POINTS);
    }
  }
}

/** All trails. */
export class Trails {
  constructor() {
    /** By the entity: the sign tells an ego from an object. @type {Map<number, Trail>} */
    this.trails = new Map();
    this.frame = -1;
    this.digest = "";
  }

  /** Take a new state. @param {SceneState} state @param {number} selectedRow - -1: nothing is selected */
  take(state, selectedRow) {
    if (state.frame < this.frame || state.map_digest !== this.digest) {
      this.trails.clear(); // a reset, a snapshot or another map
    }
    const seconds = 0.02 * Math.max(state.frame - this.frame, 1);
    this.frame = state.frame;
    this.digest = state.map_digest;
    const kept = new Set();
    for (let row = 0; row < state.kind.length; row += 1) {
      if ((state.kind[row] === 0 || row === selectedRow) && kept.size < MOST_TRAILS) {
        const key = state.kind[row] === 0 ? -1 - state.id[row] : state.id[row];
        kept.add(key);
        const trail = this.trails.get(key) ?? new Trail();
        this.trails.set(key, trail);
        trail.add(state.x[row], state.y[row], state.z[row], seconds * Math.abs(state.speed[row]) * 1.5 + TRAIL_JUMP);
      }
    }
    for (const key of this.trails.keys()) {
      if (!kept.has(key)) {
        this.trails.delete(key);
      }
    }
  }
}
