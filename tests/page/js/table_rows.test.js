import assert from "node:assert/strict";
import { test } from "node:test";

import { bytesText, durationText, rateText } from "../../../rosbridge_sim/page/js/panels/graph/figures.js";
import { shownRows } from "../../../rosbridge_sim/page/js/widgets/table_rows.js";

const ROWS = [
  { name: "/b", type: "pkg/One", rate: 5 },
  { name: "/a", type: "pkg/Two", rate: 5 },
  { name: "/c", type: "pkg/One", rate: 10 },
];
/** @type {{value: (row: typeof ROWS[0]) => string | number, hint?: (row: typeof ROWS[0]) => string}[]} */
const COLUMNS = [{ value: (row) => row.name, hint: (row) => row.type }, { value: (row) => row.rate }];

/** @param {string} search @param {import("../../../rosbridge_sim/page/js/widgets/table_rows.js").SortOrder} order @param {number} [limit] */
function find(search, order, limit = 100) {
  const { rows, hidden } = shownRows(ROWS, COLUMNS, (row) => row.name, search, order, limit);
  return [rows.map((row) => row.name).join(""), hidden];
}

test("rows are sorted by a column, and equal ones by name", () => {
  assert.deepEqual(find("", { column: 0, isDown: false }), ["/a/b/c", 0]);
  assert.deepEqual(find("", { column: 1, isDown: true }), ["/c/a/b", 0]);
});

test("a search needs all words, in the name, the values or the hints", () => {
  assert.deepEqual(find("ONE", { column: 0, isDown: false }), ["/b/c", 0]);
  assert.deepEqual(find("one /c", { column: 0, isDown: false }), ["/c", 0]);
});

test("rows beyond the limit are counted", () => {
  assert.deepEqual(find("", { column: 0, isDown: false }, 2), ["/a/b", 1]);
});

test("numbers are short texts", () => {
  assert.deepEqual([0, 999, 1500, 2_000_000, 5e12].map(bytesText), ["0 B", "999 B", "1.5 kB", "2.0 MB", "5000 GB"]);
  assert.deepEqual([-1, 0, 1, 49.7].map(rateText), ["–", "0", "1.0", "50"]);
  assert.deepEqual([5, 125, 3725].map(durationText), ["0:05", "2:05", "1:02:05"]);
});
