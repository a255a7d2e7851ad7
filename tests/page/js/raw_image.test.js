import assert from "node:assert/strict";
import { test } from "node:test";

import { bytesOf, imageKindOf, imageTypeOf, rawPixels } from "../../../rosbridge_sim/page/js/panels/graph/raw_image.js";

test("channels come in the order of their encoding, and rows by their step", () => {
  const data = Uint8Array.of(1, 2, 3, 0, 4, 5, 6, 0);
  const image = { width: 1, height: 2, step: 4, data };
  assert.deepEqual([...rawPixels({ ...image, encoding: "rgb8" }).pixels], [1, 2, 3, 255, 4, 5, 6, 255]);
  assert.deepEqual([...rawPixels({ ...image, encoding: "bgr8" }).pixels], [3, 2, 1, 255, 6, 5, 4, 255]);
  assert.deepEqual([...rawPixels({ ...image, encoding: "rgba8" }).pixels], [1, 2, 3, 0, 4, 5, 6, 0]);
});

test("of two bytes the more significant one is shown", () => {
  const image = { width: 1, height: 1, step: 2, encoding: "mono16", data: Uint8Array.of(1, 200) };
  assert.equal(rawPixels({ ...image, is_bigendian: 0 }).pixels[0], 200);
  assert.equal(rawPixels({ ...image, is_bigendian: 1 }).pixels[0], 1);
});

test("of distances the nearer one is brighter, and the sky is black", () => {
  const data = new Uint8Array(new Float32Array([2, 50, Infinity]).buffer);
  const { pixels } = rawPixels({ width: 3, height: 1, step: 12, encoding: "32FC1", data });
  assert.ok(pixels[0] > 200 && pixels[4] < 60 && pixels[4] > 0);
  assert.deepEqual([...pixels.slice(8)], [0, 0, 0, 255]);
});

test("an image that is not what it says is refused", () => {
  const image = { width: 2, height: 2, step: 2, encoding: "mono8", data: Uint8Array.of(1, 2, 3, 4) };
  assert.equal(rawPixels(image).pixels.length, 16);
  for (const change of [{ data: Uint8Array.of(1) }, { width: 1e9, height: 1e9 }, { width: 0 }, { width: NaN }, { encoding: "constructor" }, { step: 1 }, { data: 7 }, { data: "%" }]) {
    assert.throws(() => rawPixels({ ...image, ...change }), RangeError, JSON.stringify(change));
  }
});

test("bytes come from base64, lists and bytes", () => {
  assert.deepEqual([...bytesOf("AQI=")], [1, 2]);
  assert.deepEqual([...bytesOf([1, 2])], [1, 2]);
});

test("kinds of images are told by type, and formats by their first bytes", () => {
  assert.deepEqual(["sensor_msgs/Image", "sensor_msgs/msg/CompressedImage", "std_msgs/Image"].map(imageKindOf), ["raw", "compressed", ""]);
  assert.equal(imageTypeOf(Uint8Array.of(0xff, 0xd8, 0xff, 0)), "image/jpeg");
  assert.equal(imageTypeOf(new TextEncoder().encode("<svg onload=x>")), "");
});
