/**
 * The parts of the page, made and connected.
 */

import { Layout } from "./layout.js";
import { addPanels, makePanelContext } from "./panels/all_panels.js";
import { showConnectionState } from "./panels/connection_state.js";
import { SceneStore } from "./scene/store.js";
import { TEXTS } from "./texts.js";
import { Connection, socketUrl } from "./wire/connection.js";

const connection = new Connection(socketUrl(location));
const layout = new Layout(TEXTS);
document.body.replaceChildren(...layout.elements);

const scene = new SceneStore(connection);
const context = makePanelContext({ connection, scene, mapView: null, texts: TEXTS });
addPanels(context, layout);
showConnectionState(context, layout);

connection.setHidden(document.hidden);
document.addEventListener("visibilitychange", () => connection.setHidden(document.hidden));
connection.start();
