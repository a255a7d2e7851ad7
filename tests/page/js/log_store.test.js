import assert from "node:assert/strict";
import { test } from "node:test";

import { KEPT_LINES, LogStore, RefusalReader, rosoutLevel } from "../../../rosbridge_sim/page/js/panels/log_store.js";

test("a flood of lines keeps the latest ones, and cuts their texts", () => {
  const store = new LogStore();
  for (let number = 0; number < 20_000; number += 1) {
    store.add("info", "node", `${number} ${"x".repeat(5000)}`, number);
  }
  assert.ok(store.lines.length <= 2 * KEPT_LINES);
  assert.ok(store.lines.every((line) => line.text.length < 1100));
  const found = store.find("debug", "", 10_000);
  assert.equal(found.length, KEPT_LINES);
  assert.equal(found[0]?.number, 20_000);
});

test("equal lines in a row are one line with a count", () => {
  const store = new LogStore();
  store.add("error", "node", "a", 1);
  store.add("error", "node", "a", 2);
  store.add("error", "node", "b", 3);
  assert.deepEqual(store.lines.map((line) => line.count), [2, 1]);
});

test("lines are found by their level and by words in any case", () => {
  const store = new LogStore();
  store.add("debug", "node", "First", 1);
  store.add("error", "Other", "second", 2);
  assert.deepEqual(store.find("info", "", 10).map((line) => line.text), ["second"]);
  assert.deepEqual(store.find("debug", "FIRST node", 10).map((line) => line.text), ["First"]);
  assert.deepEqual(store.find("debug", "first second", 10), []);
});

test("levels of both generations have the same names", () => {
  assert.deepEqual([1, 2, 4, 8, 16].map((level) => rosoutLevel(level, false)), ["debug", "info", "warning", "error", "error"]);
  assert.deepEqual([10, 20, 30, 40, 50].map((level) => rosoutLevel(level, true)), ["debug", "info", "warning", "error", "error"]);
});

test("a list of refusals that comes again adds only what is new", () => {
  const store = new LogStore();
  const reader = new RefusalReader(store);
  const refusal = { stamp: { secs: 1, nsecs: 0 }, client: "a:1", reason: "wrong_type", op: "publish", subject: "/x", text: "no", count: 2 };
  reader.take({ refusals: [refusal] });
  reader.take({ refusals: [refusal] });
  assert.deepEqual(store.lines.map((line) => line.count), [2]);
  reader.take({ refusals: [{ ...refusal, count: 5 }, { ...refusal, subject: "/y", count: 1 }] });
  assert.deepEqual(store.lines.map((line) => [line.text, line.count]), [["publish /x: no (wrong_type)", 5], ["publish /y: no (wrong_type)", 1]]);
});

test("a mistake stands once, whatever tells of it, and in any order", () => {
  const text = "Message type std_msgs/String does not have a field dta";
  const refusal = { stamp: { secs: 100, nsecs: 0 }, client: "a:1", reason: "unknown_field", op: "publish", subject: "/x", text, count: 1 };
  const told = `publish /x: ${text} (unknown_field)`;
  /** @type {((reader: RefusalReader) => void)[]} */
  const ways = [
    (reader) => reader.take({ refusals: [refusal] }),
    (reader) => reader.takeStatus("error", text, 101),
    (reader) => reader.takeLine("warning", "/rosbridge_sim/server", `a:1: refused: ${told}`, 100),
    (reader) => reader.takeLine("warning", "/rosbridge_sim/server", `a:1: 3 more refused (unknown_field), the last one: ${told}`, 100),
  ];
  for (let first = 0; first < ways.length; first += 1) {
    const store = new LogStore();
    const reader = new RefusalReader(store, "status");
    [...ways.slice(first), ...ways.slice(0, first)].forEach((way) => way(reader));
    assert.deepEqual(store.lines.map((line) => [line.source, line.text]), [["a:1", told]], String(first));
  }
});

test("lines that no refusal tells stay in the log", () => {
  const store = new LogStore();
  const reader = new RefusalReader(store, "status");
  reader.takeLine("warning", "/rosbridge_sim/server", "a:1: refused: publish /x: no (wrong_type)", 1);
  assert.equal(store.lines.length, 1, "without /sim/refusals the log line is all there is");
  reader.take({ refusals: [] });
  reader.takeLine("info", "/rosbridge_sim/server", "a:1 connected", 2);
  reader.takeLine("warning", "/mine", "a:1: refused: a coffee", 3);
  reader.takeStatus("error", "topic /x is taken", 4);
  assert.deepEqual(store.lines.map((line) => line.source), ["/rosbridge_sim/server", "/mine", "status"]);
});

test("a long text that the server has cut is the same mistake", () => {
  const store = new LogStore();
  const reader = new RefusalReader(store, "status");
  const text = "a".repeat(200) + "b".repeat(200);
  reader.takeStatus("error", text, 100);
  const cut = `${text.slice(0, 195)} ... ${text.slice(-100)}`;
  reader.take({ refusals: [{ stamp: { secs: 100, nsecs: 0 }, client: "a:1", reason: "refused", op: "", subject: "", text: cut, count: 1 }] });
  assert.deepEqual(store.lines.map((line) => line.source), ["a:1"]);
});
