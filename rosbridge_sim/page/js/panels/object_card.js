/** The card of the selected entity: what it is, where it is, and what it does. */

import { KINDS } from "../scene/store.js";
import { closeButton, element, replaceChildren, setText } from "../widgets/dom.js";

/** @typedef {import("../scene/store.js").SceneStore} SceneStore */
/** @typedef {import("../wire/connection.js").Connection} Connection */

/** The card asks once a second [ms]: its words do not change faster than a person reads. */
const ASK_EVERY = 1000;

/** The card. */
export class ObjectCard {
  /**
   * @param {Pick<import("./context.js").PanelContext, "connection" | "scene" | "drivers" | "texts">} context
   * @param {import("../drawing/map_view.js").MapView | null} view
   */
  constructor({ connection, scene, drivers, texts }, view) {
    this.connection = connection;
    this.drivers = drivers;
    this.scene = scene;
    this.texts = texts.objectCard;
    this.controllers = texts.ego.drivers;
    this.names = texts.mapView;
    this.title = element("h2", {});
    this.does = element("p", { className: "does" });
    this.rows = element("dl", {});
    /** Cells of the rows by label, so that a value that stays is not written again. @type {Map<string, HTMLElement>} */
    this.cells = new Map();
    /** @type {any} answer of /sim/describe about the selected entity */
    this.answer = null;
    /** @type {any} */
    this.timer = undefined;
    const follow = element("button", { type: "button", hidden: view === null }, this.texts.followThis);
    follow.onclick = () => {
      if (view !== null && !view.isFollowing) {
        view.toggleFollow();
      }
    };
    this.element = element(
      "section",
      { className: "object-card", "aria-label": this.texts.label, hidden: true },
      closeButton(this.texts.close, () => scene.select(null)),
      this.title,
      this.does,
      this.rows,
      follow,
    );
    scene.onSelect(() => this.open());
    scene.onState(() => this.show());
  }

  open() {
    clearTimeout(this.timer);
    this.answer = null;
    this.cells.clear();
    replaceChildren(this.rows);
    this.element.hidden = this.scene.selectedRow() < 0;
    this.show();
    if (!this.element.hidden) {
      void this.ask();
    }
  }

  async ask() {
    const { selectedId: id, isEgoSelected } = this.scene;
    const isSame = () => this.scene.selectedId === id && this.scene.isEgoSelected === isEgoSelected;
    try {
      const answer = await this.connection.call("/sim/describe", { id });
      // An ego and an object may have the same number; the service tells of the ego then.
      if (isSame() && answer.result && (answer.kind === 0) === isEgoSelected) {
        this.answer = answer;
        this.show();
      }
    } catch {
      // The state of the scene has the rest; the next question may have an answer.
    }
    if (isSame() && !this.element.hidden) {
      clearTimeout(this.timer);
      this.timer = setTimeout(() => void this.ask(), ASK_EVERY);
    }
  }

  show() {
    const { scene, texts, answer } = this;
    const row = scene.selectedRow();
    const { state } = scene;
    if (this.element.hidden || state === null || row < 0) {
      return;
    }
    const kind = KINDS[state.kind[row]] ?? "obstacle";
    const id = state.id[row];
    setText(this.title, kind === "ego" ? this.names.ego(id) : this.names.entity(this.names.kinds[kind], id));
    setText(this.does, answer?.text ?? "");
    this.does.hidden = !answer?.text;
    this.setRow(texts.id, String(id));
    this.setRow(texts.model, answer?.model ?? "");
    this.setRow(texts.speed, texts.kmh(3.6 * state.speed[row]));
    this.setRow(texts.lane, answer ? this.laneText(answer) : "");
    this.setRow(texts.next, (answer?.next_links ?? []).join(", "));
    this.setRow(texts.place, this.names.coordinates(state.x[row].toFixed(1), state.y[row].toFixed(1)));
    this.setRow(texts.heading, `${((state.heading[row] * 180) / Math.PI).toFixed(0)}°`);
    this.setRow(texts.controlled, answer?.client ? this.drivers.nameOf(answer.client) : (this.controllers[answer?.controlled_by] ?? ""));
    this.setRow(texts.follows, answer?.follows ? texts.gap(this.nameOf(answer.lead_id), answer.gap.toFixed(1)) : "");
    this.setRow(texts.stops, answer?.stops_for ? this.stopText(answer) : "");
    this.setRow(texts.givesWay, answer?.gives_way ? this.nameOf(answer.gives_way_to) : "");
  }

  /** @param {any} answer */
  laneText({ link, distance, lateral }) {
    return link === "" ? this.texts.noLane : this.texts.lanePlace(link, distance.toFixed(1), (Math.round(100 * lateral) / 100 || 0).toFixed(2));
  }

  /** @param {any} answer */
  stopText(answer) {
    const reason = /** @type {Record<string, string>} */ (this.texts.reasons)[answer.stops_for] ?? answer.stops_for;
    const what = answer.light ? `${reason} ${answer.light}` : reason;
    return answer.stop_distance >= 0 ? this.texts.stopIn(what, answer.stop_distance.toFixed(1)) : what;
  }

  /** @param {number} id */
  nameOf(id) {
    const row = this.scene.indexOf(id);
    const kind = KINDS[this.scene.state?.kind[row] ?? 1] ?? "vehicle";
    return kind === "ego" ? this.names.ego(id) : this.names.entity(this.names.kinds[kind], id);
  }

  /** Show a row; an empty value hides it. @param {string} label @param {string} value */
  setRow(label, value) {
    let cell = this.cells.get(label);
    if (cell === undefined) {
      cell = element("dd", {});
      this.cells.set(label, cell);
      this.rows.append(element("div", {}, element("dt", {}, label), cell));
    }
    setText(cell, value);
    const line = /** @type {HTMLElement} */ (cell.parentElement);
    if (line.hidden !== (value === "")) {
      line.hidden = value === "";
    }
  }
}
