/** The camera behind a car, in perspective. */

import { turnBetween } from "../scene/interpolation.js";
import { lookAlong, multiply, perspective, transform } from "./matrices.js";

/** @typedef {import("./top_camera.js").Ray} Ray */
/** @typedef {import("./top_camera.js").Place} Place */

/** From the lower to the upper edge of the picture [rad]: wide enough for a crossing, without bent edges. */
const FIELD_OF_VIEW = (50 * Math.PI) / 180;
const NEAR = 0.4;
const FAR = 3000;
/** Height of the point that the camera looks at, and its place in front of the reference point [m]. */
const FOCUS_HEIGHT = 1.1;
const FOCUS_AHEAD = 3.5;
/** The camera turns with the car in about this time [s]: a turn is seen, and nobody becomes seasick. */
const TURN_TIME = 0.22;
/** Below this the camera stands still [rad]. */
const STILL = 0.0005;
/** Bounds of what the user may choose [m], [rad]. */
const NEAREST = 4;
const FARTHEST = 300;
const LOWEST = 0.03;
const STEEPEST = 1.45;

/** A camera that follows a pose. */
export class ChaseCamera {
  isPerspective = true;

  constructor() {
    this.width = 1;
    this.height = 1;
    this.target = { x: 0, y: 0, z: 0, heading: 0 };
    /** Heading of the camera without the user's turn [rad]. */
    this.heading = 0;
    /** Turn that the user chose [rad]. */
    this.turn = 0;
    this.pitch = 0.26;
    this.distance = 13;
  }

  /** @param {number} width @param {number} height */
  resize(width, height) {
    this.width = Math.max(width, 1);
    this.height = Math.max(height, 1);
  }

  /** A pixel's size at a distance of 1 m, by the fourth clip coordinate, which is the distance [m]. */
  get pixelSize() {
    return (2 * Math.tan(0.5 * FIELD_OF_VIEW)) / this.height;
  }

  /**
   * Follow a pose.
   * @param {{x: number, y: number, z: number, heading: number}} target
   * @param {number} seconds - since the last time; 0 places the camera behind the target at once
   * @returns {boolean} the camera still turns
   */
  follow(target, seconds) {
    this.target = target;
    const left = turnBetween(this.heading, target.heading);
    const share = seconds > 0 ? 1 - Math.exp(-seconds / TURN_TIME) : 1;
    this.heading += Math.abs(left) < STILL ? left : left * share;
    return Math.abs(turnBetween(this.heading, target.heading)) > 0;
  }

  /** Turn around the car. @param {number} dx - to the left positive [rad] @param {number} dy - upwards positive [rad] */
  orbitBy(dx, dy) {
    this.turn = (this.turn + dx) % (2 * Math.PI);
    this.pitch = Math.min(STEEPEST, Math.max(LOWEST, this.pitch + dy));
  }

  /** @param {number} factor - above 1 is nearer */
  zoomBy(factor) {
    this.distance = Math.min(FARTHEST, Math.max(NEAREST, this.distance / factor));
  }

  /** @returns {[number, number, number]} direction of the view */
  forward() {
    const heading = this.heading + this.turn;
    const flat = Math.cos(this.pitch);
    return [flat * Math.cos(heading), flat * Math.sin(heading), -Math.sin(this.pitch)];
  }

  /** @returns {[number, number, number]} place of the camera in the map's frame [m] */
  eye() {
    const [fx, fy, fz] = this.forward();
    const { x, y, z } = this.target;
    const ahead = FOCUS_AHEAD;
    const focus = [x + ahead * Math.cos(this.heading), y + ahead * Math.sin(this.heading), z + FOCUS_HEIGHT];
    return [focus[0] - this.distance * fx, focus[1] - this.distance * fy, focus[2] - this.distance * fz];
  }

  /** @param {Place} origin - where the buffers have 0 @returns {Float32Array} from buffers to the clip space */
  matrix(origin) {
    return new Float32Array(this.exactMatrix(origin));
  }

  /** @param {Place} origin */
  exactMatrix(origin) {
    const [x, y, z] = this.eye();
    const view = lookAlong([x - origin.x, y - origin.y, z - origin.z], this.forward());
    return multiply(perspective(FIELD_OF_VIEW, this.width / this.height, NEAR, FAR), view);
  }

  /**
   * @param {Place} place
   * @returns {{x: number, y: number, scale: number} | null} point on the screen and the scale there; null: behind it
   */
  project({ x, y, z }) {
    const [cx, cy, , cw] = transform(this.exactMatrix(this.target), [x - this.target.x, y - this.target.y, z - this.target.z]);
    if (cw < NEAR) {
      return null;
    }
    return {
      x: 0.5 * this.width * (1 + cx / cw),
      y: 0.5 * this.height * (1 - cy / cw),
      scale: 1 / (this.pixelSize * cw),
    };
  }

  /** @param {number} px @param {number} py @returns {Ray} */
  rayAt(px, py) {
    const [fx, fy, fz] = this.forward();
    const across = Math.hypot(fx, fy);
    const right = [fy / across, -fx / across, 0];
    const up = [right[1] * fz, -right[0] * fz, right[0] * fy - right[1] * fx];
    const [a, b] = [(px - 0.5 * this.width) * this.pixelSize, (0.5 * this.height - py) * this.pixelSize];
    return {
      origin: this.eye(),
      direction: [fx + a * right[0] + b * up[0], fy + a * right[1] + b * up[1], fz + b * up[2]],
    };
  }

  /**
   * @param {number} px
   * @param {number} py
   * @returns {{x: number, y: number} | null} place on the ground under a point of the screen; null: it is the sky
   */
  placeAt(px, py) {
    const { origin, direction } = this.rayAt(px, py);
    const distance = (this.target.z - origin[2]) / direction[2];
    if (!(distance > 0) || distance > FAR) {
      return null;
    }
    return { x: origin[0] + distance * direction[0], y: origin[1] + distance * direction[1] };
  }
}
