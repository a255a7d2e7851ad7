import assert from "node:assert/strict";
import { test } from "node:test";

import { CborError, decodeCbor } from "../../../rosbridge_sim/page/js/wire/cbor.js";

/** @param {string} hex */
const decode = (hex) => decodeCbor(new Uint8Array(Buffer.from(hex, "hex")));

test("examples of RFC 8949 are decoded", () => {
  const examples = [
    ["00", 0], ["17", 23], ["1818", 24], ["1903e8", 1000], ["1b000000e8d4a51000", 1000000000000], ["20", -1],
    ["3903e7", -1000], ["f97bff", 65504], ["f90001", 5.960464477539063e-8], ["f9c400", -4], ["fa47c35000", 100000],
    ["fb3ff199999999999a", 1.1], ["f97c00", Infinity], ["f97e00", NaN], ["f4", false], ["f5", true], ["f6", null],
    ["60", ""], ["62c3bc", "ü"], ["80", []], ["83010203", [1, 2, 3]], ["a0", {}],
    ["a26161016162820203", { a: 1, b: [2, 3] }], ["9f018202039f0405ffff", [1, [2, 3], [4, 5]]],
    ["7f657374726561646d696e67ff", "streaming"], ["bf6346756ef563416d7421ff", { Fun: true, Amt: -2 }],
  ]; // prettier-ignore
  for (const [hex, value] of examples) {
    assert.deepEqual(decode(String(hex)), value, String(hex));
  }
});

test("integers beyond 53 bits keep their value", () => {
  assert.equal(decode("1bffffffffffffffff"), 18446744073709551615n);
  assert.equal(decode("3bffffffffffffffff"), -18446744073709551616n);
  assert.equal(decode("1b001fffffffffffff"), Number.MAX_SAFE_INTEGER);
  assert.equal(decode("3b001ffffffffffffe"), -Number.MAX_SAFE_INTEGER);
  assert.equal(decode("3b001fffffffffffff"), -9007199254740992n);
});

test("byte strings and typed arrays of both byte orders are decoded", () => {
  assert.deepEqual(decode("43010203"), new Uint8Array([1, 2, 3]));
  assert.deepEqual(decode("5f42010241 03ff".replaceAll(" ", "")), new Uint8Array([1, 2, 3]));
  assert.deepEqual(decode("d8564800000000 0000f03f".replaceAll(" ", "")), new Float64Array([1]));
  assert.deepEqual(decode("d852483ff0000000000000"), new Float64Array([1]));
  assert.deepEqual(decode("d855440000803f"), new Float32Array([1]));
  assert.deepEqual(decode("d8464401000000"), new Uint32Array([1]));
  assert.deepEqual(decode("d84f48ffffffffffffffff"), new BigInt64Array([-1n]));
  assert.deepEqual(decode("d85640"), new Float64Array(0));
});

test("a map with the key __proto__ has no other prototype", () => {
  const map = decode("a1695f5f70726f746f5f5f01");
  assert.equal(Object.getPrototypeOf(map), Object.prototype);
  assert.deepEqual(Object.keys(map), ["__proto__"]);
});

test("frames that are not CBOR are refused with a reason", () => {
  const bad = ["", "18", "6261", "1c", "ff", "8201", "81ff", "a101", "a10101", "bf6161ff", "0000", "c001", "d8564101",
    "62c328", "f8", "e0", "5f6161ff", "5f5f41ffffff", "9b0000000100000000", "7bffffffffffffffff", "9f"]; // prettier-ignore
  for (const hex of bad) {
    assert.throws(() => decode(hex), CborError, hex);
  }
  assert.throws(() => decode("81".repeat(200) + "00"), /100 levels/);
});
