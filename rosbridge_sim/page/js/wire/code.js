// An operation of the page as a program: with roslibpy, with roslib.js, and with the command line.

/** @typedef {import("./requests.js").Operation} Operation */

/** The comments in the programs. @typedef {{syncEnds: string, syncShell: string}} CodeTexts */

/** @typedef {{python: string, javascript: string, shell: string}} Programs */

/** The address that `rosbridge-sim` uses without `--url`. */
const DEFAULT_ADDRESS = "ws://127.0.0.1:9090";
/** Longest list or object on one line [characters]. */
const LINE_LENGTH = 76;
/** A name that a JavaScript program writes without quotes. */
const JAVASCRIPT_NAME = /^[A-Za-z_$][\w$]*$/u;
/** A word that a shell takes as it is. */
const PLAIN_WORD = /^[\w/.:][\w/.:-]*$/u;

/**
 * Notation of values in a programming language.
 * @typedef {{yes: string, no: string, nothing: string, unit: string, key: (name: string) => string}} Notation
 */

/** @type {Notation} */
const PYTHON_NOTATION = { yes: "True", no: "False", nothing: "None", unit: "    ", key: (name) => JSON.stringify(name) };
/** @type {Notation} */
const JAVASCRIPT_NOTATION = { yes: "true", no: "false", nothing: "null", unit: "  ", key: javascriptKey };

/**
 * The operation as a program in each of the languages.
 * @param {Operation} operation
 * @param {{address: string, hasToken: boolean, texts: CodeTexts}} options address of the server's socket @returns {Programs}
 */
export function codeFor(operation, { address, hasToken, texts }) {
  const url = address.replace(/\/$/u, "");
  return {
    python: pythonFor(operation, url, hasToken, texts),
    javascript: javascriptFor(operation, url, hasToken, texts),
    shell: shellFor(operation, url, texts),
  };
}

/**
 * A first program in Python: it drives the ego for five seconds, and prints its speed.
 * @param {{address: string, hasToken: boolean, isInSteps: boolean}} options address of the server's socket; isInSteps: the
 *   world stands until a master steps it
 */
export function firstProgram({ address, hasToken, isInSteps }) {
  return pythonProgram(address.replace(/\/$/u, ""), hasToken, !isInSteps, isInSteps ? FIRST_STEPS : FIRST_DRIVE);
}

const FIRST_DRIVE = `ego = roslibpy.Topic(ros, "/Ego_topic", "morai_msgs/EgoVehicleStatus", throttle_rate=500)
ego.subscribe(lambda car: print(f"{car['velocity']['x'] * 3.6:.1f} km/h"))
drive = roslibpy.Topic(ros, "/ctrl_cmd", "morai_msgs/CtrlCmd")
for _ in range(250):
    drive.publish({"longlCmdType": 2, "velocity": 30.0, "steering": 0.0})  # km/h, rad
    time.sleep(0.02)
drive.publish({"longlCmdType": 1, "brake": 1.0})
time.sleep(3)
`;

const FIRST_STEPS = `

def ask(service, **request):
    return roslibpy.Service(ros, service, "").call({"request": request})["response"]


ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
for _ in range(250):
    ask("/SyncModeCtrlCmd", command={"longlCmdType": 2, "velocity": 30.0, "steering": 0.0})  # km/h, rad
    car = ask("/SyncModeWaitForTick", user_id="me")["vehicle_status"]
print(f"{car['velocity']['x'] * 3.6:.1f} km/h")
`;

/** @param {string} url @param {boolean} hasToken - it is in the environment, and never in the program @param {boolean} hasTime @param {string} body */
function pythonProgram(url, hasToken, hasTime, body) {
  const token = hasToken ? ', headers={"Authorization": "Bearer " + os.environ["ROSBRIDGE_SIM_TOKEN"]}' : "";
  const imports = `${hasToken ? "import os\n" : ""}${hasTime ? "import time\n" : ""}`;
  return `${imports}${imports && "\n"}import roslibpy\n\nros = roslibpy.Ros(${JSON.stringify(url)}${token})\nros.run()\n${body}ros.terminate()\n`;
}

/**
 * A value as a language writes it.
 * @param {unknown} value @param {Notation} notation @param {string} [indent] of the line on which it begins @returns {string}
 */
function codeLiteral(value, notation, indent = "") {
  if (value === null || value === undefined) {
    return notation.nothing;
  }
  if (typeof value === "boolean") {
    return value ? notation.yes : notation.no;
  }
  if (typeof value === "bigint") {
    return String(value);
  }
  if (typeof value === "number") {
    return Number.isFinite(value) ? String(value) : notation.nothing;
  }
  if (typeof value !== "object") {
    return JSON.stringify(String(value));
  }
  const isList = Array.isArray(value) || ArrayBuffer.isView(value);
  const deeper = indent + notation.unit;
  const items = isList
    ? Array.from(/** @type {ArrayLike<unknown>} */ (value), (item) => codeLiteral(item, notation, deeper))
    : Object.entries(value).map(([name, item]) => `${notation.key(name)}: ${codeLiteral(item, notation, deeper)}`);
  const [open, close] = isList ? ["[", "]"] : ["{", "}"];
  const line = items.join(", ");
  if (items.length === 0 || (indent.length + line.length < LINE_LENGTH && !line.includes("\n"))) {
    return notation === JAVASCRIPT_NOTATION && !isList && line ? `{ ${line} }` : open + line + close;
  }
  return `${open}\n${items.map((item) => `${deeper}${item},\n`).join("")}${indent}${close}`;
}

