/** Lines that change: trails, the mark of the selected entity, marks of collisions, a measured distance. */

import { CONTACT_SHOWN } from "../scene/contacts.js";
import { MATERIALS } from "../scene/materials.js";
import { measuredPlaces } from "./map_tools.js";
import { addMeetings, addVelocities, meetingsOf } from "./motion_marks.js";

/** @typedef {import("../scene/line_buffer.js").LineBuffer} LineBuffer */
/** @typedef {{x: number, y: number, z: number}} Place */

const TRAIL = { width: 0.35, minPixels: 2 };
const MARK = { width: 0.12, minPixels: 2 };
const CORNERS = /** @type {const} */ ([[1, 1], [-1, 1], [-1, -1], [1, -1]]); // prettier-ignore
/** Room between an entity and its mark: 0.4 m, and at least 5 pixels. */
const ROOM = 0.4;
const ROOM_PIXELS = 5;
/** A ring around a collision grows from 1 m to 6 m. */
const RING = [1, 6];

/** @param {LineBuffer} lines @param {import("../scene/trails.js").Trails} trails @param {Place} origin */
function addTrails(lines, trails, origin) {
  for (const [key, { points }] of trails.trails) {
    const style = { ...TRAIL, material: key < 0 ? MATERIALS.ego : MATERIALS.selected };
    for (let i = 3; i < points.length; i += 3) {
      lines.add(
        points[i - 3] - origin.x, points[i - 2] - origin.y, points[i - 1] - origin.z,
        points[i] - origin.x, points[i + 1] - origin.y, points[i + 2] - origin.z, style,
      ); // prettier-ignore
    }
  }
}

/**
 * Add a frame around an entity.
 * @param {LineBuffer} lines @param {import("../scene/store.js").SceneState} state @param {import("./picking.js").Poses} poses
 * @param {number} row @param {Place} origin @param {number} pixel - size of a pixel on the ground [m]
 */
function addFrame(lines, state, poses, row, origin, pixel) {
  const [cos, sin] = [Math.cos(poses.heading[row]), Math.sin(poses.heading[row])];
  const room = Math.max(ROOM, ROOM_PIXELS * pixel);
  const [long, wide] = [0.5 * state.length[row] + room, 0.5 * state.width[row] + room];
  const corners = CORNERS.map(([a, b]) => {
    const [u, v] = [a * long + state.center_x[row], b * wide];
    return [poses.x[row] + cos * u - sin * v - origin.x, poses.y[row] + sin * u + cos * v - origin.y];
  });
  const x = corners.map(([value]) => value);
  const y = corners.map(([, value]) => value);
  const z = new Array(4).fill(poses.z[row] - origin.z);
  lines.addLine(x, y, z, { ...MARK, material: MATERIALS.selected }, { isClosed: true });
}

/**
 * Add a ring around each new collision.
 * @param {LineBuffer} lines @param {import("../scene/contacts.js").Contact[]} contacts @param {Place} origin
 * @param {number} now - [ms] @param {boolean} isStill - rings do not grow
 */
function addContacts(lines, contacts, origin, now, isStill) {
  for (const contact of contacts) {
    const share = isStill ? 0.5 : Math.min(1, Math.max(0, (now - contact.at) / CONTACT_SHOWN));
    for (const part of isStill ? [1] : [share, (share + 0.5) % 1]) {
      addRing(lines, contact, origin, RING[0] + part * (RING[1] - RING[0]), MATERIALS.contact);
    }
  }
}

/** @param {LineBuffer} lines @param {Place} middle @param {Place} origin @param {number} radius - [m] @param {number} material */
function addRing(lines, middle, origin, radius, material) {
  const angles = Array.from({ length: 28 }, (_, i) => (i * 2 * Math.PI) / 28);
  const x = angles.map((angle) => middle.x - origin.x + radius * Math.cos(angle));
  const y = angles.map((angle) => middle.y - origin.y + radius * Math.sin(angle));
  lines.addLine(x, y, new Array(28).fill(middle.z - origin.z), { width: 0.2, minPixels: 2.5, material }, { isClosed: true });
}

/** Add a line through places that the user chose. @param {LineBuffer} lines @param {Place[]} places @param {Place} origin */
function addMeasure(lines, places, origin) {
  const [x, y, z] = [
    places.map((place) => place.x - origin.x),
    places.map((place) => place.y - origin.y),
    places.map((place) => place.z - origin.z),
  ];
  lines.addLine(x, y, z, { width: 0.05, minPixels: 2.5, material: MATERIALS.measure });
  for (const place of places) {
    addRing(lines, place, origin, 0.5, MATERIALS.measure);
  }
}

/**
 * Fill the buffer of all these lines, if one of them has changed.
 * @param {import("./map_view.js").MapView} view @param {import("../scene/contacts.js").Contact[]} fresh - that are marked now
 */
export function fillLines(view, fresh) {
  const { lines, renderer, scene, poses } = view;
  const selected = scene.selectedRow();
  const isMoving = view.showsVelocities || view.showsMeetings;
  if (!view.hasNewLines && fresh.length === 0 && selected < 0 && !isMoving) {
    return;
  }
  view.hasNewLines = false;
  lines.clear();
  addTrails(lines, view.trails, renderer.origin);
  if (selected >= 0 && poses.last !== null) {
    const pixel = view.isChase ? 0 : view.top.pixelSize;
    addFrame(lines, poses.last, poses, selected, renderer.origin, pixel);
  }
  if (view.showsVelocities && poses.last !== null) {
    addVelocities(lines, poses.last, poses, renderer.origin, view.hiddenRow());
  }
  view.meetings = view.showsMeetings && poses.last !== null ? meetingsOf(poses.last, poses, view.targetRow()) : [];
  addMeetings(lines, poses, view.targetRow(), view.meetings, renderer.origin);
  addContacts(lines, fresh, renderer.origin, performance.now(), view.still.matches);
  if (view.tool !== null) {
    const z = view.isChase ? view.chase.target.z : 0;
    addMeasure(lines, measuredPlaces(view).map((place) => ({ ...place, z })), renderer.origin);
  }
  renderer.setLines(lines);
}
