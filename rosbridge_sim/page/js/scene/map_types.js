/** Types of the map as `/map.json` and `/sim/map` have it; the definitions are in rosbridge_sim_msgs. */

/** @typedef {{link: string, x: number[], y: number[], z: number[], left: number[], right: number[], length: number,
 *   width: number, speed_limit: number, successors: string[], left_link: string, right_link: string, light: string}} MapLane */
/** @typedef {{name: string, x: number[], y: number[], z: number[], type: number, shape: string[], colour: string[]}} MapBorder */
/** @typedef {{link: string, x: number[], y: number[], z: number[]}} MapStopLine */
/** @typedef {{name: string, parts: {x: number[], y: number[], z: number[]}[], lights: string[]}} MapCrosswalk */
/** @typedef {{name: string, x: number, y: number, z: number, heading_deg: number, lamps: number, is_pedestrian: boolean,
 *   is_warning: boolean, links: string[], controller: string, group: number}} MapLight */
/** @typedef {{name: string, digest: string, west: number, south: number, east: number, north: number, lanes: MapLane[],
 *   borders: MapBorder[], stop_lines: MapStopLine[], crosswalks: MapCrosswalk[], lights: MapLight[],
 *   controllers: object[]}} SceneMap */

/** The lists of the map, which go on from page to page of `/sim/map`. */
export const MAP_LISTS = /** @type {const} */ (["lanes", "borders", "stop_lines", "crosswalks", "lights", "controllers"]);
