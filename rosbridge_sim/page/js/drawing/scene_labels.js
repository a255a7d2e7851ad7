/** The labels of the scene: names of egos and of the selected entity, and seconds that lights have left. */

import { KINDS } from "../scene/store.js";

/** @typedef {import("./labels.js").Label} Label */

/** Seconds of lights are shown from this scale on [pixels/m], for so many lights: those nearest to the middle. */
const LIGHT_LABEL_SCALE = 5;
const MOST_LIGHT_LABELS = 14;
/** Of a label above its entity, and beside its light [pixels]. */
const ABOVE = 20;
const BESIDE = 15;
/** Two lights nearer than this share one label [pixels]. */
const APART = 24;

/**
 * @param {object} view @param {import("../scene/store.js").SceneStore} view.scene
 * @param {import("./picking.js").Poses} view.poses
 * @param {import("./top_camera.js").TopCamera | import("./chase_camera.js").ChaseCamera} view.camera
 * @param {number} view.leading - row of the entity before the camera, which needs no name; -1: none
 * @param {import("../scene/contacts.js").Contact[]} view.contacts - that are marked now
 * @param {{other: number, time: number}[]} view.meetings - of the followed one
 * @param {{x: number, y: number, z: number, text: string}[]} view.texts - of programs
 * @param {import("../layout.js").Texts["mapView"]} texts @returns {Label[]}
 */
export function makeSceneLabels({ scene, poses, camera, leading, contacts, meetings, texts: marks }, texts) {
  const { state } = scene;
  if (state === null) {
    return [];
  }
  /** @type {Label[]} */
  const labels = [];
  const selected = scene.selectedRow();
  /** @type {(place: {x: number, y: number, z: number}, lift: number, text: string, className: string) => void} */
  const put = (place, lift, text, className) => {
    const point = camera.project(place);
    if (point !== null && isWithin(point, camera)) {
      labels.push({ x: point.x, y: point.y - lift, text, className });
    }
  };
  const add = (/** @type {number} */ row, /** @type {string} */ text, /** @type {string} */ className) => {
    const z = poses.z[row] + (camera.isPerspective ? state.height[row] : 0);
    put({ x: poses.x[row], y: poses.y[row], z }, ABOVE + (camera.isPerspective ? 0 : (0.4 * state.length[row]) / camera.pixelSize), text, className);
  };
  for (const { row, number } of scene.egos()) {
    if (row !== selected && row !== leading) {
      add(row, texts.ego(number), "map-label ego");
    }
  }
  if (selected >= 0 && selected !== leading) {
    const kind = KINDS[state.kind[selected]] ?? "obstacle";
    const id = state.id[selected];
    add(selected, kind === "ego" ? texts.ego(id) : texts.entity(texts.kinds[kind], id), "map-label selected");
  }
  for (const { other, time } of meetings) {
    add(other, texts.meeting(time.toFixed(1)), "map-label contact");
  }
  for (const contact of contacts) {
    put(contact, 2 * ABOVE, texts.collision(contactName(contact, 0, texts), contactName(contact, 1, texts)), "map-label contact");
  }
  marks.forEach((mark) => put(mark, 0, mark.text, "map-label"));
  labels.push(...lightLabels(scene, camera, texts));
  return labels;
}

/**
 * The name of one of both in a collision.
 * @param {import("../scene/contacts.js").Contact} contact @param {number} i - 0 or 1
 * @param {import("../layout.js").Texts["mapView"]} texts
 */
export function contactName({ id, kind, name }, i, texts) {
  const what = KINDS[kind[i]] ?? "obstacle";
  return what === "ego" ? texts.ego(id[i]) : `${texts.entity(texts.kinds[what], id[i])} (${name[i]})`;
}

/**
 * @param {import("../scene/store.js").SceneStore} scene
 * @param {import("./top_camera.js").TopCamera | import("./chase_camera.js").ChaseCamera} camera
 * @param {import("../layout.js").Texts["mapView"]} texts @returns {Label[]}
 */
function lightLabels({ map, state }, camera, texts) {
  if (map === null || state === null || map.digest !== state.map_digest) {
    return [];
  }
  /** @type {{x: number, y: number, away: number, text: string, className: string}[]} */
  const found = [];
  map.lights.forEach((light, row) => {
    const left = state.light_time_left[row];
    if (light.is_pedestrian || light.is_warning || !(left >= 0)) {
      return;
    }
    const point = camera.project(light);
    if (point !== null && point.scale >= LIGHT_LABEL_SCALE && isWithin(point, camera)) {
      const away = Math.hypot(point.x - 0.5 * camera.width, point.y - 0.5 * camera.height);
      const text = texts.timeLeft(Math.ceil(left));
      found.push({ x: point.x + BESIDE, y: point.y - 0.5 * BESIDE, away, text, className: "map-label light" });
    }
  });
  found.sort((a, b) => a.away - b.away);
  /** @type {Label[]} */
  const labels = [];
  for (const { x, y, text, className } of found) {
    const isFree = labels.every((other) => Math.hypot(other.x - x, other.y - y) >= APART);
    if (isFree && labels.length < MOST_LIGHT_LABELS) {
      labels.push({ x, y, text, className });
    }
  }
  return labels;
}

/** @param {{x: number, y: number}} point @param {{width: number, height: number}} screen */
function isWithin(point, { width, height }) {
  return point.x >= 0 && point.y >= 0 && point.x <= width && point.y <= height;
}
