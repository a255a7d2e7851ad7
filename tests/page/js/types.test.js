import assert from "node:assert/strict";
import { test } from "node:test";

import { choicesOf, parseBaseValue, TypeDefinition } from "../../../rosbridge_sim/page/js/wire/types.js";

const BORDER = "=".repeat(80);

const TEXT = `# A command.
# It holds.

Header header
uint8 GEAR_PARK=1   # stands
uint8 GEAR_DRIVE=4
string NAME=a # b
uint8 gear
uint8 other
float64[3] rates      # of each axis [rad/s]
int32[<=4] few 5
string text "a # b"   # with a mark
bool is_on True
time stamp
pkg/Part[] parts
${BORDER}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
${BORDER}
MSG: pkg/Part
# value of a part [m]
float32 value
pkg/Part[2] inner
`;

test("fields have their types, lengths, comments and units", () => {
  const { root } = new TypeDefinition("pkg/Command", TEXT);
  assert.equal(root.comment, "A command. It holds.");
  const fields = Object.fromEntries(root.fields.map((field) => [field.name, field]));
  assert.equal(fields.header?.type, "std_msgs/Header");
  assert.deepEqual([fields.rates?.isArray, fields.rates?.length, fields.rates?.unit], [true, 3, "rad/s"]);
  assert.deepEqual([fields.few?.length, fields.few?.max], [-1, 4]);
  assert.deepEqual([fields.text?.preset, fields.text?.comment], ['"a # b"', "with a mark"]);
});

test("a comment in the line above belongs to a field", () => {
  const definition = new TypeDefinition("pkg/Command", TEXT);
  assert.equal(definition.types.get("pkg/Part")?.fields[0]?.unit, "m");
});

test("constants with the name of a field are its choices", () => {
  const { root } = new TypeDefinition("pkg/Command", TEXT);
  const [gear, other] = root.fields.filter((field) => field.type === "uint8");
  assert.ok(gear && other);
  assert.deepEqual(choicesOf(root, gear).map(({ name, value }) => `${name}=${value}`), ["GEAR_PARK=1", "GEAR_DRIVE=4"]);
  assert.deepEqual(choicesOf(root, other), []);
});

test("a text constant takes the whole line", () => {
  const { root } = new TypeDefinition("pkg/Command", TEXT);
  assert.equal(root.constants.at(-1)?.value, "a # b");
});

test("defaults fill each field, and a type that contains itself ends", () => {
  const { parts, ...plain } = new TypeDefinition("pkg/Command", TEXT).defaults();
  assert.deepEqual(parts, []);
  assert.deepEqual(plain, {
    header: { seq: 0, stamp: { secs: 0, nsecs: 0 }, frame_id: "" },
    gear: 0,
    other: 0,
    rates: [0, 0, 0],
    few: [],
    text: "a # b",
    is_on: true,
    stamp: { secs: 0, nsecs: 0 },
  });
  const loop = new TypeDefinition("pkg/Loop", "pkg/Loop next");
  assert.ok(JSON.stringify(loop.defaults()).startsWith('{"next":{"next"'));
});

test("a line that is no field is refused by its text", () => {
  assert.throws(() => new TypeDefinition("pkg/Bad", "<img onerror=x>"), /pkg\/Bad: expected a field or a constant; got <img/);
});

test("base values are checked by their type", () => {
  assert.equal(parseBaseValue("int8", " -128 "), -128);
  assert.equal(parseBaseValue("float64", "1e-3"), 0.001);
  assert.equal(parseBaseValue("string", " a "), " a ");
  for (const [type, text] of [["uint8", "256"], ["int32", "1.5"], ["int32", ""], ["float32", "x"], ["float64", "Infinity"], ["uint64", "18446744073709551615"], ["bool", "maybe"]]) {
    assert.throws(() => parseBaseValue(String(type), String(text)), RangeError, `${type} ${text}`);
  }
});
