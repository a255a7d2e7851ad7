/** The camera in perspective: behind a car, at its driver's seat, or around it. */

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
/** The driver looks up and down so far [rad]. */
const SEAT_PITCH = 1.2;
/** Longer vehicles have their driver at the front [m]. */
const LONG_VEHICLE = 6;

/** @typedef {"chase" | "seat" | "orbit"} PerspectiveName */
/** @typedef {{x: number, y: number, z: number, heading: number, pitch?: number, length?: number, width?: number, height?: number, center?: number}} CameraTarget */

/** A camera that follows a pose. */
export class ChaseCamera {
  isPerspective = true;

  constructor() {
    this.width = 1;
    this.height = 1;
    /** @type {CameraTarget} */
    this.target = { x: 0, y: 0, z: 0, heading: 0 };
    /** Heading of the camera without the user's turn [rad]. */
    this.heading = 0;
    /** @type {PerspectiveName} */
    this.mode = "chase";
    /** View that the user has chosen in each mode: turn and pitch [rad], distance [m]. */
    this.looks = {
      chase: { turn: 0, pitch: 0.26, distance: 13 },
      seat: { turn: 0, pitch: 0.05, distance: 0 },
      orbit: { turn: 0.9, pitch: 0.45, distance: 24 },
    };
  }

  /** @param {number} width @param {number} height */
  resize(width, height) {
    this.width = Math.max(width, 1);
    this.height = Math.max(height, 1);
  }

  /** View that the user has chosen in this mode. */
  get look() {
    return this.looks[this.mode];
  }

  /** A pixel's size at a distance of 1 m, by the fourth clip coordinate, which is the distance [m]. */
  get pixelSize() {
    return (2 * Math.tan(0.5 * FIELD_OF_VIEW)) / this.height;
  }

  /**
   * Follow a pose.
   * @param {CameraTarget} target @param {number} seconds - since the last time; 0 places the camera behind the target at once
   * @returns {boolean} the camera still turns
   */
  follow(target, seconds) {
    this.target = target;
    if (this.mode === "orbit") {
      return false; // it keeps its direction, whatever the car does
    }
    const left = turnBetween(this.heading, target.heading);
    const share = seconds > 0 && this.mode === "chase" ? 1 - Math.exp(-seconds / TURN_TIME) : 1;
    this.heading += Math.abs(left) < STILL ? left : left * share;
    return Math.abs(turnBetween(this.heading, target.heading)) > 0;
  }

  /** Turn around the car. @param {number} dx - to the left positive [rad] @param {number} dy - upwards positive [rad] */
  orbitBy(dx, dy) {
    const [lowest, steepest] = this.mode === "seat" ? [-SEAT_PITCH, SEAT_PITCH] : [LOWEST, STEEPEST];
    const { look } = this;
    look.turn = (look.turn + dx) % (2 * Math.PI);
    look.pitch = Math.min(steepest, Math.max(lowest, look.pitch + dy));
  }

  /** @param {number} factor - above 1 is nearer */
  zoomBy(factor) {
    if (this.mode !== "seat") {
      this.look.distance = Math.min(FARTHEST, Math.max(NEAREST, this.look.distance / factor));
    }
  }

  /** @returns {[number, number, number]} direction of the view */
  forward() {
    const { turn, pitch: down } = this.look;
    const heading = this.heading + turn;
    const pitch = this.mode === "seat" ? down + (this.target.pitch ?? 0) * Math.cos(turn) : down;
    const flat = Math.cos(pitch);
    return [flat * Math.cos(heading), flat * Math.sin(heading), -Math.sin(pitch)];
  }

  /** @returns {[number, number, number]} place of the camera in the map's frame [m] */
  eye() {
    const { x, y, z, heading, length = 4.5, width = 1.8, height = 1.5, center = 1.3 } = this.target;
    if (this.mode === "seat") {
      const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
      const along = center + (length > LONG_VEHICLE ? 0.5 * length - 1 : 0);
      return [x + along * cos - 0.2 * width * sin, y + along * sin + 0.2 * width * cos, z + Math.min(0.8 * height, 2.4)];
    }
    const [fx, fy, fz] = this.forward();
    const { distance } = this.look;
    const ahead = this.mode === "orbit" ? 0 : FOCUS_AHEAD;
    const focus = [x + ahead * Math.cos(this.heading), y + ahead * Math.sin(this.heading), z + FOCUS_HEIGHT];
    return [focus[0] - distance * fx, focus[1] - distance * fy, focus[2] - distance * fz];
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
   * @param {number} px @param {number} py
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
