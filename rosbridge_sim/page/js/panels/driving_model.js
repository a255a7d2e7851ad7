// From keys, a game pad or touch pads to pedals and a wheel angle. It has no clock and no document of its own.

/** @typedef {import("../wire/requests.js").PedalCommand} PedalCommand */

/**
 * The wish of the driver.
 * @typedef {{throttle: number, brake: number, steer: number, isAnalog: boolean}} DriverInput
 *   pedals 0 to 1; steer -1 (right) to 1 (left); isAnalog: sticks and pads, which are smooth by themselves
 */

/** The input of a driver that has let go of everything. @type {Readonly<DriverInput>} */
export const NO_INPUT = Object.freeze({ throttle: 0, brake: 0, steer: 0, isAnalog: false });
/** A key reaches the full throttle in 0.8 s: a car starts without a jerk, and a tap is a little gas [1/s]. */
const THROTTLE_RATE = 1.25;
/** A key reaches the full brake in 0.4 s, as a foot does [1/s]. */
const BRAKE_RATE = 2.5;
/** Front wheels turn so fast by a key: from lock to lock in about 2 s [rad/s]. */
const STEER_RATE = 0.6;
/** Front wheels return so fast when no key is held; the caster of a real car helps, too [rad/s]. */
const RETURN_RATE = 1.2;
/** Sideways acceleration at most by a key, near the limit of comfort of a sporty driver [m/s^2]. */
const SIDEWAYS_LIMIT = 4;
/** Wheelbase of a middle-sized car, for the radius of a bend [m]. */
const WHEELBASE = 2.8;
/** Steering limit of a car whose own is not known [rad]. */
export const USUAL_STEER_LIMIT = 0.6;
/** Below this share a stick is at rest: worn sticks do not return to exactly 0. */
const DEAD_ZONE = 0.08;
/** Name of the control by `KeyboardEvent.code`, so that the keys keep their places on every layout. */
const KEY_CONTROLS = Object.freeze(
  /** @type {Record<string, "throttle" | "brake" | "left" | "right">} */ ({
    ArrowUp: "throttle",
    KeyW: "throttle",
    ArrowDown: "brake",
    KeyS: "brake",
    Space: "brake",
    ArrowLeft: "left",
    KeyA: "left",
    ArrowRight: "right",
    KeyD: "right",
  }),
);

/** @param {string} code of a key; whether it drives */
export function isDrivingKey(code) {
  return Object.hasOwn(KEY_CONTROLS, code);
}

/** The wish behind the keys that are down. @param {Iterable<string>} codes @returns {DriverInput} */
export function inputOfKeys(codes) {
  const held = new Set(Array.from(codes, (code) => (isDrivingKey(code) ? KEY_CONTROLS[code] : null)));
  const brake = held.has("brake") ? 1 : 0;
  return {
    throttle: held.has("throttle") && !brake ? 1 : 0, // both feet down is a brake
    brake,
    steer: (held.has("left") ? 1 : 0) - (held.has("right") ? 1 : 0),
    isAnalog: false,
  };
}

/**
 * The wish behind a game pad of the standard layout: right trigger throttle, left trigger brake, left stick steers.
 * @param {{axes: readonly number[], buttons: readonly {value: number}[]}} pad @returns {DriverInput}
 */
export function inputOfGamepad({ axes, buttons }) {
  const stick = axes[0] ?? 0;
  const cross = (buttons[14]?.value ?? 0) - (buttons[15]?.value ?? 0);
  const steer = cross || 0 - withoutDeadZone(stick);
  return {
    throttle: withoutDeadZone(buttons[7]?.value ?? 0),
    brake: withoutDeadZone(buttons[6]?.value ?? 0),
    steer: clampInput(steer, -1, 1),
    isAnalog: true,
  };
}

/**
 * The wish behind two touch pads: the left one steers, the right one is throttle (up) and brake (down).
 * @param {{steer: number, pedal: number}} pads each -1 to 1; steer is positive to the left, pedal upwards @returns {DriverInput}
 */
