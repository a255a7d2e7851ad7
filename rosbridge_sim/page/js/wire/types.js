/**
 * Message definitions: the text of a type with its comments -> fields, units, choices and default values.
 *
 * The text is that of `/rosapi/definition`: the type itself, then after each line of equal signs `MSG: pkg/Type` and the
 * text of a type in it.
 */

/** @typedef {{name: string, type: string, value: string, comment: string}} TypeConstant */

/**
 * @typedef {{name: string, type: string, length: number, isArray: boolean, max: number, comment: string, unit: string, preset: string}} TypeField
 *   length: of an array, -1 for any; max: longest length of an array, Infinity without a limit; preset: default value as
 *   text, or empty
 */

/** @typedef {{name: string, comment: string, fields: TypeField[], constants: TypeConstant[]}} TypeSpec */

/** Longest text of a definition that is read: ten times the largest one of the standard packages. */
const MAX_DEFINITION = 1_000_000;
/** Deepest nesting of a default value, so that a type that contains itself ends. */
const MAX_TYPE_DEPTH = 20;
/** Least and greatest value of each type of integers that a JavaScript number holds exactly. */
const INTEGER_RANGES = new Map([
  ["int8", [-128, 127]],
  ["uint8", [0, 255]],
  ["byte", [-128, 127]],
  ["char", [0, 255]],
  ["int16", [-32768, 32767]],
  ["uint16", [0, 65535]],
  ["int32", [-2147483648, 2147483647]],
  ["uint32", [0, 4294967295]],
  ["int64", [Number.MIN_SAFE_INTEGER, Number.MAX_SAFE_INTEGER]],
  ["uint64", [0, Number.MAX_SAFE_INTEGER]],
]);

const TEXT_TYPES = ["string", "wstring"];
const FLOAT_TYPES = ["float32", "float64"];

const FIELD = /^([A-Za-z][\w/]*)(<=\d+)?(\[(<=)?(\d*)\])?\s+([A-Za-z]\w*)\s*(.*)$/;
const CONSTANT = /^([A-Za-z]\w*)(<=\d+)?\s+([A-Za-z]\w*)\s*=\s*(.*)$/;
const TYPE_HEAD = /^MSG:\s*(\S+)$/;
/** Base types that are written as a message with two numbers. @type {Record<string, TypeSpec>} */
const TIME_SPECS = { time: timeSpec("time", "uint32"), duration: timeSpec("duration", "int32") };

/** The definition of a type, and of the types in it. */
export class TypeDefinition {
  /**
   * @param {string} name - name of the type @param {string} text - its text, followed by those of the types in it
   * @throws {TypeTextError} a line is no field, constant or comment
   */
  constructor(name, text) {
    if (text.length > MAX_DEFINITION) {
      throw new TypeTextError(`${name}: ${text.length} characters, more than ${MAX_DEFINITION}`);
    }
    this.name = name;
    /** @type {Map<string, TypeSpec>} */
    this.types = new Map(Object.entries(TIME_SPECS));
    const [own = "", ...others] = text.split(/^={80}$/m);
    this.root = parseType(name, own);
    this.types.set(name, this.root);
    for (const part of others) {
      const [head = "", ...lines] = part.trim().split("\n");
      const match = TYPE_HEAD.exec(head.trim());
      if (match?.[1]) {
        this.types.set(match[1], parseType(match[1], lines.join("\n")));
      }
    }
  }

  /** Find the message type of a field. @param {TypeField} field @returns {TypeSpec | null} null for a base type */
  nested(field) {
    return this.types.get(field.type) ?? null;
  }

  /**
   * Return a message with default values.
   * @param {TypeSpec} [spec] - type of the message @param {number} [depth] @returns {Record<string, any>}
   */
  defaults(spec = this.root, depth = 0) {
    return Object.fromEntries(spec.fields.map((field) => [field.name, this.defaultOf(field, depth)]));
  }

  /** Return the default value of a field. @param {TypeField} field @param {number} [depth] @returns {any} */
  defaultOf(field, depth = 0) {
    if (field.isArray) {
      const preset = parsePreset(field.preset);
      return Array.isArray(preset) ? preset : Array.from({ length: Math.max(0, field.length) }, () => this.itemOf(field, depth));
    }
    return this.itemOf(field, depth);
  }

  /**
   * Return the default value of one item of an array, or of a field that is none.
   * @param {TypeField} field @param {number} [depth] @returns {any}
   */
  itemOf(field, depth = 0) {
    const spec = this.nested(field);
    if (spec !== null) {
      return depth < MAX_TYPE_DEPTH ? this.defaults(spec, depth + 1) : {};
    }
    const preset = field.isArray ? undefined : parsePreset(field.preset);
    if (TEXT_TYPES.includes(field.type)) {
      return preset === undefined ? "" : String(preset);
    }
    if (field.type === "bool") {
      return preset === true || preset === 1;
    }
    return typeof preset === "number" ? preset : 0;
  }
}

/** A text that is no definition of a type. */
export class TypeTextError extends Error {
  name = "TypeTextError";
}

