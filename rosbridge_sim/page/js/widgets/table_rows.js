/** Which rows of a table are shown, and in which order. */

/** @typedef {{column: number, isDown: boolean}} SortOrder */

/**
 * Return the rows that match a search, sorted.
 * @template Row @param {Row[]} rows
 * @param {{value: (row: Row) => string | number, text?: (row: Row) => string, hint?: (row: Row) => string}[]} columns
 * @param {(row: Row) => string} keyOf - name of a row; of two rows with one name, the first is shown
 * @param {string} search - words that a row must have, in any order and case @param {SortOrder} order
 * @param {number} limit - rows at most @returns {{rows: Row[], hidden: number}} hidden: rows beyond the limit
 */
export function shownRows(rows, columns, keyOf, search, order, limit) {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  /** @type {Map<string, Row>} */
  const found = new Map();
  for (const row of rows) {
    const key = keyOf(row);
    if (!found.has(key) && hasWords(row, columns, key, words)) {
      found.set(key, row);
    }
  }
  const column = columns[order.column];
  const sorted = [...found.entries()].sort(([keyA, a], [keyB, b]) => {
    const result = column ? compareValues(column.value(a), column.value(b)) : 0;
    return (order.isDown ? -result : result) || compareValues(keyA, keyB);
  });
  return { rows: sorted.slice(0, limit).map(([, row]) => row), hidden: Math.max(0, sorted.length - limit) };
}

/**
 * @template Row @param {Row} row
 * @param {{value: (row: Row) => string | number, text?: (row: Row) => string, hint?: (row: Row) => string}[]} columns
 * @param {string} key @param {string[]} words
 */
function hasWords(row, columns, key, words) {
  if (words.length === 0) {
    return true;
  }
  const parts = columns.map((column) => `${column.text ? column.text(row) : column.value(row)} ${column.hint?.(row) ?? ""}`);
  const text = [key, ...parts].join(" ").toLowerCase();
  return words.every((word) => text.includes(word));
}

/** @param {string | number} a @param {string | number} b */
function compareValues(a, b) {
  if (typeof a === "number" && typeof b === "number") {
    return a - b;
  }
  const [textA, textB] = [String(a), String(b)];
  return textA < textB ? -1 : textA > textB ? 1 : 0;
}
