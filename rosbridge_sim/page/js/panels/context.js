// Context of a panel: its connection, scene and texts.

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
 *   mapView: import("../drawing/map_view.js").MapView | null,
 *   showTab: (id: import("../layout.js").TabId) => void,
 *   texts: typeof import("../texts.js").TEXTS,
 * }} PanelContext
 *   mapView: null without WebGL 2
 */


/** A new name for the page as a client of synchronous mode: two pages never share a name. @returns {string} */
export function makeUserId() {
  const [number] = crypto.getRandomValues(new Uint32Array(1));
  return `page-${Number(number).toString(36)}`;
}
