/** Marks of motion: a vector for each velocity, and the point where the followed entity would meet another. */

import { MATERIALS } from "../scene/materials.js";

/** @typedef {import("../scene/store.js").SceneState} SceneState */
/** @typedef {import("./picking.js").Poses} Poses */
/** @typedef {{x: number, y: number, z: number}} Place */

/** A vector shows the way of so many seconds. */
const VECTOR_SECONDS = 1;
/** Slower ones stand [m/s]. */
const STANDS = 0.2;
const VECTOR = { width: 0.4, minPixels: 2.5, material: MATERIALS.measure };
const MEETING = { width: 0.2, minPixels: 2.5, material: MATERIALS.contact };
/** Lines lie so far above the ground, so that no bonnet hides them [m]. */
const ABOVE_GROUND = 0.6;
/** Times above this are not shown [s]: studies of conflicts call less than 1.5 to 4 s critical. */
const HORIZON = 5;
const MOST_MEETINGS = 5;
/** Farther apart in height, one is on a bridge [m]. */
const ONE_LEVEL = 4;

/**
 * Add a vector for each velocity.
 * @param {import("../scene/line_buffer.js").LineBuffer} lines @param {SceneState} state @param {Poses} poses @param {Place} origin
 * @param {number} hidden - row that has none: the camera is in it
 */
export function addVelocities(lines, state, poses, origin, hidden) {
  for (let row = 0; row < poses.x.length; row += 1) {
    const { x, y, cos, sin, long } = boxOf(state, poses, row);
    const speed = state.speed[row];
    if (Math.abs(speed) > STANDS && row !== hidden) {
      const at = (/** @type {number} */ along, /** @type {number} */ left) =>
        /** @type {[number, number, number]} */ ([x + cos * along - sin * left - origin.x, y + sin * along + cos * left - origin.y, poses.z[row] - origin.z + ABOVE_GROUND]);
      const tip = Math.sign(speed) * long + VECTOR_SECONDS * speed;
      const head = Math.min(1.2, 0.4 * Math.abs(speed)) * Math.sign(speed);
      lines.add(...at(Math.sign(speed) * long, 0), ...at(tip, 0), VECTOR);
      lines.add(...at(tip - head, 0.5 * head), ...at(tip, 0), VECTOR);
      lines.add(...at(tip - head, -0.5 * head), ...at(tip, 0), VECTOR);
    }
  }
}

/** @param {SceneState} state @param {Poses} poses @param {number} row @returns the box of an entity and its velocity */
function boxOf(state, poses, row) {
  const [cos, sin] = [Math.cos(poses.heading[row]), Math.sin(poses.heading[row])];
  const [x, y] = [poses.x[row] + cos * state.center_x[row], poses.y[row] + sin * state.center_x[row]];
  return { x, y, cos, sin, long: 0.5 * state.length[row], wide: 0.5 * state.width[row], vx: cos * state.speed[row], vy: sin * state.speed[row] };
}

/**
 * The time until two boxes touch if both keep velocity and heading (Hayward 1972), as scores of the server have it: they
 * touch when the last of the four strips across their edges is entered, if none is left by then.
 * @param {SceneState} state @param {Poses} poses @param {number} row @param {number} other
 * @returns {number} [s]; 0 while they touch; Infinity: never
 */
export function timeToCollision(state, poses, row, other) {
  const [a, b] = [boxOf(state, poses, row), boxOf(state, poses, other)];
  let [first, last] = [0, Infinity];
  for (const { cos, sin } of [a, b]) {
    for (const [ux, uy] of [[cos, sin], [-sin, cos]]) { // prettier-ignore
      const reach = [a, b].reduce((sum, box) => sum + box.long * Math.abs(ux * box.cos + uy * box.sin) + box.wide * Math.abs(uy * box.cos - ux * box.sin), 0);
      const [away, speed] = [ux * (b.x - a.x) + uy * (b.y - a.y), ux * (b.vx - a.vx) + uy * (b.vy - a.vy)];
      if (Math.abs(speed) < 1e-9) {
        last = Math.abs(away) > reach ? -Infinity : last;
      } else {
        const [enter, leave] = [(-reach - away) / speed, (reach - away) / speed];
        first = Math.max(first, Math.min(enter, leave));
        last = Math.min(last, Math.max(enter, leave));
      }
    }
  }
  return first <= last ? first : Infinity;
}

/** Those that a row would soon meet, the next one first. @param {SceneState} state @param {Poses} poses @param {number} row */
export function meetingsOf(state, poses, row) {
  const meetings = [];
  const speed = Math.abs(state.speed[row]);
  for (let other = 0; row >= 0 && other < poses.x.length; other += 1) {
    const reach = HORIZON * (speed + Math.abs(state.speed[other])) + state.length[row] + state.length[other];
    const isNear = Math.abs(poses.x[other] - poses.x[row]) < reach && Math.abs(poses.y[other] - poses.y[row]) < reach;
    if (other !== row && isNear && Math.abs(poses.z[other] - poses.z[row]) < ONE_LEVEL) {
      const time = timeToCollision(state, poses, row, other);
      if (time <= HORIZON) {
        meetings.push({ other, time });
      }
    }
  }
  return meetings.sort((a, b) => a.time - b.time).slice(0, MOST_MEETINGS);
}

/**
 * Add a line to each one that would be met.
 * @param {import("../scene/line_buffer.js").LineBuffer} lines @param {Poses} poses @param {number} row
 * @param {{other: number}[]} meetings @param {Place} origin
 */
export function addMeetings(lines, poses, row, meetings, origin) {
  for (const { other } of meetings) {
    const [from, to] = [row, other].map((one) => /** @type {[number, number, number]} */ ([poses.x[one] - origin.x, poses.y[one] - origin.y, poses.z[one] - origin.z + ABOVE_GROUND]));
    lines.add(...from, ...to, MEETING);
  }
}
