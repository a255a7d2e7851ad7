/** The map from the server, by the pages of `/sim/map`: unlike `map.json` over HTTP, it needs no second proof of a token. */

import { MAP_LISTS } from "./map_types.js";

/** @typedef {import("./map_types.js").SceneMap} SceneMap */

/** Longest wait for a page [ms]: a busy server on a slow line. */
const PAGE_TIMEOUT = 60_000;
/** So many times a map may change while it is read. */
const MOST_CHANGES = 5;

/**
 * Load the map. If it changes meanwhile, begin again.
 * @param {{call: (service: string, request: object, options: {timeoutMs: number}) => Promise<any>}} connection
 * @returns {Promise<SceneMap>} rejects with the server's reason
 */
export async function loadMap(connection) {
  const load = (/** @type {number} */ page) => connection.call("/sim/map", { page }, { timeoutMs: PAGE_TIMEOUT });
  let map = await load(0);
  let changes = 0;
  for (let page = 1; page < map.num_pages; page += 1) {
    const more = await load(page);
    if (more.digest === map.digest && more.result !== false) {
      for (const list of MAP_LISTS) {
        map[list] = map[list].concat(more[list]);
      }
    } else {
      changes += 1;
      if (changes > MOST_CHANGES) {
        throw new Error("the map changes all the time");
      }
      map = await load(0);
      page = 0;
    }
  }
  return map;
}
