/** CBOR (RFC 8949) as rosbridge servers write it: plain values, byte strings, and typed arrays (RFC 8746). */

/** Deepest nesting that is read; the deepest ROS message of the standard packages has seven levels. */
const MAX_CBOR_DEPTH = 100;
/** Integers beyond this are read as BigInt, because a number would be another one. */
const MAX_SAFE = BigInt(Number.MAX_SAFE_INTEGER);
/** End of a text, list or map of indefinite length. */
const CBOR_BREAK = Symbol("break");

const IS_LITTLE_ENDIAN = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/**
 * @typedef {Uint8ArrayConstructor | Uint16ArrayConstructor | Uint32ArrayConstructor | BigUint64ArrayConstructor
 *   | Int8ArrayConstructor | Int16ArrayConstructor | Int32ArrayConstructor | BigInt64ArrayConstructor
 *   | Float32ArrayConstructor | Float64ArrayConstructor} ArrayKind
 */

/** Kinds of arrays by the bits of a tag of RFC 8746 (section 2.1): float, signed, and two for the size. @type {(ArrayKind | null)[]} */
const ARRAY_KINDS = [
  ...[Uint8Array, Uint16Array, Uint32Array, BigUint64Array],
  ...[Int8Array, Int16Array, Int32Array, BigInt64Array],
  ...[null, Float32Array, Float64Array, null],
];

/** @param {number} tag @returns {[ArrayKind, boolean] | undefined} kind and byte order */
function arrayOfTag(tag) {
  const kind = tag >= 64 && tag < 88 ? ARRAY_KINDS[(4 * ((tag - 64) >> 3)) + (tag & 3)] : null;
  return kind && tag !== 76 ? [kind, (tag & 4) !== 0 || kind.BYTES_PER_ELEMENT === 1] : undefined;
}

/**
 * Decode one CBOR item.
 * @param {ArrayBuffer | Uint8Array} data - the whole item
 * @returns {any} objects, arrays, texts, numbers (BigInt beyond 53 bits), truth values, null, Uint8Array for a byte
 *   string, and a typed array for a tagged one
 * @throws {CborError} the bytes are not one CBOR item, or hold a tag that is not known
 */
export function decodeCbor(data) {
  const reader = new CborReader(data instanceof Uint8Array ? data : new Uint8Array(data));
  let value;
  try {
    value = reader.read(0);
  } catch (error) {
    // A DataView beyond its end; a text that is not UTF-8.
    throw error instanceof RangeError || error instanceof TypeError ? new CborError(`not CBOR: ${error.message}`) : error;
  }
  if (value === CBOR_BREAK) {
    throw new CborError("a break outside of a list");
  }
  reader.expectEnd();
  return value;
}

/** A frame that is not CBOR, or not of the kind that rosbridge servers write. */
export class CborError extends Error {
  name = "CborError";
}

