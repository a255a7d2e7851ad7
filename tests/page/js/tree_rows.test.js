import assert from "node:assert/strict";
import { test } from "node:test";

import { MAX_TREE_ROWS, pathText, treeRows, valueAtPath, valueText } from "../../../rosbridge_sim/page/js/widgets/tree_rows.js";

const ALL_OPEN = () => true;

test("only open nodes have rows for their fields", () => {
  const message = { a: { b: 1 }, c: "x" };
  assert.deepEqual(treeRows(message, () => false).rows.map((row) => row.name), ["a", "c"]);
  assert.deepEqual(treeRows(message, ALL_OPEN).rows.map((row) => row.name), ["a", "b", "c"]);
});

test("the number of rows is bounded for any message", () => {
  const wide = { items: Array.from({ length: 90 }, () => Array.from({ length: 90 }, (_, i) => i)) };
  const { rows, isCut } = treeRows(wide, ALL_OPEN);
  assert.equal(rows.length, MAX_TREE_ROWS);
  assert.ok(isCut);
});

test("a long array comes in groups of at most a hundred, and each item is found by its path", () => {
  const data = new Float64Array(1_000_000).map((_, index) => index);
  const closed = treeRows({ data }, (path) => path === '["data"]').rows;
  assert.equal(closed.length, 101);
  assert.equal(closed[1]?.name, "[0 … 9999]");
  let rows = treeRows({ data }, (path) => path === '["data"]' || path.endsWith('"#990000+10000"]') || path.endsWith('"#999900+100"]')).rows;
  const last = rows.at(-1);
  assert.equal(last?.name, "[999999]");
  assert.equal(valueAtPath({ data }, String(last?.path)), 999999);
  assert.equal(pathText(String(last?.path)), "data[999999]");
  rows = treeRows({ data: new Array(101).fill(0) }, ALL_OPEN).rows;
  assert.ok(rows.every((row) => !row.name.includes("undefined")));
});

test("a path that is no longer there has no value", () => {
  assert.equal(valueAtPath({ a: [1] }, '["a",3]'), undefined);
  assert.equal(valueAtPath({ a: null }, '["a","b"]'), undefined);
  assert.equal(valueAtPath({}, '["constructor"]'), undefined);
});

test("texts and previews are cut", () => {
  assert.ok(valueText("x".repeat(1_000_000)).length < 400);
  assert.ok(valueText(Array.from({ length: 100 }, () => "y".repeat(10_000))).length < 120);
  assert.equal(valueText(5n), "5");
  assert.equal(valueText(-0), "-0");
  assert.equal(valueText(new Uint8Array(3)), "(3) 0, 0, 0");
});

test("a message that is no object has no rows", () => {
  assert.deepEqual(treeRows(null, ALL_OPEN), { rows: [], isCut: false });
});
