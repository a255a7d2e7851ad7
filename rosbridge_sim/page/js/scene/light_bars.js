/** Traffic lights as bars: across the beginning of each lane that a light controls, in the colour that it shows. */

import { pointAlong } from "./map_geometry.js";
import { MATERIALS } from "./materials.js";

/** @typedef {import("./map_types.js").SceneMap} SceneMap */

/** Lamps of the wire. */
const RED = 1;
const YELLOW = 4;
const GREENS = ~(RED | YELLOW);
/** Length of a bar along its lane, and its distance from the lane's beginning [m]. */
const BAR = 1;
const BAR_START = 0.4;

/**
 * Return the colour of a light.
 * @param {number} state - sum of its lit lamps, as on the wire; negative if nothing sets it
 * @returns {number} its material: green if it lets anybody go
 */
export function lightMaterial(state) {
  if (state <= 0) {
    return MATERIALS.lightDark;
  }
  if ((state & GREENS) !== 0) {
    return MATERIALS.lightGreen;
  }
  return (state & YELLOW) !== 0 ? MATERIALS.lightYellow : MATERIALS.lightRed;
}

/**
 * A bar: its ends, its width and the row of its light.
 * @typedef {{x0: number, y0: number, z0: number, x1: number, y1: number, z1: number, width: number, light: number}} LightBar
 */

/**
 * Make the bars of a map. Where lanes with several lights begin at one point, each light has its share of the width.
 * @param {SceneMap} map @param {{x: number, y: number, z: number}} origin @returns {LightBar[]}
 */
export function makeLightBars(map, origin) {
  const rows = new Map(map.lights.map((light, row) => [light.name, row]));
  /** @type {Map<string, {lane: import("./map_types.js").MapLane, lights: number[]}>} */
  const starts = new Map();
  for (const lane of map.lanes) {
    const row = rows.get(lane.light);
    if (row !== undefined && lane.x.length > 1) {
      const key = `${lane.x[0]} ${lane.y[0]}`;
      const start = starts.get(key) ?? { lane, lights: [] };
      starts.set(key, start);
      if (!start.lights.includes(row)) {
        start.lights.push(row);
      }
    }
  }
  return [...starts.values()].flatMap(({ lane, lights }) => barsOf(lane, lights, origin));
}

/**
 * @param {import("./map_types.js").MapLane} lane @param {number[]} lights @param {{x: number, y: number, z: number}} origin
 * @returns {LightBar[]}
 */
function barsOf(lane, lights, origin) {
  const place = pointAlong(lane, 0);
  if (place === null) {
    return [];
  }
  const share = (0.8 * lane.width) / lights.length;
  return lights.map((light, i) => {
    const aside = (0.5 * (lights.length - 1) - i) * share;
    const x = place.x - aside * place.dy - origin.x;
    const y = place.y + aside * place.dx - origin.y;
    const z = place.z - origin.z;
    return {
      x0: x + BAR_START * place.dx,
      y0: y + BAR_START * place.dy,
      z0: z,
      x1: x + (BAR_START + BAR) * place.dx,
      y1: y + (BAR_START + BAR) * place.dy,
      z1: z,
      width: share,
      light,
    };
  });
}
