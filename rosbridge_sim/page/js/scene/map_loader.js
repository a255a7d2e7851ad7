/**
 * The map from the server: over HTTP in one piece, or by `/sim/map` in pages where HTTP needs a token.
 */

import { MAP_LISTS } from "./map_types.js";

/** @typedef {import("./map_types.js").SceneMap} SceneMap */

/** Most pages of a map; a page has about 200 kB. */
const MOST_PAGES = 5000;

/**
 * Load the map.
 * @param {import("../wire/connection.js").Connection} connection
 * @returns {Promise<SceneMap>} rejects with the server's reason
 */
export async function loadMap(connection) {
  try {
    const response = await fetch("map.json");
    if (response.ok) {
      return await response.json();
    }
  } catch {
    // The service has the server's reason.
  }
  return loadMapPages(connection);
}

/**
 * Load the map by pages. If it changes meanwhile, begin again.
 * @param {{call: (service: string, request: object) => Promise<any>}} connection
 * @returns {Promise<SceneMap>}
 */
export async function loadMapPages(connection) {
  let map = await connection.call("/sim/map", { page: 0 });
  for (let page = 1; page < Math.min(map.num_pages, MOST_PAGES); page += 1) {
    const more = await connection.call("/sim/map", { page });
    if (more.digest === map.digest) {
      for (const list of MAP_LISTS) {
        map[list].push(...more[list]);
      }
    } else {
      map = await connection.call("/sim/map", { page: 0 });
      page = 0;
    }
  }
  return map;
}
