/** Tools that take the clicks on the map for a time: measure a distance, or choose a place for something. */

import { lengthText } from "./scale_bar.js";

/** @typedef {{x: number, y: number}} Point */
/** @typedef {{x: number, y: number, heading: number | null}} PickedPlace */

/** A shorter drag than this gives a place without a heading [pixels]. */
const HEADING_DRAG = 12;

/** Measures between two clicks; a third click begins anew. */
export class MeasureTool {
  /** @type {Point[]} */
  places = [];

  /** @param {Point} place */
  tap(place) {
    this.places = this.places.length === 1 ? [this.places[0], place] : [place];
  }

  /** Distance between the two places [m]; null: they are not chosen yet. */
  get distance() {
    const [a, b] = this.places;
    return b ? Math.hypot(b.x - a.x, b.y - a.y) : null;
  }
}

/** Lets the user choose a place by a click, and its heading by a drag. */
export class PlaceTool {
  /** @type {Point[]} */
  places = [];

  /** @param {(place: PickedPlace | null) => void} finish */
  constructor(finish) {
    this.finish = finish;
  }

  /**
   * @param {Point | null} start - place in the map's frame; null: the sky @param {Point | null} now
   * @param {number} pixels - length of the drag @param {boolean} isDone
   */
  drag(start, now, pixels, isDone) {
    if (start === null) {
      return;
    }
    const hasHeading = now !== null && pixels >= HEADING_DRAG;
    this.places = hasHeading ? [start, now] : [start];
    if (isDone) {
      const heading = hasHeading ? Math.atan2(now.y - start.y, now.x - start.x) : null;
      this.finish({ ...start, heading });
    }
  }

  cancel() {
    this.finish(null);
  }
}

/**
 * Return the places of the tool, with the pointer as the second one of a distance that is not complete.
 * @param {import("./map_view.js").MapView} view @returns {Point[]}
 */
export function measuredPlaces({ tool, pointer, camera }) {
  const places = tool?.places ?? [];
  if (tool instanceof MeasureTool && places.length === 1 && pointer !== null) {
    const now = camera.placeAt(pointer.x, pointer.y);
    return now === null ? places : [places[0], now];
  }
  return places;
}

/** The length stands so far above the middle of its line [pixels]. */
const LENGTH_ABOVE = 14;

/**
 * Return the label of a measured distance.
 * @param {import("./map_view.js").MapView} view @returns {import("./labels.js").Label[]}
 */
export function toolLabels(view) {
  const [a, b] = measuredPlaces(view);
  if (!(view.tool instanceof MeasureTool) || b === undefined) {
    return [];
  }
  const z = view.isChase ? view.chase.target.z : 0;
  const point = view.camera.project({ x: 0.5 * (a.x + b.x), y: 0.5 * (a.y + b.y), z });
  const text = lengthText(Math.hypot(b.x - a.x, b.y - a.y));
  return point === null ? [] : [{ x: point.x, y: point.y - LENGTH_ABOVE, text, className: "map-label measure" }];
}
