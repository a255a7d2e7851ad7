// The texts in Korean say what the English ones say: the same keys, lists, functions and values in them.

import assert from "node:assert/strict";
import { test } from "node:test";

import { TEXTS } from "../../../rosbridge_sim/page/js/texts.js";
import { KOREAN } from "../../../rosbridge_sim/page/js/texts_ko.js";

const HANGUL = /[\uac00-\ud7a3]/;
/** Words of the field that Korean texts keep. */
const KEPT = /^(?:Ego( \d+)?|ego|Id|Hz|km\/h|roslibpy|roslib\.js|status|rosbridge-sim|Esc|O {2}Shift\+O|[^a-z]*)$/;
const SAMPLES = [
  ["«a»", "«b»", "«c»", "«d»"],
  [7123, 7456, 7789, 7999],
  [1, 1, 1, 1],
  [0, 0, 0, 0],
  [7123, -1, 7789, 7999],
  ["", "", "", ""],
  [true, true],
  [false, false],
  ["«a»", true],
];

/** @typedef {Record<string, unknown> | unknown[]} Table */

/** @param {unknown} text @param {unknown[]} sample @returns {string} what it makes of values; empty if it takes others */
function textOf(text, sample) {
  try {
    return String(/** @type {(...values: unknown[]) => unknown} */ (text)(...sample));
  } catch {
    return "";
  }
}

/** @param {string} text @returns {string[]} the marked values in a text that a function made, in any order */
function valuesIn(text) {
  return (text.match(/«[abcd]»|7\d{3}|7\.\d/g) ?? []).sort();
}

/** @param {unknown} english @param {unknown} korean @param {string} path @param {(path: string, english: unknown, korean: unknown) => void} check */
function walk(english, korean, path, check) {
  assert.equal(typeof korean, typeof english, path);
  if (typeof english === "object" && english !== null) {
    const [one, other] = [/** @type {Table} */ (english), /** @type {Table} */ (korean)];
    assert.deepEqual(Object.keys(other).sort(), Object.keys(one).sort(), path);
    for (const [key, value] of Object.entries(one)) {
      walk(value, Object.entries(other).find(([name]) => name === key)?.[1], `${path}.${key}`, check);
    }
    return;
  }
  check(path, english, korean);
}

test("both languages have the same keys, and functions put the same values into their texts", () => {
  let count = 0;
  walk(TEXTS, KOREAN, "TEXTS", (path, english, korean) => {
    count += 1;
    if (typeof english === "function") {
      for (const sample of SAMPLES.filter((each) => textOf(english, each) !== "")) {
        assert.deepEqual(valuesIn(textOf(korean, sample)), valuesIn(textOf(english, sample)), `${path}(${sample.join(", ")})`);
      }
    }
  });
  assert.ok(count > 400, `${count} texts`);
});

test("each text is in Korean, but for terms and units", () => {
  walk(TEXTS, KOREAN, "TEXTS", (path, english, korean) => {
    if (typeof english === "string" && !KEPT.test(english)) {
      assert.match(String(korean), HANGUL, path);
    }
    for (const sample of typeof english === "function" ? SAMPLES.slice(0, 3) : []) {
      const words = textOf(english, sample).replace(/«.»|\b(?:m|ms|kB|km\/h|Ego|x|y|s|actionlib)\b/g, "");
      assert.ok(!/[a-z]{2}/.test(words) || HANGUL.test(textOf(korean, sample)), path);
    }
  });
});