export function inputOfPads({ steer, pedal }) {
  return {
    throttle: withoutDeadZone(Math.max(0, pedal)),
    brake: withoutDeadZone(Math.max(0, -pedal)),
    steer: withoutDeadZone(clampInput(steer, -1, 1)),
    isAnalog: true,
  };
}

/** The strongest wish of several inputs. @param {DriverInput[]} inputs @returns {DriverInput} */
export function mergeInputs(inputs) {
  const steering = inputs.reduce((most, input) => (Math.abs(input.steer) > Math.abs(most.steer) ? input : most), NO_INPUT);
  return {
    throttle: Math.max(0, ...inputs.map((input) => input.throttle)),
    brake: Math.max(0, ...inputs.map((input) => input.brake)),
    steer: steering.steer,
    isAnalog: inputs.some((input) => input.isAnalog && isHeld(input)),
  };
}

/** @param {DriverInput} input whether a pedal or the wheel is held */
export function isHeld({ throttle, brake, steer }) {
  return throttle > 0 || brake > 0 || steer !== 0;
}

/**
 * The largest wheel angle at a speed: the bend then needs no more than SIDEWAYS_LIMIT.
 * @param {number} speed [m/s] @param {number} steerLimit of the car [rad]
 */
export function steerLimitAt(speed, steerLimit) {
  const squared = speed * speed;
  return squared < 1 ? steerLimit : Math.min(steerLimit, Math.atan((WHEELBASE * SIDEWAYS_LIMIT) / squared));
}

/** Pedals and wheel angle that follow the wish of the driver smoothly. */
export class PedalControls {
  constructor() {
    this.accel = 0;
    this.brake = 0;
    this.steering = 0; // [rad]
  }

  /**
   * Follow the wish for a while.
   * @param {DriverInput} input @param {number} seconds since the last call
   * @param {{speed: number, steerLimit: number}} car speed [m/s], steering limit [rad] @returns {PedalCommand}
   */
  update(input, seconds, { speed, steerLimit }) {
    const target = clampInput(input.steer, -1, 1) * steerLimitAt(Math.abs(speed), steerLimit);
    if (input.isAnalog) {
      this.accel = input.brake > 0 ? 0 : input.throttle;
      this.brake = input.brake;
      this.steering = movedToward(this.steering, target, 2 * RETURN_RATE * seconds);
    } else {
      // A pedal that is let go is up at once.
      this.accel = input.throttle > this.accel ? movedToward(this.accel, input.throttle, THROTTLE_RATE * seconds) : input.throttle;
      this.brake = input.brake > this.brake ? movedToward(this.brake, input.brake, BRAKE_RATE * seconds) : input.brake;
      const isReturning = Math.abs(target) < Math.abs(this.steering) || target * this.steering < 0;
      this.steering = movedToward(this.steering, target, (isReturning ? RETURN_RATE : STEER_RATE) * seconds);
    }
    return this.command();
  }

  /** Lift the pedals and straighten the wheels at once. */
  release() {
    this.accel = this.brake = this.steering = 0;
    return this.command();
  }

  /** True if pedals and wheels are at rest. */
  get isAtRest() {
    return this.accel === 0 && this.brake === 0 && this.steering === 0;
  }

  /** @returns {PedalCommand} */
  command() {
    return { accel: shortNumber(this.accel), brake: shortNumber(this.brake), steering: shortNumber(this.steering) };
  }
}

/** @param {number} value */
function withoutDeadZone(value) {
  const size = Math.abs(value);
  return size < DEAD_ZONE ? 0 : (Math.sign(value) * (Math.min(1, size) - DEAD_ZONE)) / (1 - DEAD_ZONE);
}

/** @param {number} value @param {number} least @param {number} most */
function clampInput(value, least, most) {
  return Math.min(most, Math.max(least, value));
}

/** @param {number} value @param {number} target @param {number} most change */
function movedToward(value, target, most) {
  return Math.abs(target - value) <= most ? target : value + Math.sign(target - value) * most;
}

/** @param {number} value with four digits, which is finer than any actuator */
function shortNumber(value) {
  return Math.round(value * 1e4) / 1e4 || 0;
}
