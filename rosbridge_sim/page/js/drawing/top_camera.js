/** The camera above the map. Places are in the map's frame [m]; points of the screen in CSS pixels from its upper left. */

/** @typedef {{origin: [number, number, number], direction: [number, number, number]}} Ray */
/** @typedef {{x: number, y: number, z: number}} Place */

/** Bounds of the scale [pixels/m]: from a country to the thickness of a painted line. */
const SMALLEST_SCALE = 0.005;
const LARGEST_SCALE = 400;
/**
 * Bounds of the scale of the first picture [pixels/m]: a crossing fills the window; the lanes are still seen; and lanes are
 * hardly seen, for the nearest vehicle alone.
 */
const FIRST_SCALE = 8;
const LEAST_FIRST_SCALE = 2;
const LEAST_SCALE_FOR_NEAREST = 0.5;
/** From the middle of the first picture to what is to be seen, as a share of its sides: something is left for its motion. */
const FIRST_SHARE = 0.35;
/** A vehicle that is slower stands [m/s]. */
const STANDS_BELOW = 0.1;
/** The first picture has the ego and so many of the nearest vehicles and people. */
const FIRST_TRAFFIC = 2;
/** Half the depth of the picture [m]: higher than any bridge. */
const DEPTH = 1000;

/** A camera that looks straight down. */
export class TopCamera {
  isPerspective = false;

  constructor() {
    this.x = 0;
    this.y = 0;
    /** [pixels/m] */
    this.scale = FIRST_SCALE;
    /** Scale of the last `fitAround`; 0: there was none. */
    this.fitted = 0;
    /** Turn of the picture, counter-clockwise [rad]. */
    this.rotation = 0;
    this.width = 1;
    this.height = 1;
  }

  /** @param {number} width @param {number} height */
  resize(width, height) {
    this.width = Math.max(width, 1);
    this.height = Math.max(height, 1);
  }

  /** A pixel's size on the ground, by the fourth clip coordinate, which is 1 [m]. */
  get pixelSize() {
    return 1 / this.scale;
  }

  /** @param {Place} place @returns {{x: number, y: number, scale: number}} point on the screen, and the scale there [pixels/m] */
  project({ x, y }) {
    const [dx, dy] = [x - this.x, y - this.y];
    const [cos, sin] = [Math.cos(this.rotation), Math.sin(this.rotation)];
    return {
      x: 0.5 * this.width + this.scale * (cos * dx - sin * dy),
      y: 0.5 * this.height - this.scale * (sin * dx + cos * dy),
      scale: this.scale,
    };
  }

  /** @param {number} px @param {number} py @returns {{x: number, y: number}} place under a point of the screen */
  placeAt(px, py) {
    const [sx, sy] = [(px - 0.5 * this.width) / this.scale, (0.5 * this.height - py) / this.scale];
    const [cos, sin] = [Math.cos(this.rotation), Math.sin(this.rotation)];
    return { x: this.x + cos * sx + sin * sy, y: this.y - sin * sx + cos * sy };
  }

  /** @param {number} px @param {number} py @returns {Ray} */
  rayAt(px, py) {
    const { x, y } = this.placeAt(px, py);
    return { origin: [x, y, DEPTH], direction: [0, 0, -1] };
  }

  /** Move the picture by so many pixels. @param {number} dx @param {number} dy */
  panBy(dx, dy) {
    const place = this.placeAt(0.5 * this.width - dx, 0.5 * this.height - dy);
    this.x = place.x;
    this.y = place.y;
  }

  /**
   * Zoom; the place under a point of the screen stays there.
   * @param {number} px @param {number} py @param {number} factor - above 1 is nearer
   */
  zoomAt(px, py, factor) {
    const before = this.placeAt(px, py);
    this.scale = Math.min(LARGEST_SCALE, Math.max(SMALLEST_SCALE, this.scale * factor));
    this.keepAt(before, px, py);
  }