class CborReader {
  /** @param {Uint8Array} bytes */
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.position = 0;
    this.texts = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });
  }

  expectEnd() {
    if (this.position !== this.bytes.length) {
      throw new CborError(`${this.bytes.length - this.position} bytes behind the end of the item`);
    }
  }

  /** Read an item. @param {number} depth - number of containers around it @returns {any} */
  read(depth) {
    if (depth > MAX_CBOR_DEPTH) {
      throw new CborError(`more than ${MAX_CBOR_DEPTH} levels`);
    }
    const first = this.view.getUint8(this.position++);
    const major = first >> 5;
    const info = first & 31;
    switch (major) {
      case 0:
        return this.readArgument(info);
      case 1: {
        const number = this.readArgument(info);
        if (typeof number === "number" && number < Number.MAX_SAFE_INTEGER) {
          return -1 - number;
        }
        return -1n - BigInt(number);
      }
      case 2:
        return info === 31 ? this.joinBytes() : this.readBytes(this.readLength(info));
      case 3:
        return info === 31 ? this.joinTexts() : this.texts.decode(this.readBytes(this.readLength(info)));
      case 4:
        return this.readList(info, depth);
      case 5:
        return this.readMap(info, depth);
      case 6:
        return this.readTagged(Number(this.readArgument(info)), depth);
      default:
        return this.readSimple(info);
    }
  }

  /**
   * Read the number of a head: a value, a length or a tag.
   * @param {number} info - the last five bits of the head @returns {number | bigint}
   */
  readArgument(info) {
    const at = this.position;
    if (info < 24) {
      return info;
    }
    this.position += 2 ** (info - 24);
    switch (info) {
      case 24:
        return this.view.getUint8(at);
      case 25:
        return this.view.getUint16(at);
      case 26:
        return this.view.getUint32(at);
      case 27: {
        const number = this.view.getBigUint64(at);
        return number <= MAX_SAFE ? Number(number) : number;
      }
      default:
        throw new CborError(`head with the reserved value ${info}`);
    }
  }

  /** @param {number} info */
  readLength(info) {
    const length = Number(this.readArgument(info));
    if (length > this.bytes.length - this.position) {
      throw new CborError(`a length of ${length}, but only ${this.bytes.length - this.position} bytes are left`);
    }
    return length;
  }

  /** @param {number} length */
  readBytes(length) {
    const start = this.position;
    this.position += length;
    return this.bytes.subarray(start, this.position);
  }

  joinBytes() {
    /** @type {number[]} */
    const bytes = [];
    for (const part of this.readParts(2)) {
      for (const byte of part) {
        bytes.push(byte);
      }
    }
    return new Uint8Array(bytes);
  }

  joinTexts() {
    return [...this.readParts(3)].map((part) => this.texts.decode(part)).join("");
  }

  /**
   * Read the pieces of a text or byte string of indefinite length.
   * @param {number} major - major type that each piece must have @returns {Generator<Uint8Array>}
   */
  *readParts(major) {
    for (;;) {
      const first = this.view.getUint8(this.position++);
      if (first === 0xff) {
        return;
      }
      if (first >> 5 !== major || (first & 31) === 31) {
        throw new CborError("a piece of another kind in a text or byte string");
      }
      yield this.readBytes(this.readLength(first & 31));
    }
  }

  /** @param {number} info @param {number} depth */
  readList(info, depth) {
    const list = [];
    const length = info === 31 ? Infinity : this.readLength(info);
    for (let i = 0; i < length; i++) {
      const value = this.read(depth + 1);
      if (value === CBOR_BREAK) {
        if (info !== 31) {
          throw new CborError("a break in a list with a length");
        }
        break;
      }
      list.push(value);
    }
    return list;
  }

  /** @param {number} info @param {number} depth */
  readMap(info, depth) {
    /** @type {Record<string, any>} */
    const map = {};
    const length = info === 31 ? Infinity : this.readLength(info);
    for (let i = 0; i < length; i++) {
      const key = this.read(depth + 1);
      if (key === CBOR_BREAK && info === 31) {
        break;
      }
      if (typeof key !== "string") {
        throw new CborError("a key that is no text");
      }
      const value = this.read(depth + 1);
      if (value === CBOR_BREAK) {
        throw new CborError("a key without a value");
      }
      if (key === "__proto__") {
        Object.defineProperty(map, key, { value, enumerable: true, configurable: true, writable: true });
      } else {
        map[key] = value;
      }
    }
    return map;
  }

  /** @param {number} tag @param {number} depth */
  readTagged(tag, depth) {
    const kind = arrayOfTag(tag);
    const value = this.read(depth + 1);
    if (kind === undefined || !(value instanceof Uint8Array)) {
      throw new CborError(`tag ${tag} is not known`);
    }
    return toTypedArray(value, kind[0], kind[1]);
  }

  /** @param {number} info */
  readSimple(info) {
    const at = this.position;
    switch (info) {
      case 20:
        return false;
      case 21:
        return true;
      case 22:
      case 23:
        return null;
      case 25:
        this.position += 2;
        return readHalf(this.view.getUint16(at));
      case 26:
        this.position += 4;
        return this.view.getFloat32(at);
      case 27:
        this.position += 8;
        return this.view.getFloat64(at);
      case 31:
        return CBOR_BREAK;
      default:
        throw new CborError(`the simple value ${info} is not known`);
    }
  }
}

/** @param {number} bits - a half float */
function readHalf(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 31) {
    return fraction ? NaN : sign * Infinity;
  }
  return sign * (exponent ? 2 ** (exponent - 25) * (1024 + fraction) : 2 ** -24 * fraction);
}

/**
 * Copy bytes into an array of numbers. A copy is needed, because the array must begin at a multiple of its item size.
 * @param {Uint8Array} bytes @param {ArrayKind} kind @param {boolean} isLittleEndian
 */
function toTypedArray(bytes, kind, isLittleEndian) {
  const size = kind.BYTES_PER_ELEMENT;
  if (bytes.length % size !== 0) {
    throw new CborError(`${bytes.length} bytes are no whole number of items with ${size} bytes`);
  }
  const copy = bytes.slice();
  if (size > 1 && isLittleEndian !== IS_LITTLE_ENDIAN) {
    for (let start = 0; start < copy.length; start += size) {
      copy.subarray(start, start + size).reverse();
    }
  }
  return new kind(copy.buffer, 0, copy.length / size);
}
