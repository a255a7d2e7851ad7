// The values of an ego for the instruments, in SI units, from messages of either release.

/**
 * @typedef {{
 *   time: number, speed: number, acceleration: number, accel: number, brake: number, steering: number,
 *   x: number, y: number, z: number, heading: number,
 * }} EgoValues
 *   time of the stamp [s], speed [m/s], pedals 0 to 1, front wheels [rad], heading [rad] from east; NaN where it is not known
 */

/**
 * @param {any} message `morai_msgs/EgoVehicleStatus` of 22.R2 or 26.R1
 * @param {"rad" | "deg"} [wheelUnit] of `wheel_angle`, which is in degrees with `--profile field` @returns {EgoValues}
 */
export function egoValues(message, wheelUnit = "rad") {
  const { header, velocity, acceleration, position } = message;
  const degrees = message.front_steer_angle ?? (wheelUnit === "deg" ? message.wheel_angle : null);
  return {
    time: stampSeconds(header?.stamp),
    speed: velocity.x,
    acceleration: acceleration.x,
    accel: message.accel,
    brake: message.brake,
    steering: degrees === null ? message.wheel_angle : (degrees * Math.PI) / 180,
    x: position.x,
    y: position.y,
    z: position.z,
    heading: (message.heading * Math.PI) / 180,
  };
}

/**
 * Values of an ego whose own topic has sent nothing yet, as in synchronous mode before the first tick.
 * @param {import("../scene/store.js").SceneEgo} ego of the scene's state @returns {EgoValues}
 */
export function sceneValues({ x, y, z, heading, speed }) {
  return { time: NaN, speed, acceleration: NaN, accel: NaN, brake: NaN, steering: NaN, x, y, z, heading };
}

/**
 * Seconds of a stamp of ROS 1 or ROS 2.
 * @param {{secs?: number, nsecs?: number, sec?: number, nanosec?: number} | undefined} stamp
 */
export function stampSeconds(stamp) {
  return Number(stamp?.secs ?? stamp?.sec ?? 0) + Number(stamp?.nsecs ?? stamp?.nanosec ?? 0) * 1e-9;
}

/** Bits of `lamps` in the state of the scene. */
export const LAMP_BITS = Object.freeze({ left: 1, right: 2, brake: 4, reverse: 8 });
/** Letters of the gears, by their numbers on the wire. */
export const GEAR_LETTERS = Object.freeze(/** @type {Record<number, string>} */ ({ 1: "P", 2: "R", 3: "N", 4: "D" }));
