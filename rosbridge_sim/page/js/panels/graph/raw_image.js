/** Images on the wire: pixels of `sensor_msgs/Image`, and the format of `sensor_msgs/CompressedImage`. */

/** Pixels of the largest image that is drawn; larger ones would take seconds. */
const MAX_PIXELS = 16_000_000;

/**
 * Channels of an encoding: their number, bytes for each, and the places of red, green, blue and alpha (-1: opaque).
 * @type {Record<string, {channels: number, bytes: number, places: [number, number, number, number]}>}
 */
const IMAGE_ENCODINGS = {
  rgb8: { channels: 3, bytes: 1, places: [0, 1, 2, -1] },
  bgr8: { channels: 3, bytes: 1, places: [2, 1, 0, -1] },
  "8UC3": { channels: 3, bytes: 1, places: [2, 1, 0, -1] },
  rgba8: { channels: 4, bytes: 1, places: [0, 1, 2, 3] },
  bgra8: { channels: 4, bytes: 1, places: [2, 1, 0, 3] },
  mono8: { channels: 1, bytes: 1, places: [0, 0, 0, -1] },
  "8UC1": { channels: 1, bytes: 1, places: [0, 0, 0, -1] },
  mono16: { channels: 1, bytes: 2, places: [0, 0, 0, -1] },
  "16UC1": { channels: 1, bytes: 2, places: [0, 0, 0, -1] },
  "32FC1": { channels: 1, bytes: 4, places: [0, 0, 0, -1] },
};

/** Media type for each format, by the first bytes of a file; a format's name is not always right. @type {[string, number[]][]} */
const IMAGE_SIGNATURES = [
  ["image/png", [0x89, 0x50, 0x4e, 0x47]],
  ["image/jpeg", [0xff, 0xd8, 0xff]],
  ["image/webp", [0x52, 0x49, 0x46, 0x46]],
];

/** Tell whether messages of a type are images. @param {string} type @returns {"" | "raw" | "compressed"} */
export function imageKindOf(type) {
  const match = /^sensor_msgs\/(?:msg\/)?(Image|CompressedImage)$/.exec(type);
  return match === null ? "" : match[1] === "Image" ? "raw" : "compressed";
}

/**
 * Return the bytes of a `uint8[]`, which is base64 text in JSON.
 * @param {any} data @returns {Uint8Array<ArrayBuffer>} @throws {RangeError} these are no bytes
 */
export function bytesOf(data) {
  if (data instanceof Uint8Array) {
    return /** @type {Uint8Array<ArrayBuffer>} */ (data);
  }
  if (typeof data === "string") {
    try {
      return Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
    } catch {
      throw new RangeError("data: expected base64");
    }
  }
  if (Array.isArray(data)) {
    return Uint8Array.from(data);
  }
  throw new RangeError("data: expected bytes");
}

/** Return the media type of a compressed image. @param {Uint8Array} bytes @returns {string} empty if a browser cannot show it */
export function imageTypeOf(bytes) {
  return IMAGE_SIGNATURES.find(([, signature]) => signature.every((byte, index) => bytes[index] === byte))?.[0] ?? "";
}

/**
 * Return the pixels of an image.
 * @param {any} message - `sensor_msgs/Image`
 * @returns {{width: number, height: number, pixels: Uint8ClampedArray<ArrayBuffer>}} red, green, blue and alpha of each pixel
 * @throws {RangeError} the encoding is not known, the image is too large, or bytes are missing
 */
export function rawPixels(message) {
  const [width, height, encoding] = [Number(message.width), Number(message.height), String(message.encoding)];
  const form = Object.hasOwn(IMAGE_ENCODINGS, encoding) ? IMAGE_ENCODINGS[encoding] : undefined;
  if (form === undefined) {
    throw new RangeError(`encoding: expected one of ${Object.keys(IMAGE_ENCODINGS).join(", ")}; got ${encoding.slice(0, 40)}`);
  }
  if (!(width > 0 && height > 0 && width * height <= MAX_PIXELS)) {
    throw new RangeError(`size: expected 1 to ${MAX_PIXELS} pixels; got ${width} x ${height}`);
  }
  const bytes = bytesOf(message.data);
  const pixelSize = form.channels * form.bytes;
  const step = Number(message.step) || width * pixelSize;
  if (step < width * pixelSize || bytes.length < step * (height - 1) + width * pixelSize) {
    throw new RangeError(`data: expected ${step} x ${height} bytes; got ${bytes.length}`);
  }
  if (encoding === "32FC1") {
    return { width, height, pixels: depthPixels(bytes, step, width, height) };
  }
  // Of two bytes, the more significant one is shown.
  const skip = form.bytes === 2 && !message.is_bigendian ? 1 : 0;
  const pixels = new Uint8ClampedArray(4 * width * height);
  let to = 0;
  for (let row = 0; row < height; row += 1) {
    let from = row * step + skip;
    for (let column = 0; column < width; column += 1) {
      for (const place of form.places) {
        pixels[to] = place < 0 ? 255 : /** @type {number} */ (bytes[from + place * form.bytes]);
        to += 1;
      }
      from += pixelSize;
    }
  }
  return { width, height, pixels };
}

/** Distance at which a picture of distances is half as bright as at 0 [m]; the sky is black. */
const HALF_BRIGHT = 12;

/**
 * @param {Uint8Array} bytes - little-endian distances [m] @param {number} step - bytes of a row @param {number} width
 * @param {number} height
 */
function depthPixels(bytes, step, width, height) {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const pixels = new Uint8ClampedArray(4 * width * height).fill(255);
  for (let i = 0; i < width * height; i += 1) {
    const distance = view.getFloat32(step * Math.floor(i / width) + 4 * (i % width), true);
    pixels.fill((255 * HALF_BRIGHT) / (HALF_BRIGHT + distance), 4 * i, 4 * i + 3);
  }
  return pixels;
}
