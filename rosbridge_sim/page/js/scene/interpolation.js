/**
 * Poses between the last two states, for a smooth picture. They lie between two poses that happened, and end at the last
 * state exactly; after a pause, a step, a reset or a jump the last state is shown at once.
 */

/** @typedef {import("./store.js").SceneState} SceneState */

/** States that come farther apart than this are shown at once [ms]: it was a pause or a step. */
const LONGEST_GAP = 400;
/** More simulated frames than this between two states are a jump: 2 s of 50 frames a second. */
const MOST_FRAMES = 100;
/** Farther than this beside what its speed explains, an entity was placed elsewhere [m]. */
const JUMP = 1.5;
/** Duration of a frame [s]. */
const FRAME_SECONDS = 0.02;

/** A pose for each row of the last state. */
export class PoseTrack {
  constructor() {
    /** @type {SceneState | null} */
    this.before = null;
    /** @type {SceneState | null} */
    this.last = null;
    this.arrival = -Infinity;
    this.duration = 0;
    /** Row of the state before for each row; -1: it moves at once. @type {Int32Array} */
    this.rows = new Int32Array(0);
    this.x = new Float64Array(0);
    this.y = new Float64Array(0);
    this.z = new Float64Array(0);
    this.heading = new Float64Array(0);
  }

  /** Take a new state. @param {SceneState} state @param {number} now - time of its arrival [ms] */
  take(state, now) {
    const gap = now - this.arrival;
    const frames = this.last === null ? 0 : state.frame - this.last.frame;
    const isNext =
      this.last !== null &&
      gap <= LONGEST_GAP &&
      frames > 0 &&
      frames <= MOST_FRAMES &&
      this.last.map_digest === state.map_digest;
    this.before = isNext ? this.last : null;
    this.duration = isNext ? gap : 0;
    this.last = state;
    this.arrival = now;
    const num = state.id.length;
    if (this.x.length !== num) {
      this.x = new Float64Array(num);
      this.y = new Float64Array(num);
      this.z = new Float64Array(num);
      this.heading = new Float64Array(num);
      this.rows = new Int32Array(num);
    }
    if (this.before === null) {
      this.rows.fill(-1);
    } else {
      matchRows(this.before, state, frames * FRAME_SECONDS, this.rows);
    }
  }

  /** Tell whether poses still move towards the last state. @param {number} now - [ms] */
  isMoving(now) {
    return now < this.arrival + this.duration;
  }

  /** Compute the poses of now. @param {number} now - [ms] */
  update(now) {
    const { before, last } = this;
    if (last === null) {
      return;
    }
    const share = this.isMoving(now) ? (now - this.arrival) / this.duration : 1;
    if (before === null || share >= 1) {
      this.x.set(last.x);
      this.y.set(last.y);
      this.z.set(last.z);
      this.heading.set(last.heading);
      return;
    }
    const rest = 1 - Math.max(share, 0);
    for (let row = 0; row < this.x.length; row += 1) {
      const from = this.rows[row];
      const part = from < 0 ? 0 : rest;
      const source = from < 0 ? row : from;
      const old = from < 0 ? last : before;
      this.x[row] = last.x[row] + part * (old.x[source] - last.x[row]);
      this.y[row] = last.y[row] + part * (old.y[source] - last.y[row]);
      this.z[row] = last.z[row] + part * (old.z[source] - last.z[row]);
      this.heading[row] = last.heading[row] + part * turnBetween(last.heading[row], old.heading[source]);
    }
  }
}

/**
 * Return the shorter turn from one heading to another.
 * @param {number} from - [rad] @param {number} to - [rad] @returns {number} from -pi to pi [rad]
 */
export function turnBetween(from, to) {
  const turn = (to - from) % (2 * Math.PI);
  return turn > Math.PI ? turn - 2 * Math.PI : turn < -Math.PI ? turn + 2 * Math.PI : turn;
}

/**
 * Find each entity in the state before; -1 where it is new or was placed elsewhere.
 * @param {SceneState} before @param {SceneState} state @param {number} seconds - of simulated time between both
 * @param {Int32Array} rows - is filled
 */
function matchRows(before, state, seconds, rows) {
  /** @type {Map<number, number> | null} */
  let places = null;
  for (let row = 0; row < rows.length; row += 1) {
    let from = row;
    if (before.id[row] !== state.id[row] || before.kind[row] !== state.kind[row]) {
      places ??= new Map(Array.from(before.id, (id, at) => [keyOf(id, before.kind[at]), at]));
      from = places.get(keyOf(state.id[row], state.kind[row])) ?? -1;
    }
    if (from >= 0) {
      const away = Math.hypot(state.x[row] - before.x[from], state.y[row] - before.y[from]);
      const explained = seconds * Math.max(Math.abs(state.speed[row]), Math.abs(before.speed[from]));
      from = away <= explained + JUMP ? from : -1;
    }
    rows[row] = from;
  }
}

/** @param {number} id @param {number} kind */
function keyOf(id, kind) {
  return 4 * id + kind;
}
