/** The map in its place: canvas, controls, card and list; or a notice without WebGL 2. */

import { MapView } from "../drawing/map_view.js";
import { ContactList } from "../scene/contacts.js";
import { element } from "../widgets/dom.js";
import { makeContactList } from "./contact_list.js";
import { makeMapControls } from "./map_controls.js";
import { ObjectCard } from "./object_card.js";

/**
 * Put the map on the stage.
 * @param
 * {Pick<import("./context.js").PanelContext, "connection" | "scene" | "drawn" | "drivers" | "texts">}
 * context
 * @param {HTMLElement} stage @returns {MapView | null} null without WebGL 2
 */
export function makeMapStage(context, stage) {
  const { texts } = context;
  const contacts = new ContactList();
  /** @type {MapView | null} */
  let view = null;
  let reason = texts.mapView.noWebGl;
  try {
    view = makeView(context, contacts);
  } catch (error) {
    reason = texts.mapView.failed(error instanceof Error ? error.message : String(error)); // a driver's mistake
  }
  if (view === null) {
    stage.append(element("p", { className: "map-notice", role: "status" }, reason));
  } else {
    stage.append(view.element, makeMapControls(view, texts));
  }
  const overlays = [new ObjectCard(context, view).element, makeContactList(context, contacts, view)];
  stage.append(element("div", { className: "map-overlays" }, ...overlays));
  return view;
}

/** @param {Parameters<typeof makeMapStage>[0]} context @param {ContactList} contacts */
function makeView({ scene, drawn, texts }, contacts) {
  const canvas = element("canvas", { className: "map-canvas", tabIndex: 0, role: "img", "aria-label": texts.mapView.canvas });
  const antialias = !isSoftwareRenderer();
  const gl = canvas.getContext("webgl2", { alpha: false, antialias, powerPreference: "high-performance" });
  return gl === null ? null : new MapView({ scene, contacts, drawn, texts, gl, canvas });
}

/** Tell whether a processor does the work of a graphics card: smooth edges of bodies would cost a third of its frames. */
function isSoftwareRenderer() {
  const gl = element("canvas", { width: 1, height: 1 }).getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software/i.test(name);
}
