/** Actions of the pointer on the map: move it, choose an entity or a light, and use a tool. */

import { listenToGestures } from "./gestures.js";
import { MeasureTool, PlaceTool } from "./map_tools.js";
import { pickEntity, pickPlaceOnScreen } from "./picking.js";

/** @typedef {import("./map_view.js").MapView} MapView */
/** @typedef {import("./gestures.js").Point} Point */

/** Reach of a click around an entity and a light [pixels]. */
const ENTITY_REACH = 14;
const LIGHT_REACH = 12;
/** An entity near the camera behind a car counts as at least this large [m]. */
const SMALLEST_BOX = 0.5;
/** Turn of the picture for each pixel of a drag [rad]. */
const TURN_BY_DRAG = 0.006;

/** Listen to the pointers on the map. @param {MapView} view */
export function listenToPointers(view) {
  const middle = () => ({ x: 0.5 * view.top.width, y: 0.5 * view.top.height });
  listenToGestures(view.canvas, {
    pan: (dx, dy) => view.panBy(dx, dy),
    zoom: (x, y, factor) => view.zoom(x, y, factor),
    turn: (x, y, dx, dy) => {
      if (view.isChase) {
        view.panBy(dx, dy);
      } else {
        const still = view.isFollowing ? middle() : { x, y };
        view.twist(still.x, still.y, TURN_BY_DRAG * dx);
      }
    },
    twist: (x, y, angle) => view.twist(x, y, angle),
    hover: (point) => {
      view.pointer = point;
      view.hover();
    },
    tap: (point) => tap(view, point),
    doubleTap: (point) => {
      if (view.tool === null && entityAt(view, point) >= 0) {
        view.isFollowing = true;
        view.change();
      }
    },
    draw: (start, now, isDone) => drawWithTool(view, start, now, isDone),
  });
}

/**
 * @param {MapView} view @param {Point} start @param {Point} now @param {boolean} isDone @returns {boolean} a tool has taken it
 */
function drawWithTool(view, start, now, isDone) {
  const { camera, tool } = view;
  if (!(tool instanceof PlaceTool)) {
    return false;
  }
  const pixels = Math.hypot(now.x - start.x, now.y - start.y);
  tool.drag(camera.placeAt(start.x, start.y), camera.placeAt(now.x, now.y), pixels, isDone);
  view.change();
  return true;
}

/** @param {MapView} view @param {Point} point */
function tap(view, point) {
  const { scene, camera, tool } = view;
  if (tool instanceof MeasureTool) {
    const place = view.camera.placeAt(point.x, point.y);
    if (place !== null) {
      tool.tap(place);
      view.change();
    }
    return;
  }
  const row = entityAt(view, point);
  if (row >= 0 && scene.state !== null) {
    scene.select(scene.state.id[row], scene.state.kind[row] === 0);
    return;
  }
  const lights = scene.map?.lights ?? [];
  const light = pickPlaceOnScreen(lights, camera, point.x, point.y, LIGHT_REACH);
  if (light >= 0) {
    view.lights.tell(lights[light].name);
  } else {
    scene.select(null);
  }
}

/** @param {MapView} view @param {Point} point @returns {number} row; -1: none is there */
function entityAt(view, { x, y }) {
  const { poses, camera } = view;
  if (poses.last === null) {
    return -1;
  }
  const smallest = view.isChase ? SMALLEST_BOX : ENTITY_REACH * view.top.pixelSize;
  return pickEntity(poses.last, poses, camera.rayAt(x, y), smallest);
}

/**
 * Take things that are dropped on the map.
 * @param {import("./map_view.js").MapView} view @param {string} kind - of `DataTransfer`
 * @param {(place: import("./gestures.js").Point) => void} take
 */
export function listenToDrops(view, kind, take) {
  const { canvas } = view;
  canvas.addEventListener("dragover", (event) => {
    if (event.dataTransfer?.types.includes(kind)) {
      event.preventDefault();
    }
  });
  canvas.addEventListener("drop", (event) => {
    const { left, top } = canvas.getBoundingClientRect();
    const place = view.camera.placeAt(event.clientX - left, event.clientY - top);
    if (event.dataTransfer?.types.includes(kind) && place !== null) {
      event.preventDefault();
      take(place);
    }
  });
}