/**
 * Return the value that a text has for a base type.
 * @param {string} type - base type @param {string} text @returns {any} number, text or truth value
 * @throws {RangeError} the text is no value of the type; the message says what is expected
 */
export function parseBaseValue(type, text) {
  if (TEXT_TYPES.includes(type)) {
    return text;
  }
  const trimmed = text.trim();
  if (type === "bool") {
    if (!/^(true|1|false|0)$/i.test(trimmed)) {
      throw new RangeError("true or false");
    }
    return /^(true|1)$/i.test(trimmed);
  }
  const value = trimmed === "" ? NaN : Number(trimmed);
  const range = INTEGER_RANGES.get(type);
  if (range !== undefined) {
    const [least = 0, most = 0] = range;
    if (!Number.isInteger(value) || value < least || value > most) {
      throw new RangeError(`${type}: ${least} … ${most}`);
    }
    return value;
  }
  if (!FLOAT_TYPES.includes(type) || !Number.isFinite(value)) {
    throw new RangeError(type);
  }
  return value;
}

/**
 * Constants that are values of a field: those of its type whose names begin with the name of the field; or all of its type, if
 * no other field of the message could have them.
 * @param {TypeSpec} spec - type of the message @param {TypeField} field @returns {TypeConstant[]}
 */
export function choicesOf(spec, field) {
  if (field.isArray) {
    return [];
  }
  const ofType = spec.constants.filter((constant) => constant.type === field.type);
  const prefix = `${field.name.toUpperCase()}_`;
  const named = ofType.filter((constant) => constant.name.toUpperCase().startsWith(prefix));
  if (named.length > 0) {
    return named;
  }
  const isOnly = spec.fields.filter((other) => other.type === field.type).length === 1;
  return isOnly ? ofType : [];
}

/** Return the unit in a comment: what the last brackets hold, such as "m/s" of "speed [m/s]". @param {string} comment */
export function unitOf(comment) {
  return /\[([^[\]]{1,40})\]\s*$/.exec(comment)?.[1] ?? "";
}

/** @param {string} name @param {string} text @returns {TypeSpec} */
function parseType(name, text) {
  /** @type {TypeSpec} */
  const spec = { name, comment: "", fields: [], constants: [] };
  /** Lines of comment since the last field. @type {string[]} */
  let above = [];
  let isFirst = true;
  for (const raw of text.split("\n")) {
    const line = raw.trim();
    if (line === "") {
      if (isFirst && above.length > 0) {
        spec.comment = above.join(" ");
        isFirst = false;
      }
      above = [];
    } else if (line.startsWith("#")) {
      above.push(line.replace(/^#+\s?/, ""));
    } else {
      parseLine(spec, line, above.join(" "));
      isFirst = false;
      above = [];
    }
  }
  if (isFirst) {
    spec.comment = above.join(" ");
  }
  return spec;
}

/** @param {TypeSpec} spec @param {string} line - a field or a constant @param {string} above - comment in the lines before it */
function parseLine(spec, line, above) {
  const constant = CONSTANT.exec(line);
  if (constant) {
    const [, type = "", , name = "", rest = ""] = constant;
    const [value, comment] = TEXT_TYPES.includes(type) ? [rest, ""] : splitComment(rest);
    spec.constants.push({ name, type, value: value.replace(/^(["'])(.*)\1$/, "$2"), comment: comment || above });
    return;
  }
  const field = FIELD.exec(line);
  if (!field) {
    throw new TypeTextError(`${spec.name}: expected a field or a constant; got ${line.slice(0, 100)}`);
  }
  const [, given = "", , brackets, isBounded, size = "", name = "", rest = ""] = field;
  const type = given === "Header" ? "std_msgs/Header" : given;
  const [preset, after] = splitComment(rest);
  const comment = after || above;
  const number = size === "" ? -1 : Number(size);
  spec.fields.push({
    name,
    type,
    isArray: brackets !== undefined,
    length: isBounded ? -1 : number,
    max: number < 0 ? Infinity : number,
    comment,
    unit: unitOf(comment),
    preset,
  });
}

/** @param {string} text @returns {[string, string]} what is before the comment, and the comment */
function splitComment(text) {
  const quoted = /^("(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')/.exec(text)?.[0] ?? "";
  const at = text.indexOf("#", quoted.length);
  return at < 0 ? [text.trim(), ""] : [text.slice(0, at).trim(), text.slice(at + 1).trim()];
}

/** @param {string} text - a default value @returns {any} undefined if there is none */
function parsePreset(text) {
  if (text === "") {
    return undefined;
  }
  const plain = /^'(.*)'$/.exec(text);
  if (plain) {
    return plain[1];
  }
  try {
    return JSON.parse(/^(true|false)$/i.test(text) ? text.toLowerCase() : text);
  } catch {
    return text;
  }
}

/** @param {string} name @param {string} type - of the seconds @returns {TypeSpec} */
function timeSpec(name, type) {
  const part = (/** @type {string} */ partName, /** @type {string} */ unit) => {
    return { name: partName, type, isArray: false, length: -1, max: Infinity, comment: "", unit, preset: "" };
  };
  return { name, comment: "", fields: [part("secs", "s"), part("nsecs", "ns")], constants: [] };
}
