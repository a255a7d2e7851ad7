// The state of time for all panels: the topics behind it are subscribed once.

import { timeReasons, timeStateOf } from "./time_state.js";
import { Takers } from "../wire/takers.js";

/** @typedef {import("../wire/connection.js").Connection} Connection */
/** @typedef {import("./time_state.js").TimeState} TimeState */
/** @typedef {import("./time_state.js").TimeReasons} TimeReasons */

/** Length of a frame [s]. */
export const FRAME_S = 0.02;
/** The rate of frames is measured over so long [ms]: the figure is calm, and follows within two seconds. */
const RATE_WINDOW = 2000;
/** Messages about time at most so often [ms]: a person reads no faster, and a single step is seen at once. */
const TIME_THROTTLE = 200;

export class TimeWatch {
  changes = new Takers();
  onChange = this.changes.addNow;

  /** @param {Connection} connection @param {string} userId of this page @param {import("./time_state.js").ReasonTexts} texts */
  constructor(connection, userId, texts) {
    this.connection = connection;
    this.userId = userId;
    this.texts = texts;
    /** @type {import("./time_state.js").TimeMessages} */
    this.messages = { sync: null, process: null, barrier: null, userId, isOpen: false, isMoving: false };
    /** Time step of the ticks, where it is known [ms]. */
    this.timeStep = 0;
    this.ownTimeStep = 20;
    /** @type {{at: number, frame: number}[]} */
    this.samples = [];
    /** The command of a driver at the keys for a step of so many seconds. @type {(seconds: number) => {ego: number, command: import("../wire/requests.js").PedalCommand} | null} */
    this.drivenCommand = () => null;
    /** @type {TimeState} */
    this.state = timeStateOf(this.messages);
    /** @type {TimeReasons} */
    this.reasons = timeReasons(this.state, this.messages, texts);
    const options = { throttleMs: TIME_THROTTLE, queueLength: 1 };
    connection.subscribe("/SyncModeInfo", "morai_msgs/SyncModeInfo", (sync) => this.take({ sync }), options);
    const status = "/sim/process/state/msg/MoraiSimProcStatus";
    connection.subscribe(status, "morai_msgs/MoraiSimProcStatus", (process) => this.take({ process }), options);
    connection.subscribe("/sim/barrier", "rosbridge_sim_msgs/Barrier", (barrier) => this.take({ barrier }), options);
    connection.onState((state) => {
      this.samples = [];
      this.take(state === "open" ? { isOpen: true } : { isOpen: false, sync: null, process: null, barrier: null });
    });
  }

  /** @param {Partial<import("./time_state.js").TimeMessages>} change */
  take(change) {
    Object.assign(this.messages, change);
    this.state = timeStateOf(this.messages);
    const { isOwn, members } = this.state;
    this.timeStep = isOwn ? this.ownTimeStep : members.length ? (this.messages.barrier?.time_step ?? 0) : 0;
    this.reasons = timeReasons(this.state, this.messages, this.texts);
    if (change.sync) {
      this.addSample(performance.now(), this.state.frame);
    }
    this.changes.tell();
  }

  /** @param {number} at [ms] @param {number} frame */
  addSample(at, frame) {
    const last = this.samples.at(-1);
    if (last && frame < last.frame) {
      this.samples = []; // a reset, or an older snapshot
    }
    this.samples.push({ at, frame });
    while (this.samples.length > 2 && /** @type {{at: number}} */ (this.samples[1]).at < at - RATE_WINDOW) {
      this.samples.shift();
    }
  }

  /** Frames in a second of wall time, over the last two seconds. */
  get frameRate() {
    const [first] = this.samples;
    const last = this.samples.at(-1);
    if (!first || !last) {
      return 0;
    }
    const now = performance.now();
    const until = now - last.at > RATE_WINDOW / 4 ? now : last.at; // nothing has come lately: the world stands
    return until > first.at && until - first.at < 2 * RATE_WINDOW ? ((last.frame - first.frame) * 1000) / (until - first.at) : 0;
  }
}