/** @param {string} name */
function javascriptKey(name) {
  if (name === "__proto__") {
    return '["__proto__"]'; // the plain key would set the prototype
  }
  return JAVASCRIPT_NAME.test(name) ? name : JSON.stringify(name);
}

/** @param {Operation} operation whether it makes its sender the master */
function isSyncStart({ kind, values }) {
  const request = /** @type {Record<string, unknown> | undefined} */ (values.request);
  return kind === "call" && request?.start_sync_mode === true;
}

/** @param {Operation} operation @param {string} url @param {boolean} hasToken @param {CodeTexts} texts */
function pythonFor(operation, url, hasToken, texts) {
  const { kind, name, type, values } = operation;
  const lines = [];
  const place = `ros, ${JSON.stringify(name)}, ${JSON.stringify(type)}`;
  const body = codeLiteral(values, PYTHON_NOTATION);
  if (kind === "publish") {
    lines.push(`topic = roslibpy.Topic(${place})`, `topic.publish(${body})`, "time.sleep(0.5)");
  } else {
    lines.push(`service = roslibpy.Service(${place})`, `print(service.call(${body}))`);
  }
  if (isSyncStart(operation)) {
    lines.push(`# ${texts.syncEnds}`);
  }
  return pythonProgram(url, hasToken, kind === "publish", `${lines.join("\n")}\n`);
}

/** @param {Operation} operation @param {string} url @param {boolean} hasToken @param {CodeTexts} texts */
function javascriptFor(operation, url, hasToken, texts) {
  const { kind, name, type, values } = operation;
  const quoted = JSON.stringify(url);
  const address = hasToken ? `${quoted} + "/?token=" + encodeURIComponent(process.env.ROSBRIDGE_SIM_TOKEN)` : quoted;
  const lines = ['import * as ROSLIB from "roslib";', "", `const ros = new ROSLIB.Ros({ url: ${address} });`];
  const body = codeLiteral(values, JAVASCRIPT_NOTATION, "  ");
  lines.push('ros.on("connection", () => {');
  if (kind === "publish") {
    lines.push(
      `  const topic = new ROSLIB.Topic({ ros, name: ${JSON.stringify(name)}, messageType: ${JSON.stringify(type)} });`,
      `  topic.publish(${body});`,
      "  setTimeout(() => ros.close(), 500);",
    );
  } else {
    lines.push(
      "  const service = new ROSLIB.Service({",
      `    ros, name: ${JSON.stringify(name)}, serviceType: ${JSON.stringify(type)},`,
      "  });",
      `  const request = ${body};`,
      "  service.callService(request, (answer) => {",
      "    console.log(answer);",
      ...(isSyncStart(operation) ? [`    // ${texts.syncEnds}`] : []),
      "    ros.close();",
      "  }, (error) => {",
      "    console.error(error);",
      "    ros.close();",
      "  });",
    );
  }
  lines.push("});");
  return `${lines.join("\n")}\n`;
}

/** @param {Operation} operation @param {string} url @param {CodeTexts} texts */
function shellFor(operation, url, texts) {
  const { kind, name, type, values } = operation;
  const place = url === DEFAULT_ADDRESS ? [] : ["--url", shellWord(url)];
  const json = JSON.stringify(values, plainValue);
  if (isSyncStart(operation)) {
    const step = /** @type {{time_step: number}} */ (values.request).time_step;
    const command = ["rosbridge-sim", "step", ...place, "--start", "--step", String(step), "-n", "1"];
    return `# ${texts.syncShell}\n${command.join(" ")}\n`;
  }
  const words = kind === "publish"
    ? ["rosbridge-sim topic pub --once", ...place, ...endOfOptions(name, type), shellWord(name), shellWord(type)]
    : ["rosbridge-sim service call", ...place, ...endOfOptions(name), shellWord(name)];
  if (json !== "{}") {
    words.push(shellWord(json));
  }
  return `${words.join(" ")}\n`;
}

/** The mark behind which a word with a leading dash is no option, where there is such a word. @param {string[]} words */
function endOfOptions(...words) {
  return words.some((word) => word.startsWith("-")) ? ["--"] : [];
}

/** @param {string} word */
function shellWord(word) {
  return PLAIN_WORD.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

/**
 * A replacer for JSON: typed arrays become lists, and numbers that JSON lacks become null.
 * @param {string} _name @param {unknown} value
 */
function plainValue(_name, value) {
  if (typeof value === "bigint") {
    return Number(value);
  }
  return ArrayBuffer.isView(value) ? Array.from(/** @type {any} */ (value)) : value;
}
