// Activity of an ego in one word, from its speed, its lamps, its driver and the lights ahead.

import { lightMaterial } from "../scene/light_bars.js";
import { MATERIALS } from "../scene/materials.js";

/** @typedef {"drives" | "reverses" | "brakes" | "waits" | "red" | "stands"} EgoActivity */
/** @typedef {import("../scene/map_types.js").SceneMap} SceneMap */

/** Speed below which an ego stands [m/s]. */
const STANDING_SPEED = 0.05;
/** Largest distance to the end of the lane at which an ego is at the light [m]: the first in the queue, not the third. */
const AT_LIGHT = 10;

/**
 * @param {{speed: number, isBraking: boolean, driver: string, isAtRed: () => boolean}} ego
 *   speed [m/s], negative: backwards; isBraking: its brake lights are on; driver: as in `/sim/drivers` @returns {EgoActivity}
 */
export function activityOf({ speed, isBraking, driver, isAtRed }) {
  if (Math.abs(speed) > STANDING_SPEED) {
    return isBraking ? "brakes" : speed < 0 ? "reverses" : "drives";
  }
  return driver === "nobody" ? "waits" : isAtRed() ? "red" : "stands";
}

/**
 * Tell whether a vehicle is at the end of its lane with a red light before each lane behind it.
 * @param {{x: number, y: number}} place [m] @param {string} link of its lane @param {Pick<SceneMap, "lanes" | "lights">} map
 * @param {ArrayLike<number>} lightStates in the order of the map's lights
 */
export function isAtRedLight({ x, y }, link, { lanes, lights }, lightStates) {
  const own = lanes.find((lane) => lane.link === link);
  if (!own || Math.hypot((own.x.at(-1) ?? Infinity) - x, (own.y.at(-1) ?? Infinity) - y) > AT_LIGHT) {
    return false;
  }
  const isRed = (/** @type {string} */ light) => lightMaterial(lightStates[lights.findIndex(({ name }) => name === light)] ?? 0) === MATERIALS.lightRed;
  const next = lanes.filter((lane) => own.successors.includes(lane.link));
  return next.length > 0 && next.every(({ light }) => isRed(light));
}
