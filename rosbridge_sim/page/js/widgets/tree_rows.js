/**
 * The rows of a message as a tree: only what is open is looked at, long arrays come in groups, and the number of rows is
 * bounded, so that a message of any size costs the same.
 */

/**
 * @typedef {{
 *   path: string,
 *   name: string,
 *   depth: number,
 *   text: string,
 *   kind: "number" | "text" | "other" | "node",
 *   isOpen: boolean,
 * }} TreeRow
 *   path: keys from the root as JSON text; kind: node has children
 */

/** Rows at most; more than a person scrolls through, and few enough for five updates a second. */
export const MAX_TREE_ROWS = 400;
/** Items of an array in one group. */
const GROUP_SIZE = 100;
/** Characters of a text that are shown. */
const MAX_TREE_TEXT = 300;
/** Items and characters of a closed array that are shown. */
const PREVIEW_ITEMS = 8;
const PREVIEW_CHARS = 80;

/** A part of a long array: `size` items from `start`. */
class Group {
  /** @param {ArrayLike<any>} items @param {number} start @param {number} size */
  constructor(items, start, size) {
    this.items = items;
    this.start = start;
    this.end = Math.min(items.length, start + size);
  }
}

/**
 * Return the rows of a message.
 * @param {any} message
 * @param {(path: string, depth: number, size: number) => boolean} isOpen - whether a node is open; size: its children
 * @param {number} [limit] - rows at most @returns {{rows: TreeRow[], isCut: boolean}}
 */
export function treeRows(message, isOpen, limit = MAX_TREE_ROWS) {
  /** @type {TreeRow[]} */
  const rows = [];
  /**
   * @param {any} value @param {(string | number)[]} keys @param {number} depth
   * @returns {boolean} false if there are too many rows
   */
  const addChildren = (value, keys, depth) => {
    for (const [key, child] of childrenOf(value)) {
      if (rows.length >= limit) {
        return false;
      }
      const path = JSON.stringify([...keys, key]);
      const size = sizeOf(child);
      const isNode = size > 0;
      const isShown = isNode && isOpen(path, depth, size);
      rows.push({
        path,
        name: child instanceof Group ? `[${child.start} … ${child.end - 1}]` : typeof key === "number" ? `[${key}]` : cutText(key, 100),
        depth,
        text: child instanceof Group ? "" : isShown ? sizeText(child, size) : valueText(child),
        kind: isNode ? "node" : kindOf(child),
        isOpen: isShown,
      });
      if (isShown && !addChildren(child, [...keys, key], depth + 1)) {
        return false;
      }
    }
    return true;
  };
  return { isCut: !addChildren(message, [], 0), rows };
}

/** Return the value at a path. @param {any} message @param {string} path - of a row @returns {any} undefined if there is none */
export function valueAtPath(message, path) {
  let value = message;
  for (const key of JSON.parse(path)) {
    if (value === null || typeof value !== "object") {
      return undefined;
    }
    if (typeof key === "string" && key.startsWith("#") && isList(value)) {
      continue; // a group of items
    }
    value = Object.hasOwn(value, key) ? value[key] : undefined;
  }
  return value;
}

/** Return a path as people write it, such as `objects[3].speed`. @param {string} path - of a row @returns {string} */
export function pathText(path) {
  /** @type {(string | number)[]} */
  const keys = JSON.parse(path);
  return keys
    .filter((key) => typeof key === "number" || !key.startsWith("#"))
    .map((key, index) => (typeof key === "number" ? `[${key}]` : index === 0 ? key : `.${key}`))
    .join("");
}

/** Return a value in one line. @param {any} value @returns {string} */
export function valueText(value) {
  if (typeof value === "string") {
    return JSON.stringify(cutText(value, MAX_TREE_TEXT));
  }
  if (isList(value)) {
    return value.length === 0 ? "[]" : `(${value.length}) ${previewText(value)}`;
  }
  if (value !== null && typeof value === "object") {
    return Object.keys(value).length === 0 ? "{}" : "{…}";
  }
  return Object.is(value, -0) ? "-0" : String(value);
}

/** @param {string} text @param {number} length */
export function cutText(text, length) {
  return text.length > length ? `${text.slice(0, length)}… (${text.length})` : text;
}

/** @param {any} value @returns {value is ArrayLike<any>} */
function isList(value) {
  return Array.isArray(value) || (ArrayBuffer.isView(value) && !(value instanceof DataView));
}

/** @param {any} value number of children */
function sizeOf(value) {
  if (value instanceof Group) {
    return value.end - value.start;
  }
  if (isList(value)) {
    return value.length;
  }
  return value !== null && typeof value === "object" ? Object.keys(value).length : 0;
}

/** @param {any} value @returns {"number" | "text" | "other"} */
function kindOf(value) {
  if (typeof value === "number" || typeof value === "bigint" || typeof value === "boolean") {
    return "number";
  }
  return typeof value === "string" ? "text" : "other";
}

/** @param {any} value @returns {Generator<[string | number, any]>} */
function* childrenOf(value) {
  if (value instanceof Group) {
    yield* itemsOf(value.items, value.start, value.end);
  } else if (isList(value)) {
    yield* itemsOf(value, 0, value.length);
  } else if (value !== null && typeof value === "object") {
    yield* Object.entries(value);
  }
}

/** @param {ArrayLike<any>} items @param {number} start @param {number} end @returns {Generator<[string | number, any]>} */
function* itemsOf(items, start, end) {
  let size = 1;
  while ((end - start) / size > GROUP_SIZE) {
    size *= GROUP_SIZE;
  }
  for (let at = start; at < end; at += size) {
    yield size === 1 ? [at, items[at]] : [`#${at}+${size}`, new Group(items, at, Math.min(size, end - at))];
  }
}

/** @param {any} value @param {number} size */
function sizeText(value, size) {
  return isList(value) ? `(${size})` : "";
}

/** @param {ArrayLike<any>} items */
function previewText(items) {
  const shown = [];
  for (let i = 0; i < Math.min(items.length, PREVIEW_ITEMS); i += 1) {
    const item = items[i];
    shown.push(isList(item) ? "[…]" : valueText(typeof item === "string" ? cutText(item, PREVIEW_CHARS) : item));
  }
  return cutPreview(`${shown.join(", ")}${items.length > PREVIEW_ITEMS ? ", …" : ""}`);
}

/** @param {string} text */
function cutPreview(text) {
  return text.length > PREVIEW_CHARS ? `${text.slice(0, PREVIEW_CHARS)}…` : text;
}
