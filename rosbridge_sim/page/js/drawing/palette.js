/** Colours for the shaders, from the table that the picture of `map info` uses, too. */

import colours from "../../colours.json" with { type: "json" };
import { MATERIALS, NUM_MATERIALS } from "../scene/materials.js";
import { KINDS } from "../scene/store.js";

/**
 * @typedef {object} Palette
 * @property {Float32Array} materials - red, green and blue of each material
 * @property {Float32Array} kinds - the same of each kind of entity
 * @property {Record<"paper" | "zenith" | "horizon" | "ground" | "grid" | "contact" | "selected", number[]>} single
 * @property {boolean} isDark
 */

/** @param {string} hex - such as `#f4f2ec` @returns {number[]} red, green and blue from 0 to 1 */
export function colourOf(hex) {
  return [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16) / 255);
}

/** Make the palette. @param {boolean} isDark @returns {Palette} */
export function makePalette(isDark) {
  const map = isDark ? colours.mapDark : colours.map;
  const kinds = isDark ? colours.kindsDark : colours.kinds;
  const marks = isDark ? colours.marksDark : colours.marks;
  const sky = isDark ? colours.skyDark : colours.sky;
  const { paint, signals } = colours;
  /** @type {Record<keyof typeof MATERIALS, string>} */
  const names = {
    ...{ ...map, ...marks, yellow: paint.yellow, blue: paint.blue, ego: kinds.ego },
    ...{ lightDark: signals.dark, lightRed: signals.red, lightYellow: signals.yellow, lightGreen: signals.green },
  };
  const materials = new Float32Array(3 * NUM_MATERIALS);
  for (const [name, at] of Object.entries(MATERIALS)) {
    materials.set(colourOf(names[/** @type {keyof typeof MATERIALS} */ (name)]), 3 * at);
  }
  return {
    isDark,
    materials,
    kinds: new Float32Array(KINDS.flatMap((kind) => colourOf(kinds[kind]))),
    single: { ...coloursOf(sky), ...coloursOf({ paper: map.paper, contact: marks.contact, selected: marks.selected }) },
  };
}

/** @template {string} Name @param {Record<Name, string>} names @returns {Record<Name, number[]>} */
function coloursOf(names) {
  return /** @type {Record<Name, number[]>} */ (Object.fromEntries(Object.entries(names).map(([name, hex]) => [name, colourOf(/** @type {string} */ (hex))])));
}
