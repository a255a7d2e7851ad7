// A drive by the user: from its begin to its end it sends the pedals, and lifts them when the user cannot hold them.

import { controlMessage, syncControlRequest } from "../wire/requests.js";
import { isHeld, mergeInputs, PedalControls } from "./driving_model.js";

/** @typedef {import("./driving_model.js").DriverInput} DriverInput */
/** @typedef {import("../wire/requests.js").Operation} Operation */
/** @typedef {import("../wire/requests.js").PedalCommand} PedalCommand */

/** Time between two commands [ms]: 30 a second, as smooth as a hand needs, and each frame or two has a new one. */
export const COMMAND_INTERVAL = 33;
/** A longer time between two updates is not simulated: the page slept [s]. */
const LONGEST_UPDATE = 0.1;
/** With the pedals up and the wheels straight, the last command is sent so often again before silence. */
const LAST_COMMANDS = 3;

/**
 * Interface of a drive to the page; tests have their own.
 * @typedef {{
 *   send: (operation: Operation) => void,
 *   callInSteps: (operation: Operation) => void,
 *   now: () => number,
 *   car: () => {ego: number, speed: number, steerLimit: number},
 *   isInSteps: () => boolean,
 * }} DrivingPort
 *   callInSteps: for commands while isInSteps; now: [ms]; isInSteps: ticks of this page move the world, so the command goes with the step
 */

export class DrivingSession {
  /** @param {DrivingPort} port */
  constructor(port) {
    this.port = port;
    this.controls = new PedalControls();
    this.isOn = false;
    /** Inputs by their source: keys, game pad, touch pads. @type {Map<string, DriverInput>} */
    this.inputs = new Map();
    this.lastUpdate = 0;
    this.numLast = 0;
  }

  begin() {
    this.isOn = true;
    this.lastUpdate = this.port.now();
    this.numLast = 0;
  }

  /** Lift the pedals and end the drive. */
  end() {
    if (this.isOn) {
      this.lift();
      this.isOn = false;
    }
  }

  /**
   * Let go of everything at once, and say so to the simulator; in steps, too, because the next step may come after the
   * end of the drive, or from another client. The drive goes on with the next key.
   */
  lift() {
    this.inputs.clear();
    const wasAtRest = this.controls.isAtRest && this.numLast === 0;
    const command = this.controls.release();
    this.numLast = 0;
    if (this.isOn && !wasAtRest) {
      const { ego } = this.port.car();
      if (this.port.isInSteps()) {
        this.port.callInSteps(syncControlRequest(ego, command));
      } else {
        this.port.send(controlMessage(ego, command));
      }
    }
  }

  /** The wish of the driver by all sources together. @returns {DriverInput} */
  get input() {
    return mergeInputs([...this.inputs.values()]);
  }

  /** @param {string} source such as "keys" @param {DriverInput} input */
  setInput(source, input) {
    if (isHeld(input)) {
      this.inputs.set(source, input);
    } else {
      this.inputs.delete(source);
    }
  }

  /** Follow the inputs up to now, and send the pedals if they are not at rest. To be called each COMMAND_INTERVAL. */
  update() {
    const now = this.port.now();
    const seconds = Math.min(LONGEST_UPDATE, Math.max(0, (now - this.lastUpdate) / 1000));
    this.lastUpdate = now;
    if (!this.isOn || this.port.isInSteps()) {
      return;
    }
    const { ego, speed, steerLimit } = this.port.car();
    const command = this.controls.update(this.input, seconds, { speed, steerLimit });
    if (!this.controls.isAtRest || isHeld(this.input)) {
      this.numLast = LAST_COMMANDS;
    } else if (this.numLast > 0) {
      this.numLast -= 1;
    } else {
      return;
    }
    this.port.send(controlMessage(ego, command));
  }

  /**
   * The command for a step of this page as the master of synchronous mode.
   * @param {number} seconds length of the step, simulated
   * @returns {{ego: number, command: PedalCommand} | null} null without a drive
   */
  commandForStep(seconds) {
    if (!this.isOn) {
      return null;
    }
    const { ego, speed, steerLimit } = this.port.car();
    const command = this.controls.update(this.input, seconds, { speed, steerLimit });
    // A step has left the pedals pressed: they are lifted by a message, should the next command not come with a step.
    this.numLast = this.controls.isAtRest ? 0 : LAST_COMMANDS;
    return { ego, command };
  }
}
