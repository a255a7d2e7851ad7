/** The parts of the page, made and connected, in the language of its user. */

import { translate } from "./language.js";
import { Layout } from "./layout.js";
import { addPanels, makePanelContext } from "./panels/all_panels.js";
import { showConnectionState } from "./panels/connection_state.js";
import { makeUserId } from "./panels/context.js";
import { DriversWatch } from "./panels/drivers_watch.js";
import { listenToMapKeys } from "./panels/map_controls.js";
import { makeMapStage } from "./panels/map_stage.js";
import { DrawnTopics } from "./scene/drawn_topics.js";
import { SceneStore } from "./scene/store.js";
import { TEXTS } from "./texts.js";
import { Connection, socketUrl } from "./wire/connection.js";

/** Make all parts; the texts are in their language. */
function start() {
  const connection = new Connection(socketUrl(location));
  const layout = new Layout(TEXTS);
  document.body.replaceChildren(...layout.elements);

  const scene = new SceneStore(connection);
  const drawn = new DrawnTopics(connection, scene);
  const drivers = new DriversWatch(connection, makeUserId(), TEXTS.clientNames);
  const mapView = makeMapStage({ connection, scene, drawn, drivers, texts: TEXTS }, layout.stage);
  const context = makePanelContext({ connection, scene, drawn, drivers, mapView, showTab: (id) => layout.tabs.show(id), texts: TEXTS });
  addPanels(context, layout);
  showConnectionState(context, layout);
  if (mapView !== null) {
    listenToMapKeys(mapView, TEXTS); // last: a key that another part takes is no key of the map
  }

  connection.setHidden(document.hidden);
  document.addEventListener("visibilitychange", () => connection.setHidden(document.hidden));
  connection.start();
}

translate().then(start, start); // in English where the other texts cannot be loaded
