// The state of time, from the messages of the simulator: whether it runs, who moves it, and what the user may do.

/**
 * The latest messages about time; null until one has come.
 * @typedef {{
 *   sync: {master_id: string, status: boolean, frame: number, can_send_tick: boolean} | null,
 *   process: {current_mode: number, current_status: number} | null,
 *   barrier: {members: string[], time_step: number, waited_for: string[]} | null,
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
 *   isReplayEnd: boolean,
 *   members: string[],
 * }} TimeState
 *   master: user id, empty without one; isOwn: this page is the master; isPaused: also in synchronous mode
 */

/** Master's id while several clients tick together. */
const BARRIER_MASTER = "/sim/barrier";
/** `current_mode` of `/sim/process/state/msg/MoraiSimProcStatus` during a replay. */
const REPLAY_MODE = 16;
/** `current_status` of the same topic. */
const PAUSED_STATUS = 16;
const END_STATUS = 32;

/** @param {TimeMessages} messages @returns {TimeState} */
export function timeStateOf({ sync, process, barrier, userId }) {
  const master = sync?.master_id ?? "";
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
    master,
    isOwn: master !== "" && master === userId,
    isPaused,
    isReplay: process?.current_mode === REPLAY_MODE,
    isReplayEnd: process?.current_status === END_STATUS,
    members: master === BARRIER_MASTER ? (barrier?.members ?? []) : [],
  };
}

/** @param {TimeState} state whether another client is the master */
export function isLedByOthers(state) {
  return state.kind === "synchronous" && state.master !== "" && !state.isOwn;
}

/** The name of the other master, for the user. @param {TimeState} state */
export function masterName(state) {
  return state.members.length ? state.members.join(", ") : state.master;
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
  const led = isLedByOthers(state) ? texts.otherMaster(masterName(state)) : "";
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
