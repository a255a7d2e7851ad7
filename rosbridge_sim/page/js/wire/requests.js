// The requests that the page makes to the simulator: one function for each kind of action.
//
// Each function returns an operation: the name and the type on the wire, and the values. `Actions` carries it out, and
// `codeFor` writes it as a program.

/**
 * A call of a service, or a message on a topic.
 * @typedef {{kind: "call" | "publish", name: string, type: string, values: Record<string, unknown>}} Operation
 */

/** @typedef {{x: number, y: number, heading: number}} MapPlace in the map's frame [m], heading [rad] from east */
/** @typedef {{accel: number, brake: number, steering: number}} PedalCommand pedals 0 to 1, front wheels [rad] */

/** `longlCmdType` of a command by pedals. */
const BY_PEDALS = 1;
/** Bit of `option` in `EventInfo` for the pause. */
const PAUSE_OPTION = 8;
/** Parts of a scenario that a load from the page takes: all but the network settings, which would move topics. */
const WHOLE_SCENARIO = Object.freeze({
  load_network_connection_data: false,
  delete_all: true,
  load_ego_vehicle_data: true,
  load_surrounding_vehicle_data: true,
  load_pedestrian_data: true,
  load_obstacle_data: true,
});

/** `sim_process_status` of `/Morai_SimProc`. */
export const REPLAY_COMMANDS = Object.freeze({ play: 1, pause: 2, stop: 32 });

/** @param {string} name @param {string} type @param {Record<string, unknown>} [values] @returns {Operation} */
export function callOperation(name, type, values = {}) {
  return { kind: "call", name, type, values };
}

/** @param {string} name @param {string} type @param {Record<string, unknown>} [values] @returns {Operation} */
export function publishOperation(name, type, values = {}) {
  return { kind: "publish", name, type, values };
}

/**
 * The name of a topic or service of an ego: the first ego has the plain name.
 * @param {number} ego number of the ego @param {string} name with a leading slash
 */
export function egoName(ego, name) {
  return ego > 1 ? `/Ego-${ego}${name}` : name;
}

/** @param {boolean} isPaused */
export function pauseRequest(isPaused) {
  const request = { option: PAUSE_OPTION, set_pause: isPaused };
  return callOperation("/Service_MoraiEventCmd", "morai_msgs/MoraiEventCmdSrv", { request });
}

/** @param {string} userId @param {number} timeStep [ms] */
export function startSyncRequest(userId, timeStep) {
  const request = { user_id: userId, start_sync_mode: true, time_step: timeStep };
  return callOperation("/SyncModeCmd", "morai_msgs/MoraiSyncModeCmdSrv", { request });
}

/** @param {string} userId */
export function stopSyncRequest(userId) {
  const request = { user_id: userId, start_sync_mode: false };
  return callOperation("/SyncModeCmd", "morai_msgs/MoraiSyncModeCmdSrv", { request });
}

/**
 * @param {string} userId of the master @param {number} steps
 * @param {{ego: number, command: PedalCommand} | null} [driven] the ego that is driven by pedals in all steps
 */
export function stepRequest(userId, steps, driven = null) {
  /** @type {Record<string, unknown>} */
  const values = { user_id: userId, n: steps };
  if (driven) {
    values.commands = [{ ego: driven.ego, commands: [{ longlCmdType: BY_PEDALS, ...driven.command }] }];
  }
  return callOperation("/sim/step", "rosbridge_sim_msgs/Step", values);
}

/** @param {string} id name of the snapshot; empty lets the server choose */
export function snapshotRequest(id) {
  return callOperation("/sim/snapshot", "rosbridge_sim_msgs/Snapshot", { id });
}

/** @param {string} id name of the snapshot @param {string} userId of the master; without meaning in real time */
export function restoreRequest(id, userId) {
  return callOperation("/sim/restore", "rosbridge_sim_msgs/Restore", { user_id: userId, id });
}

/** @param {string[]} [remove] names of snapshots to remove */
export function snapshotsRequest(remove = []) {
  return callOperation("/sim/snapshots", "rosbridge_sim_msgs/Snapshots", { remove });
}

/** @param {number} [seed] a negative one keeps the present seed */
export function resetRequest(seed = -1) {
  return callOperation("/sim/reset", "rosbridge_sim_msgs/Reset", { seed });
}

/** @param {number} factor simulated seconds in a second; 0: as fast as possible; negative: only ask */
export function factorRequest(factor) {
  return callOperation("/sim/real_time_factor", "rosbridge_sim_msgs/RealTimeFactor", { factor });
}

/** @param {string} fileName name of the scenario */
export function loadScenarioRequest(fileName) {
  const request = { file_name: fileName, ...WHOLE_SCENARIO, set_pause: false };
  return callOperation("/Service_MoraiSL", "morai_msgs/MoraiScenarioLoadSrv", { request });
}

