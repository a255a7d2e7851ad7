// The state of time for all panels: the topics behind it are subscribed once.

import { Takers } from "../wire/takers.js";
import { FrameRate } from "./frame_rate.js";
import { timeReasons, timeStateOf } from "./time_state.js";

/** @typedef {import("../wire/connection.js").Connection} Connection */
/** @typedef {import("./time_state.js").TimeState} TimeState */
/** @typedef {import("./time_state.js").TimeReasons} TimeReasons */

/** Length of a frame [s]. */
export const FRAME_S = 0.02;
/** Messages about time at most so often [ms]: a person reads no faster, and a single step is seen at once. */
const TIME_THROTTLE = 200;
/** Interval between updates of the factor while no message arrives, because the world stands [ms]. */
const REFRESH = 500;

export class TimeWatch {
  changes = new Takers();
  onChange = this.changes.addNow;

  /**
   * @param {Connection} connection @param {import("./drivers_watch.js").DriversWatch} drivers
   * @param {import("../layout.js").Texts} texts
   */
  constructor(connection, drivers, texts) {
    const { userId } = drivers;
    this.connection = connection;
    this.userId = userId;
    this.texts = texts;
    /** @type {import("./time_state.js").TimeMessages} */
    this.messages = { sync: null, process: null, drivers: null, userId, isOpen: false, isMoving: false };
    this.ownTimeStep = 20;
    this.rate = new FrameRate();
    /** The command of a driver at the keys for a step of so many seconds. @type {(seconds: number) => {ego: number, command: import("../wire/requests.js").PedalCommand} | null} */
    this.drivenCommand = () => null;
    /** @type {TimeState} */
    this.state = timeStateOf(this.messages, texts.clientNames);
    /** @type {TimeReasons} */
    this.reasons = timeReasons(this.state, this.messages, texts.time.reasons);
    const options = { throttleMs: TIME_THROTTLE, queueLength: 1 };
    connection.subscribe("/SyncModeInfo", "morai_msgs/SyncModeInfo", (sync) => this.take({ sync }), options);
    const status = "/sim/process/state/msg/MoraiSimProcStatus";
    connection.subscribe(status, "morai_msgs/MoraiSimProcStatus", (process) => this.take({ process }), options);
    drivers.onChange(() => this.take({ drivers: drivers.message }));
    connection.onState((state) => {
      this.rate = new FrameRate();
      this.take(state === "open" ? { isOpen: true } : { isOpen: false, sync: null, process: null });
    });
    setInterval(() => document.hidden || this.changes.tell(), REFRESH);
  }

  /** @param {Partial<import("./time_state.js").TimeMessages>} change */
  take(change) {
    Object.assign(this.messages, change);
    this.state = timeStateOf(this.messages, this.texts.clientNames);
    this.reasons = timeReasons(this.state, this.messages, this.texts.time.reasons);
    if (change.sync) {
      this.rate.add(performance.now(), this.state.frame);
    }
    this.changes.tell();
  }

  /** Simulated seconds in a second of the browser's clock; 0: the world stands; null: not known yet. @returns {number | null} */
  get factor() {
    const { isOwn } = this.state;
    const rate = isOwn && !this.messages.isMoving ? 0 : this.rate.at(performance.now()); // nobody else moves the world of this page
    return rate === null ? null : rate * FRAME_S;
  }

  /** True if messages of frames, such as pictures, come only after a step or the end of a pause. */
  get isStanding() {
    return this.state.isPaused || (this.state.kind === "synchronous" && !this.factor);
  }
}
