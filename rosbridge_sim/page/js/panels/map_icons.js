/** Icons of the map's buttons, as paths in a box of 24 by 24. */

import { svgElement } from "../widgets/dom.js";

const MAP_ICONS = {
  chase: "M4 16v-3l2-5h12l2 5v3M4 16h16v3h-3v-2H7v2H4zM7 13h2m6 0h2",
  follow: "M12 3v4m0 10v4M3 12h4m10 0h4M12 8a4 4 0 1 0 0 8 4 4 0 0 0 0-8z",
  zoomIn: "M12 5v14M5 12h14",
  zoomOut: "M5 12h14",
  wholeMap: "M4 9V4h5m6 0h5v5m0 6v5h-5m-6 0H4v-5",
  turnLeft: "M5 5v5h5M5.5 10a8 8 0 1 1-.5 5",
  turnRight: "M19 5v5h-5M18.5 10a8 8 0 1 0 .5 5",
  measure: "M3 16 16 3l5 5L8 21zM7 12l2 2m1-5 2 2m1-5 2 2",
  help: "M9 9a3 3 0 1 1 4.5 2.6c-1 .6-1.5 1.2-1.5 2.4m0 3.5v.5",
  north: "M12 2l5 19-5-4-5 4z",
};

/** @param {keyof typeof MAP_ICONS} name @returns {SVGElement} */
export function mapIcon(name) {
  return svgElement("svg", { viewBox: "0 0 24 24", "aria-hidden": "true" }, svgElement("path", { d: MAP_ICONS[name] }));
}