/** @param {number} status one of REPLAY_COMMANDS @param {{file?: string, startMs?: number, speed?: number}} [options] */
export function replayRequest(status, { file = "", startMs = -1, speed = 0 } = {}) {
  /** @type {Record<string, unknown>} */
  const request = { sim_process_status: status };
  let option = 0;
  if (file) {
    option += 1;
    request.rosbag_file_name = file;
  }
  if (startMs >= 0) {
    option += 4;
    request.start_time = Math.round(startMs);
  }
  if (speed > 0) {
    option += 8;
    request.replay_speed = speed;
  }
  request.replay_option = option;
  return callOperation("/Morai_SimProc", "morai_msgs/MoraiSimProcSrv", { request });
}

/** @param {number} ego @param {PedalCommand} command */
export function controlMessage(ego, command) {
  const values = { longlCmdType: BY_PEDALS, ...command };
  return publishOperation(egoName(ego, "/ctrl_cmd"), "morai_msgs/CtrlCmd", values);
}

/** The same in synchronous mode, for the next frame. @param {number} ego @param {PedalCommand} command */
export function syncControlRequest(ego, command) {
  const request = { frame: 0, command: { longlCmdType: BY_PEDALS, ...command }, sensor_capture: false };
  return callOperation(egoName(ego, "/SyncModeCtrlCmd"), "morai_msgs/MoraiSyncModeCtrlCmdSrv", { request });
}

/**
 * Pedals that the simulator lifts when this page is lost or silent.
 * @param {number} ego @param {number} seconds simulated; 0 ends the lease
 */
export function leaseRequest(ego, seconds) {
  return callOperation("/sim/control_lease", "rosbridge_sim_msgs/ControlLease", { unique_id: ego, seconds });
}

/**
 * A change of one object or ego.
 * @param {number} id @param {Record<string, unknown>} change fields of ObjectState, with their `set_` flags
 */
export function setRequest(id, change) {
  return callOperation("/sim/set", "rosbridge_sim_msgs/Set", { objects: [{ unique_id: id, ...change }] });
}

/** @param {number} ego @param {number} gear 1 P, 2 R, 3 N, 4 D */
export function gearRequest(ego, gear) {
  return setRequest(ego, { set_gear: true, gear });
}

/** @param {number} ego @param {number} mode 1 keyboard, 2 game pad, 3 external, 6 the ego drives itself */
export function controlModeRequest(ego, mode) {
  return setRequest(ego, { set_ctrl_mode: true, ctrl_mode: mode });
}

/** @param {number} ego @param {number} turnSignal 0 none, 1 left, 2 right @param {number} emergencySignal 0 off, 1 on */
export function lampsRequest(ego, turnSignal, emergencySignal) {
  const change = { set_lamps: true, turn_signal: turnSignal, emergency_signal: emergencySignal };
  return setRequest(ego, change);
}

/** A place as the wire has it. @param {MapPlace & {z?: number}} place */
export function wirePlace({ x, y, z = 0, heading }) {
  const degrees = (heading * 180) / Math.PI;
  return { x: roundedTo(x, 3), y: roundedTo(y, 3), z: roundedTo(z, 3), heading_deg: roundedTo(degrees, 2) };
}

/** @param {number} id @param {MapPlace & {z?: number}} place */
export function moveRequest(id, place) {
  return setRequest(id, { set_place: true, place: wirePlace(place) });
}

/**
 * @param {string} model name in the catalogue @param {MapPlace & {z?: number}} place
 * @param {{behaviour?: string, speed?: number, desiredSpeed?: number, startWithin?: number, isEgo?: boolean}} [options] speeds
 * [m/s], start within [m]
 */
export function spawnRequest(model, place, options = {}) {
  const { behaviour = "", speed = 0, desiredSpeed = 0, startWithin = 0, isEgo = false } = options;
  const object = {
    model,
    is_ego: isEgo,
    place: wirePlace(place),
    speed,
    behaviour,
    desired_speed: desiredSpeed,
    start_within: startWithin,
  };
  return callOperation("/sim/spawn", "rosbridge_sim_msgs/Spawn", { objects: [object] });
}

/** @param {number[]} ids */
export function removeRequest(ids) {
  return callOperation("/sim/remove", "rosbridge_sim_msgs/Remove", { unique_ids: ids });
}

/**
 * @param {string} light name of the light in the map
 * @param {number} status sum of 1 red, 4 yellow, 16 green, 32 left; -1 gives it back to its schedule
 */
export function lightMessage(light, status) {
  const values = { trafficLightIndex: light, trafficLightStatus: status };
  return publishOperation("/SetTrafficLight", "morai_msgs/SetTrafficLight", values);
}

/** @param {boolean} isReset whether all counts begin anew */
export function scoreRequest(isReset) {
  return callOperation("/sim/score", "rosbridge_sim_msgs/Score", { reset: isReset });
}

/** A number without the digits that nobody reads. @param {number} value @param {number} digits */
function roundedTo(value, digits) {
  return Number(value.toFixed(digits)) || 0;
}
