/** Buttons and keys of the map, its scale bar, and the coordinates under the pointer. */

import { MeasureTool } from "../drawing/map_tools.js";
import { lengthText, roundLength } from "../drawing/scale_bar.js";
import { element, setText } from "../widgets/dom.js";
import { mapIcon } from "./map_icons.js";
import { showMapHelp } from "./map_help.js";
import { CAMERAS } from "./page_link.js";

/** @typedef {import("../drawing/map_view.js").MapView} MapView */

/** A press of a button or key zooms and turns by this, and moves by so many pixels. */
const ZOOM_STEP = 1.4;
const TURN_STEP = Math.PI / 12;
const PAN_STEP = 60;
/** Longest scale bar [pixels]. */
const SCALE_PIXELS = 120;

/** Make the controls of the map. @param {MapView} view @param {import("../layout.js").Texts} texts @returns {HTMLElement} */
export function makeMapControls(view, texts) {
  const { mapView } = texts;
  /** @type {(icon: Parameters<typeof mapIcon>[0], text: string, key: string, act: () => void) => HTMLButtonElement} */
  const button = (icon, text, key, act) =>
    element("button", { type: "button", title: text + mapView.withKey(key), "aria-label": text, onclick: act }, mapIcon(icon));
  const chase = button("chase", mapView.chase, "C", () => view.toggleCamera());
  const follow = button("follow", mapView.follow, "F", () => view.toggleFollow());
  const measure = button("measure", mapView.measure, "M", () => view.toggleMeasure());
  const north = button("north", mapView.northUp, "N", () => view.northUp());
  north.className = "north";
  const whole = button("wholeMap", mapView.wholeMap, "0", () => view.showAll());
  const turns = [
    button("turnLeft", mapView.turnLeft, ",", () => view.turnBy(TURN_STEP)),
    button("turnRight", mapView.turnRight, ".", () => view.turnBy(-TURN_STEP)),
  ];
  const zooms = [
    button("zoomIn", mapView.zoomIn, "+", () => view.zoomBy(ZOOM_STEP)),
    button("zoomOut", mapView.zoomOut, "-", () => view.zoomBy(1 / ZOOM_STEP)),
  ];
  const help = button("help", mapView.help, "?", () => showMapHelp(texts));
  const group = (/** @type {HTMLElement[]} */ ...buttons) => element("div", {}, ...buttons);
  const gestures = (/** @type {HTMLElement[]} */ buttons) => element("div", { className: "gesture" }, ...buttons);
  const toolbar = element(
    "div",
    { className: "map-toolbar", role: "toolbar", "aria-label": mapView.toolbar, "aria-orientation": "vertical" },
    group(north),
    gestures(zooms),
    group(chase, follow, whole),
    gestures(turns),
    group(measure, help),
  );
  const bar = element("div", { className: "scale-bar" });
  const coordinates = element("div", { className: "coordinates" });
  const hint = element("div", { className: "map-hint", role: "status", hidden: true });
  const { connection } = view.scene;
  let refusal = "";
  const tell = () => {
    const isLoading = view.scene.map === null && connection.state === "open";
    const text = view.tool !== null ? view.hint : refusal || (isLoading ? mapView.loading : "");
    setText(hint, text);
    hint.hidden = text === "";
  };
  view.scene.onMap(tell);
  connection.onState(() => {
    refusal = "";
    tell();
  });
  connection.onStatus(({ id, level }) => {
    if (level === "error" && id === "page:sub:/sim/scene/view") {
      refusal = mapView.refused;
      tell();
    }
  });
  view.onView(() => {
    chase.setAttribute("aria-pressed", String(view.isChase));
    follow.setAttribute("aria-pressed", String(view.isFollowing));
    measure.setAttribute("aria-pressed", String(view.tool instanceof MeasureTool));
    const turn = view.isChase ? view.chase.heading + view.chase.look.turn - Math.PI / 2 : -view.top.rotation;
    north.style.transform = `rotate(${turn.toFixed(3)}rad)`;
    showScale(view, bar);
    showCoordinates(view, coordinates, mapView);
    tell();
  });
  return element("div", { className: "map-controls" }, toolbar, hint, element("div", { className: "map-foot" }, bar, coordinates));
}

/** @param {MapView} view @param {HTMLElement} bar */
function showScale(view, bar) {
  bar.hidden = view.isChase;
  const metres = roundLength(SCALE_PIXELS * view.top.pixelSize);
  bar.style.width = `${(metres * view.top.scale).toFixed(1)}px`;
  setText(bar, lengthText(metres));
}

/** @param {MapView} view @param {HTMLElement} node @param {import("../layout.js").Texts["mapView"]} texts */
function showCoordinates(view, node, texts) {
  const { pointer } = view;
  const place = pointer === null ? null : view.camera.placeAt(pointer.x, pointer.y);
  const digits = view.top.scale > 20 && !view.isChase ? 2 : 1;
  setText(node, place === null ? "" : texts.coordinates(place.x.toFixed(digits), place.y.toFixed(digits)));
  node.hidden = place === null;
}

/**
 * Listen to the keys of the map. Others come first: a key that drives the car is no key of the map.
 * @param {MapView} view @param {import("../layout.js").Texts} texts
 */
export function listenToMapKeys(view, texts) {
  /** @type {Record<string, () => void>} */
  const keys = {
    c: () => view.toggleCamera(),
    v: () => view.setCamera(CAMERAS[(CAMERAS.indexOf(view.mode) + 1) % CAMERAS.length] ?? "top"),
    f: () => view.toggleFollow(),
    "+": () => view.zoomBy(ZOOM_STEP),
    "=": () => view.zoomBy(ZOOM_STEP),
    "-": () => view.zoomBy(1 / ZOOM_STEP),
    ",": () => view.turnBy(TURN_STEP),
    ".": () => view.turnBy(-TURN_STEP),
    n: () => view.northUp(),
    0: () => view.showAll(),
    m: () => view.toggleMeasure(),
    "?": () => showMapHelp(texts),
  };
  /** @type {Record<string, () => void>} */
  const arrows = {
    ArrowLeft: () => view.panBy(PAN_STEP, 0),
    ArrowRight: () => view.panBy(-PAN_STEP, 0),
    ArrowUp: () => view.panBy(0, PAN_STEP),
    ArrowDown: () => view.panBy(0, -PAN_STEP),
  };
  window.addEventListener("keydown", (event) => {
    const { target } = event;
    if (event.defaultPrevented || event.ctrlKey || event.altKey || event.metaKey || isInForm(target)) {
      return;
    }
    const isOnMap = target === view.canvas || target === document.body;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    let act = keys[key] ?? (isOnMap ? arrows[key] : undefined);
    if (key === "o") {
      act = () => view.scene.selectNext(event.shiftKey ? -1 : 1);
    } else if (key === "Escape") {
      act = () => void (view.endTool() || view.scene.select(null));
    }
    if (act) {
      event.preventDefault();
      act();
    }
  });
}

/** @param {EventTarget | null} target */
function isInForm(target) {
  return target instanceof Element && target.closest("input, select, textarea, dialog, [contenteditable]") !== null;
}
