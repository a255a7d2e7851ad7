// Prints, as JSON, each kind of request of the page as programs for a server: title, operation and the three programs.

import { TEXTS } from "../../rosbridge_sim/page/js/texts.js";
import { codeFor } from "../../rosbridge_sim/page/js/wire/code.js";
import * as requests from "../../rosbridge_sim/page/js/wire/requests.js";

/** Arguments for each function of the page's requests. A new function needs a row. */
const SAMPLES = {
  pauseRequest: [true],
  startSyncRequest: ["page-test", 40],
  stopSyncRequest: ["page-test"],
  stepRequest: ["page-test", 3, { ego: 0, command: { accel: 0.5, brake: 0, steering: 0.1 } }],
  snapshotRequest: ["it's a \"test\""],
  restoreRequest: ["kept", "page-test"],
  snapshotsRequest: [["kept"]],
  resetRequest: [7],
  factorRequest: [2],
  loadScenarioRequest: ["town"],
  replayRequest: [requests.REPLAY_COMMANDS.pause],
  controlMessage: [0, { accel: 0.5, brake: 0, steering: 0.1 }],
  syncControlRequest: [0, { accel: 0.5, brake: 0, steering: 0.1 }],
  leaseRequest: [0, 0.5],
  setRequest: [0, { set_speed: true, speed: 3 }],
  gearRequest: [0, 2],
  controlModeRequest: [0, 6],
  lampsRequest: [0, 1, 0],
  moveRequest: [0, { x: -20, y: 5, heading: 1 }],
  spawnRequest: ["Hyundai_Ioniq_5", { x: 5, y: 5, heading: Math.PI / 2 }, { behaviour: "stand" }],
  removeRequest: [[1]],
  lightMessage: ["TL10E", 16],
  scoreRequest: [true],
};

const HELPERS = new Set(["callOperation", "publishOperation", "egoName", "wirePlace", "REPLAY_COMMANDS"]);
const names = Object.keys(requests).filter((name) => !HELPERS.has(name));
const missing = names.filter((name) => !Object.hasOwn(SAMPLES, name));
if (missing.length) {
  throw new Error(`expected a sample for ${missing.join(", ")}`);
}
const options = { address: process.argv[2], hasToken: process.argv[3] === "token", texts: TEXTS.code };
const rows = names.map((name) => {
  const operation = requests[name](...SAMPLES[name]);
  return { name, operation, ...codeFor(operation, options) };
});
console.log(JSON.stringify(rows));
