// A place for something: by a click or drag on the map, or by numbers.

import { element } from "../widgets/dom.js";
import { labelled } from "../widgets/action_button.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {import("../wire/requests.js").MapPlace} MapPlace */

/** A new object stands so far in front of the ego, if nothing else is known [m]. */
const AHEAD = 15;

/** Fields for a place in numbers. */
export class PlaceFields {
  /** @param {PanelContext} context */
  constructor(context) {
    const { objects: texts } = context.texts;
    this.context = context;
    const field = () => element("input", { type: "number", step: "any", required: true });
    this.x = field();
    this.y = field();
    this.heading = field();
    this.element = element(
      "div",
      { className: "button-row" },
      labelled(texts.x, this.x),
      labelled(texts.y, this.y),
      labelled(texts.heading, this.heading),
    );
    context.ego.onValues(() => {
      if (!this.x.value) {
        this.showAhead();
      }
    });
  }

  /** Show a place in front of the ego. */
  showAhead() {
    const values = this.context.ego.values;
    if (values) {
      const { x, y, heading } = values;
      this.show({ x: x + AHEAD * Math.cos(heading), y: y + AHEAD * Math.sin(heading), heading });
    }
  }

  /** @param {MapPlace} place */
  show({ x, y, heading }) {
    this.x.value = x.toFixed(2);
    this.y.value = y.toFixed(2);
    this.heading.value = ((heading * 180) / Math.PI).toFixed(1);
  }

  /** @returns {MapPlace} @throws {Error} a field has no number */
  get place() {
    const [x, y, degrees] = [this.x.valueAsNumber, this.y.valueAsNumber, this.heading.valueAsNumber];
    if (![x, y, degrees].every(Number.isFinite)) {
      throw new Error(this.context.texts.objects.badPlace);
    }
    return { x, y, heading: (degrees * Math.PI) / 180 };
  }
}

/**
 * Let the user choose a place on the map. Without a drag the heading is that of the lane there.
 * @param {PanelContext} context @param {string} hint @returns {Promise<MapPlace | null>} null if the user gave it up
 */
export async function pickOnMap({ mapView, ego }, hint) {
  const picked = await mapView?.pickPlace({ hint });
  return picked ? withLaneHeading(picked, ego) : null;
}

/**
 * @param {{x: number, y: number, heading: number | null}} picked heading: null without a drag
 * @param {import("./ego_watch.js").EgoWatch} ego @returns {MapPlace}
 */
export function withLaneHeading({ x, y, heading }, ego) {
  return { x, y, heading: heading ?? ego.lanes?.nearest(x, y, ego.values?.heading ?? 0)?.heading ?? 0 };
}
