// The state of time, from the messages of the simulator: whether it runs, who moves it, and what the user may do.

import { nameOfMaster } from "./drivers_watch.js";

/**
 * The latest messages about time; null until one has come.
 * @typedef {{
 *   sync: {master_id: string, status: boolean, frame: number, can_send_tick: boolean} | null,
 *   process: {current_mode: number, current_status: number} | null,
 *   drivers: import("./drivers_watch.js").DriversMessage | null,
 *   userId: string,
 *   isOpen: boolean,
 *   isMoving: boolean,
 * }} TimeMessages
 *   userId: of this page; isOpen: the connection; isMoving: a `/sim/step` of this page is under way
 */

/**
 * @typedef {{
 *   kind: "unknown" | "running" | "paused" | "synchronous",
 *   frame: number,
 *   master: string,
 *   isOwn: boolean,
 *   isPaused: boolean,
 *   isReplay: boolean,
 *   members: string[],
 *   timeStep: number,
 * }} TimeState
 *   master: name for the user, empty without one; isOwn: this page is the master; isPaused: also in synchronous mode; members: of
 *   the barrier; timeStep: of the ticks [ms], 0 where it is not known
 */

/** `current_mode` of `/sim/process/state/msg/MoraiSimProcStatus` during a replay. */
const REPLAY_MODE = 16;
/** `current_status` of the same topic. */
const PAUSED_STATUS = 16;
const END_STATUS = 32;

/** @param {TimeMessages} messages @param {import("./drivers_watch.js").NameTexts} names @returns {TimeState} */
export function timeStateOf({ sync, process, drivers, userId }, names) {
  const id = sync?.master_id ?? "";
  // The two topics may tell of a new master one after the other.
  const told = drivers?.master === id ? drivers : { master: id, master_clients: [], barrier_members: [], time_step: 0 };
  const isOwn = id !== "" && id === userId;
  const isPaused = process?.current_status === PAUSED_STATUS || process?.current_status === END_STATUS;
  /** @type {TimeState["kind"]} */
  let kind = "unknown";
  if (sync?.status) {
    kind = "synchronous";
  } else if (sync || process) {
    kind = isPaused ? "paused" : "running";
  }
  return {
    kind,
    frame: Number(sync?.frame ?? 0),
    master: isOwn ? names.thisPage : id && nameOfMaster(told, names),
    isOwn,
    isPaused,
    isReplay: process?.current_mode === REPLAY_MODE,
    members: told.barrier_members,
    timeStep: told.time_step,
  };
}

/** @param {TimeState} state whether another client is the master */
export function isLedByOthers(state) {
  return state.kind === "synchronous" && state.master !== "" && !state.isOwn;
}

/** A factor as calm digits: 0.25, 1.0, 20. @param {number} factor */
export function factorText(factor) {
  return factor.toFixed(factor < 0.995 ? 2 : factor < 9.95 ? 1 : 0);
}

/** The state in words, without its pace. @param {TimeState} state @param {typeof import("../texts.js").TEXTS.time.states} texts */
export function timeStateText({ kind, isPaused, isReplay }, texts) {
  if (kind === "synchronous") {
    return isPaused ? texts.synchronousPaused : texts.synchronous;
  }
  return isReplay ? (isPaused ? texts.replayPaused : texts.replay) : texts[kind];
}

/**
 * Text for the speed of the world; empty if the text of the state says that the world stands.
 * @param {TimeState} state @param {number | null} factor real-time factor as the page has measured it; 0: the world stands; null: not known
 * yet @param {{none: string, stands: string, pace: (factor: string) => string}} texts
 */
export function paceText({ kind, isPaused }, factor, texts) {
  if (kind === "unknown" || isPaused) {
    return "";
  }
  return kind === "synchronous" && !factor ? texts.stands : texts.pace(factor === null ? texts.none : factorText(factor));
}

/** @typedef {typeof import("../texts.js").TEXTS.time.reasons} ReasonTexts */
/** @typedef {ReturnType<typeof timeReasons>} TimeReasons */

/**
 * @param {TimeState} state @param {{isOpen: boolean, isMoving: boolean}} page @param {ReasonTexts} texts
 * @returns reasons why actions are not possible now; an empty text: the action is possible
 */
export function timeReasons(state, { isOpen, isMoving }, texts) {
  const never = isOpen && state.kind !== "unknown" ? "" : texts.notConnected;
  const busy = never || (isMoving ? texts.moving : "");
  const led = isLedByOthers(state) ? texts.otherMaster(state.master) : "";
  const inSync = state.kind === "synchronous";
  const runs = state.kind === "running";
  return {
    pause: never || (state.isPaused ? texts.alreadyPaused : inSync && !isMoving && !led ? texts.syncStands : ""),
    run: busy || led || (runs ? texts.alreadyRuns : ""),
    step: busy || led,
    take: busy || led || (state.isOwn ? texts.alreadyMaster : ""),
    leave: busy || (state.isOwn ? "" : texts.notMaster),
    restore: busy || led,
    snapshot: busy,
    reset: busy || led,
    load: busy || led,
    factor: never || (inSync ? texts.noFactorInSync : ""),
    replay: busy || led,
    drive: never || led || (state.isReplay ? texts.replaying : ""),
  };
}
