// Actions of the buttons of time: pause, run, step, master of synchronous mode.

import {
  factorRequest, loadScenarioRequest, pauseRequest, replayRequest, resetRequest, restoreRequest, snapshotRequest,
  snapshotsRequest, startSyncRequest, stepRequest, stopSyncRequest,
} from "../wire/requests.js";

/** @typedef {import("./actions.js").Actions} Actions */
/** @typedef {import("./time_watch.js").TimeWatch} TimeWatch */

/** A load of a large map and 1,000 steps of a full town take seconds [ms]. */
const LONG_TIMEOUT = 120_000;

export class TimeControls {
  /** @param {Actions} actions @param {TimeWatch} watch @param {import("../layout.js").Texts["time"]["actions"]} titles */
  constructor(actions, watch, titles) {
    this.actions = actions;
    this.watch = watch;
    this.titles = titles;
  }

  pause() {
    return this.actions.run(this.titles.pause, pauseRequest(true));
  }

  /** Let real time move the world: give up synchronous mode, and end a pause. */
  async run() {
    const { kind, isPaused } = this.watch.state;
    if (kind === "synchronous") {
      await this.leave();
    }
    if (isPaused) {
      await this.actions.run(this.titles.run, pauseRequest(false));
    }
  }

  /** Let real time move the world, if it stands. */
  async letRun() {
    if (!this.watch.reasons.run) {
      await this.run();
    }
  }

  /** @param {number} timeStep [ms] */
  async take(timeStep) {
    await this.actions.run(this.titles.take, startSyncRequest(this.watch.userId, timeStep));
    this.watch.ownTimeStep = timeStep;
  }

  leave() {
    return this.actions.run(this.titles.leave, stopSyncRequest(this.watch.userId));
  }

  /**
   * Move the world by steps; take synchronous mode first if nobody has it. A pause ends only when the mode is taken, so the
   * world never moves by itself in between.
   * @param {number} steps @param {number} timeStep of the mode, if it is taken now [ms]
   */
  async step(steps, timeStep) {
    const { watch, actions, titles } = this;
    const wasPaused = watch.state.isPaused;
    if (!watch.state.isOwn) {
      await this.take(timeStep);
    }
    if (wasPaused) {
      await actions.run(titles.run, pauseRequest(false));
    }
    const driven = watch.drivenCommand((steps * watch.ownTimeStep) / 1000);
    watch.take({ isMoving: true });
    try {
      return await actions.run(titles.step(steps), stepRequest(watch.userId, steps, driven), { timeoutMs: LONG_TIMEOUT });
    } finally {
      watch.take({ isMoving: false });
    }
  }

  /** @param {number} seed negative: the present one */
  reset(seed) {
    return this.actions.run(this.titles.reset, resetRequest(seed), { timeoutMs: LONG_TIMEOUT });
  }

  /** @param {number} factor */
  setFactor(factor) {
    return this.actions.run(this.titles.factor(factor), factorRequest(factor));
  }

  /** @param {string} id */
  snapshot(id) {
    return this.actions.run(this.titles.snapshot, snapshotRequest(id), { timeoutMs: LONG_TIMEOUT });
  }

  /** @param {string} id */
  restore(id) {
    return this.actions.run(this.titles.restore(id), restoreRequest(id, this.watch.userId), { timeoutMs: LONG_TIMEOUT });
  }

  /** @param {string} id */
  removeSnapshot(id) {
    return this.actions.run(this.titles.removeSnapshot(id), snapshotsRequest([id]));
  }

  /** @param {string} name */
  load(name) {
    return this.actions.run(this.titles.load(name), loadScenarioRequest(name), { timeoutMs: LONG_TIMEOUT });
  }

  /**
   * @param {string} title @param {number} status one of REPLAY_COMMANDS
   * @param {{file?: string, startMs?: number, speed?: number}} [options]
   */
  replay(title, status, options) {
    return this.actions.run(title, replayRequest(status, options), { timeoutMs: LONG_TIMEOUT });
  }
}
