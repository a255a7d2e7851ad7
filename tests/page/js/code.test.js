import assert from "node:assert/strict";
import { test } from "node:test";

import { codeFor } from "../../../rosbridge_sim/page/js/wire/code.js";
import { callOperation, publishOperation, startSyncRequest, stepRequest } from "../../../rosbridge_sim/page/js/wire/requests.js";

const TEXTS = { syncEnds: "the mode ends", syncShell: "the mode ends here" };
const HERE = { address: "ws://127.0.0.1:9090/", hasToken: false, texts: TEXTS };

test("a call is the same in the three languages", () => {
  const { python, javascript, shell } = codeFor(stepRequest("page-1", 5), HERE);
  assert.match(python, /roslibpy\.Service\(ros, "\/sim\/step", "rosbridge_sim_msgs\/Step"\)/u);
  assert.match(python, /service\.call\(\{"user_id": "page-1", "n": 5\}\)/u);
  assert.match(javascript, /const request = \{ user_id: "page-1", n: 5 \};/u);
  assert.equal(shell, `rosbridge-sim service call /sim/step '{"user_id":"page-1","n":5}'\n`);
});

test("values are written as each language has them", () => {
  const plain = codeFor(publishOperation("/t", "a/B", { on: true, off: false, none: null }), HERE);
  assert.match(plain.python, /\{"on": True, "off": False, "none": None\}/u);
  assert.match(plain.javascript, /\{ on: true, off: false, none: null \}/u);
  const numbers = codeFor(publishOperation("/t", "a/B", { list: new Uint8Array([1, 2]), nan: NaN, big: 2n ** 60n }), HERE);
  assert.match(numbers.python, /\{"list": \[1, 2\], "nan": None, "big": 1152921504606846976\}/u);
  assert.match(numbers.javascript, /\{ list: \[1, 2\], nan: null, big: 1152921504606846976 \}/u);
  assert.match(numbers.shell, /"list":\[1,2\],"nan":null/u);
});

test("a name from the wire cannot leave its quotes", () => {
  const evil = `"); import os; os.system('x') #'; $(reboot) \`reboot\``;
  const { python, javascript, shell } = codeFor(callOperation(evil, evil, { [evil]: evil, __proto__x: 1 }), HERE);
  assert.ok(python.includes(JSON.stringify(evil)));
  assert.ok(javascript.includes(JSON.stringify(evil)));
  const words = shell.trim().split("'\\''").join("");
  assert.equal((words.match(/'/gu) ?? []).length % 2, 0, "each quote is closed");
});

test("the key __proto__ sets no prototype", () => {
  const values = JSON.parse('{"__proto__": {"a": 1}}');
  const { javascript } = codeFor(callOperation("/s", "a/B", values), HERE);
  assert.match(javascript, /\["__proto__"\]: \{ a: 1 \}/u);
});

test("a name with a leading dash is no option of the shell", () => {
  assert.equal(codeFor(callOperation("--help", "a/B"), HERE).shell, "rosbridge-sim service call -- '--help'\n");
});

test("another server and its token are in the programs, and the token itself is not", () => {
  const options = { address: "wss://sim.example/lab/", hasToken: true, texts: TEXTS };
  const { python, javascript, shell } = codeFor(callOperation("/s", "a/B"), options);
  assert.match(python, /roslibpy\.Ros\("wss:\/\/sim\.example\/lab", headers=\{"Authorization": "Bearer " \+ os\.environ/u);
  assert.match(javascript, /"wss:\/\/sim\.example\/lab" \+ "\/\?token=" \+ encodeURIComponent\(process\.env/u);
  assert.equal(shell, "rosbridge-sim service call --url wss://sim.example/lab /s\n");
});

test("a program that takes synchronous mode says that the mode ends with it", () => {
  const { python, javascript, shell } = codeFor(startSyncRequest("page-1", 40), HERE);
  assert.match(python, /# the mode ends/u);
  assert.match(javascript, /\/\/ the mode ends/u);
  assert.equal(shell, "# the mode ends here\nrosbridge-sim step --start --step 40 -n 1\n");
});

test("long values are broken into lines", () => {
  const values = { objects: Array.from({ length: 9 }, (_, index) => ({ unique_id: index, behaviour: "stand" })) };
  const { python } = codeFor(callOperation("/sim/set", "rosbridge_sim_msgs/Set", values), HERE);
  assert.ok(python.split("\n").every((line) => line.length < 100), python);
});
