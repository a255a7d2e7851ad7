// What a panel is made from.

/**
 * @typedef {{
 *   connection: import("../wire/connection.js").Connection,
 *   scene: import("../scene/store.js").SceneStore,
 *   drawn: import("../scene/drawn_topics.js").DrawnTopics,
 *   actions: import("./actions.js").Actions,
 *   time: import("./time_watch.js").TimeWatch,
 *   timeControls: import("./time_controls.js").TimeControls,
 *   ego: import("./ego_watch.js").EgoWatch,
 *   files: import("./server_files.js").ServerFiles,
 *   drivers: import("./drivers_watch.js").DriversWatch,
 *   mapView: MapView | null,
 *   showTab: (id: import("../layout.js").TabId) => void,
 *   texts: typeof import("../texts.js").TEXTS,
 * }} PanelContext
 *   mapView: null without WebGL 2
 */

/**
 * The part of the map that panels use.
 * @typedef {{
 *   pickPlace: (options?: {hint?: string}) => Promise<{x: number, y: number, heading: number | null} | null>,
 *   onDrop?: (kind: string, take: (place: {x: number, y: number}) => void) => void,
 *   showChase: () => void,
 *   onLight?: (take: (name: string) => void) => void,
 * }} MapView
 *   pickPlace: the next click is the place, a drag from it the heading; heading is null without a drag, and the result is
 *   null if the user gave it up; showChase: the camera goes behind the car; onDrop: something of a kind (of `DataTransfer`) was dropped on the map; onLight: the user
 *   has clicked a traffic light
 */

/** A new name for the page as a client of synchronous mode: two pages never share a name. @returns {string} */
export function makeUserId() {
  const [number] = crypto.getRandomValues(new Uint32Array(1));
  return `page-${Number(number).toString(36)}`;
}
