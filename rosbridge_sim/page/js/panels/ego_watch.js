// The ego that the panels show and drive, and its messages.

import { lightMaterial } from "../scene/light_bars.js";
import { MATERIALS } from "../scene/materials.js";
import { kindOfWay, TIMELINE_SPAN } from "../scene/timeline.js";
import { egoName } from "../wire/requests.js";
import { activityOf, isAtRedLight } from "./ego_activity.js";
import { egoValues, LAMP_BITS, sceneValues } from "./ego_values.js";
import { LaneIndex } from "./lane_offset.js";
import { Takers } from "../wire/takers.js";

/** @typedef {import("./ego_values.js").EgoValues} EgoValues */

/** Messages of the ego at most so often [ms]: as fast as an eye reads a moving instrument. */
const EGO_THROTTLE = 100;
/** A value of the past is shown for so long [s]: longer there was none. */
const VALUE_HOLDS = 0.5;
/** Values that are kept at most: two minutes of ten a second. */
const MOST_VALUES = 1300;

export class EgoWatch {
  changes = new Takers();
  choices = new Takers();
  /** @type {Takers<[EgoValues, number]>} */
  messages = new Takers();
  /** Be told of each message of the ego with its distance to the lane's middle [m], also while the past is shown. */
  onMessage = this.messages.add;
  /** Be told of each change of the values that are shown. */
  onValues = this.changes.add;
  /** Be told after another ego was chosen. */
  onChoice = this.choices.add;

  /** @param {import("../wire/connection.js").Connection} connection @param {import("../scene/store.js").SceneStore} scene */
  constructor(connection, scene) {
    this.connection = connection;
    this.scene = scene;
    this.number = 0;
    /** From this connection alone; null before its first state. @type {EgoValues | null} */
    this.values = null;
    /** The ego's own topic has sent something. */
    this.hasMessage = false;
    this.link = "";
    this.laneOffset = NaN;
    /** @type {LaneIndex | null} */
    this.lanes = null;
    /** @type {{close: () => void} | null} */
    this.subscription = null;
    /** Values of the last two minutes, the oldest first. @type {EgoValues[]} */
    this.history = [];
    /** Lane of the last message, or of the scene before the first one. */
    this.lastLink = "";
    scene.onMap(() => {
      this.lanes = new LaneIndex(scene.map?.lanes ?? []);
      this.takeScene();
    });
    scene.onState(() => {
      this.keepChoice();
      this.takeScene();
    });
    connection.onState(() => this.forget());
    this.choose(0);
  }

  /** Show the first ego again if the chosen one has gone. */
  keepChoice() {
    const egos = this.scene.egos();
    if (this.scene.past === null && this.number !== 0 && egos.length && !egos.some((ego) => ego.number === this.number)) {
      this.choose(0);
    }
  }

  /** @param {number} number of the ego: 0, 2, 3, ... */
  choose(number) {
    this.subscription?.close();
    this.number = number;
    this.forget();
    this.subscription = this.connection.subscribe(
      egoName(number, "/Ego_topic"),
      "morai_msgs/EgoVehicleStatus",
      (message) => this.take(message),
      { throttleMs: EGO_THROTTLE, queueLength: 1 },
    );
    this.choices.tell();
  }

  /** Forget what another connection or another ego has told. */
  forget() {
    this.history = [];
    this.lastLink = "";
    this.hasMessage = false;
    this.values = null;
    this.changes.tell();
  }

  /** Show the ego of the past, or that of the scene's state until its own topic sends something. */
  takeScene() {
    const { past } = this.scene;
    const ego = this.hasMessage && past === null ? undefined : this.scene.egos().find((one) => one.number === this.number);
    const values = past === null ? this.history.at(-1) : this.history.filter(({ time }) => time <= past.time + 1e-6).at(-1);
    if (values && !(past !== null && past.time - values.time > VALUE_HOLDS)) {
      this.setValues(values);
    } else if (ego) {
      this.setValues(sceneValues(ego));
    }
  }

  /** @param {any} message */
  take(message) {
    this.hasMessage = true;
    const values = egoValues(message);
    const { history } = this;
    while (history.length > 0 && (history[history.length - 1]?.time ?? 0) >= values.time) {
      history.pop(); // time has gone back
    }
    history.push(values);
    while ((history[0]?.time ?? 0) < values.time - TIMELINE_SPAN || history.length > MOST_VALUES) {
      history.shift();
    }
    const lane = this.laneOf(values);
    this.markWay(lane?.link ?? "", values.time);
    this.messages.tell(values, lane?.lateral ?? NaN);
    if (this.scene.past === null) {
      this.setValues(values);
    }
  }

  /** Mark on the timeline where the ego has changed its lane or passed a red light. @param {string} link @param {number} time [s] */
  markWay(link, time) {
    const { map, live, timeline } = this.scene;
    const [before, after] = [this.lastLink, link].map((name) => map?.lanes.find((lane) => lane.link === name));
    this.lastLink = link;
    if (before && after && before !== after) {
      const light = map?.lights.findIndex(({ name }) => name === after.light) ?? -1;
      const kind = kindOfWay(before, after, light >= 0 && lightMaterial(live?.light_state[light] ?? 0) === MATERIALS.lightRed);
      if (kind !== null) {
        timeline.mark(kind, kind === "red" ? after.light : `${before.link}, ${after.link}`, time);
      }
    }
  }

  /** Return the ego's present activity, also while the past is shown. @param {string} driver as in `/sim/drivers` */
  activity(driver) {
    const { live, map } = this.scene;
    const ego = this.scene.egos(live).find(({ number }) => number === this.number);
    if (live === null || ego === undefined) {
      return null;
    }
    const { x, y, heading, speed, row } = ego;
    const isAtRed = () => map !== null && isAtRedLight(ego, this.lanes?.nearest(x, y, heading)?.link ?? "", map, live.light_state);
    return activityOf({ speed, isBraking: (Number(live.lamps[row]) & LAMP_BITS.brake) !== 0, driver, isAtRed });
  }

  /** @param {EgoValues} values */
  laneOf({ x, y, heading }) {
    return this.lanes?.nearest(x, y, heading) ?? null;
  }

  /** @param {EgoValues} values */
  setValues(values) {
    const lane = this.laneOf(values);
    this.values = values;
    this.link = lane?.link ?? "";
    this.laneOffset = lane?.lateral ?? NaN;
    if (this.lastLink === "" && this.scene.past === null) {
      this.lastLink = this.link; // a change is one from the lane that is shown
    }
    this.changes.tell();
  }
}
