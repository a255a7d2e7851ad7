// The ego that the panels show and drive, and its messages.

import { egoName } from "../wire/requests.js";
import { egoValues, sceneValues } from "./ego_values.js";
import { LaneIndex } from "./lane_offset.js";
import { Takers } from "../wire/takers.js";

/** @typedef {import("./ego_values.js").EgoValues} EgoValues */

/** Messages of the ego at most so often [ms]: as fast as an eye reads a moving instrument. */
const EGO_THROTTLE = 100;

export class EgoWatch {
  changes = new Takers();
  choices = new Takers();
  /** Be told of each message of the ego, and when the values are forgotten. */
  onValues = this.changes.add;
  /** Be told after another ego was chosen. */
  onChoice = this.choices.add;

  /**
   * @param {import("../wire/connection.js").Connection} connection
   * @param {import("../scene/store.js").SceneStore} scene
   */
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
    scene.onMap(() => {
      const lanes = /** @type {import("./lane_offset.js").LaneLine[]} */ (scene.map?.lanes ?? []);
      this.lanes = new LaneIndex(lanes);
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
    if (this.number !== 0 && egos.length && !egos.some((ego) => ego.number === this.number)) {
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
    this.hasMessage = false;
    this.values = null;
    this.changes.tell();
  }

  /** Show the ego of the scene's state until its own topic sends something. */
  takeScene() {
    const ego = this.hasMessage ? undefined : this.scene.egos().find((one) => one.number === this.number);
    if (ego) {
      this.setValues(sceneValues(ego));
    }
  }

  /** @param {any} message */
  take(message) {
    this.hasMessage = true;
    this.setValues(egoValues(message));
  }

  /** @param {EgoValues} values */
  setValues(values) {
    const lane = this.lanes?.nearest(values.x, values.y, values.heading) ?? null;
    this.values = values;
    this.link = lane?.link ?? "";
    this.laneOffset = lane?.lateral ?? NaN;
    this.changes.tell();
  }
}