  /**
   * Turn the picture; the place under a point of the screen stays there.
   * @param {number} px @param {number} py @param {number} angle - counter-clockwise [rad]
   */
  rotateAt(px, py, angle) {
    const before = this.placeAt(px, py);
    this.rotation = (this.rotation + angle) % (2 * Math.PI);
    this.keepAt(before, px, py);
  }

  /** Show an area of the map. @param {{west: number, south: number, east: number, north: number}} area */
  fit({ west, south, east, north }) {
    this.x = 0.5 * (west + east);
    this.y = 0.5 * (south + north);
    this.rotation = 0;
    const margin = 0.92; // of the screen; the rest is an edge around the map
    const [width, height] = [Math.max(east - west, 1), Math.max(north - south, 1)];
    this.scale = Math.min(LARGEST_SCALE, margin * Math.min(this.width / width, this.height / height));
  }

  /**
   * Show a place in the middle, and others around it where the scale allows it.
   * @param {{x: number, y: number}} middle @param {{x: number, y: number}[]} others - the nearest one first
   */
  fitAround(middle, others) {
    this.x = middle.x;
    this.y = middle.y;
    this.rotation = 0;
    const [wide, high] = [FIRST_SHARE * this.width, FIRST_SHARE * this.height];
    const scales = others.map(({ x, y }) => Math.min(wide / Math.abs(x - middle.x), high / Math.abs(y - middle.y)));
    // Places too far away for the least scale are left out.
    this.fitted = this.scale = Math.min(FIRST_SCALE, ...scales.filter((scale, i) => scale >= (i > 0 ? LEAST_FIRST_SCALE : LEAST_SCALE_FOR_NEAREST)));
  }

  /**
   * Tell whether a picture of `fitAround`, which the user has not changed, has lost its traffic while the one in its middle
   * stands.
   * @param {import("../scene/store.js").SceneState} state @param {number} row - of the one in the middle
   */
  hasLost(state, row) {
    const isUntouched = this.scale === this.fitted && Math.abs(state.speed[row]) < STANDS_BELOW;
    const isIn = (/** @type {Place} */ place) => {
      const { x, y } = this.project(place);
      return x > 0 && y > 0 && x < this.width && y < this.height;
    };
    const [next] = isUntouched ? nearestPlaces(state, row) : [];
    const isNear = next !== undefined && Math.hypot(next.x - this.x, next.y - this.y) * LEAST_SCALE_FOR_NEAREST < FIRST_SHARE * this.height;
    return isNear && !isIn({ ...next, z: 0 });
  }

  /** @param {Place} origin - where the buffers have 0 @returns {Float32Array} from buffers to the clip space */
  matrix(origin) {
    const [cos, sin] = [Math.cos(this.rotation), Math.sin(this.rotation)];
    const [sx, sy] = [(2 * this.scale) / this.width, (2 * this.scale) / this.height];
    const [dx, dy] = [origin.x - this.x, origin.y - this.y];
    return new Float32Array([
      sx * cos, sy * sin, 0, 0,
      -sx * sin, sy * cos, 0, 0,
      0, 0, -1 / DEPTH, 0,
      sx * (cos * dx - sin * dy), sy * (sin * dx + cos * dy), -origin.z / DEPTH, 1,
    ]); // prettier-ignore
  }

  /** @param {{x: number, y: number}} place @param {number} px @param {number} py */
  keepAt(place, px, py) {
    const now = this.placeAt(px, py);
    this.x += place.x - now.x;
    this.y += place.y - now.y;
  }
}

/**
 * Return the places of the entities nearest to one, for the first picture.
 * @param {import("../scene/store.js").SceneState} state @param {number} row - of the one @returns {{x: number, y: number}[]}
 */
export function nearestPlaces(state, row) {
  const away = (/** @type {number} */ other) => Math.hypot(state.x[other] - state.x[row], state.y[other] - state.y[row]);
  const others = Array.from(state.id.keys()).filter((other) => other !== row && state.kind[other] < 3);
  others.sort((a, b) => away(a) - away(b));
  return others.slice(0, FIRST_TRAFFIC).map((other) => ({ x: state.x[other], y: state.y[other] }));
}
