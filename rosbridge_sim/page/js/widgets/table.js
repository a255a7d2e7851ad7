/** A table that can be searched and sorted, whose rows are kept while their values change. */

import { element, setText } from "./dom.js";
import { shownRows } from "./table_rows.js";

/** @typedef {import("./table_rows.js").SortOrder} SortOrder */

/**
 * @template Row
 * @typedef {{
 *   key: string,
 *   title: string,
 *   value: (row: Row) => string | number,
 *   text?: (row: Row) => string,
 *   hint?: (row: Row) => string,
 *   isMinor?: boolean,
 * }} TableColumn
 *   value: sorted by; text: shown, otherwise the value; hint: small second line; isMinor: not on phones
 */

/**
 * @template Row
 * @typedef {{
 *   label: string,
 *   search: string,
 *   empty: string,
 *   more: (count: number) => string,
 *   columns: TableColumn<Row>[],
 *   keyOf: (row: Row) => string,
 *   choose?: (row: Row) => void,
 * }} TableOptions
 *   keyOf: name of a row, which is also what is searched together with all texts
 */

/** Rows on the screen at most. */
const MAX_TABLE_ROWS = 300;

/** A table of rows. @template Row */
export class DataTable {
  /** @param {TableOptions<Row>} options - its first column is the name of a row */
  constructor(options) {
    this.options = options;
    /** @type {Row[]} */
    this.rows = [];
    /** @type {SortOrder} */
    this.order = { column: 0, isDown: false };
    this.chosen = "";
    /** @type {Map<string, TableRowView<Row>>} */
    this.views = new Map();
    this.search = element("input", { type: "search", placeholder: options.search, "aria-label": options.search, className: "table-search" });
    this.search.addEventListener("input", () => this.draw());
    this.heads = options.columns.map((column, index) => this.makeHead(column, index));
    this.body = element("tbody", {});
    this.note = element("p", { className: "hint" });
    this.table = element(
      "table",
      { className: "data-table", "aria-label": options.label },
      element("thead", {}, element("tr", {}, ...this.heads)),
      this.body,
    );
    this.element = element("div", { className: "table-box" }, this.search, this.table, this.note);
    this.body.addEventListener("keydown", (event) => this.press(event));
    this.draw();
  }

  /** @param {Row[]} rows */
  show(rows) {
    this.rows = rows;
    this.draw();
  }

  /** @param {string} key - of the chosen row; empty for none */
  mark(key) {
    this.chosen = key;
    this.draw();
  }

  draw() {
    const { columns, keyOf } = this.options;
    const { rows, hidden } = shownRows(this.rows, columns, keyOf, this.search.value, this.order, MAX_TABLE_ROWS);
    const old = this.views;
    this.views = new Map();
    /** @type {ChildNode | null} */
    let place = this.body.firstChild;
    for (const row of rows) {
      const key = keyOf(row);
      const view = old.get(key) ?? new TableRowView(this.options);
      old.delete(key);
      this.views.set(key, view);
      view.show(row, key === this.chosen);
      if (view.element === place) {
        place = place.nextSibling;
      } else {
        this.body.insertBefore(view.element, place); // a row that moves keeps its element
      }
    }
    for (const view of old.values()) {
      view.element.remove();
    }
    this.heads.forEach((head, index) => {
      const isSorted = index === this.order.column;
      head.setAttribute("aria-sort", isSorted ? (this.order.isDown ? "descending" : "ascending") : "none");
    });
    setText(this.note, rows.length === 0 ? this.options.empty : hidden > 0 ? this.options.more(hidden) : "");
  }

  /** @param {TableColumn<Row>} column @param {number} index */
  makeHead(column, index) {
    const button = element("button", { type: "button", className: "table-sort" }, column.title);
    button.addEventListener("click", () => {
      // Numbers are looked at from the greatest one, names from the first letter.
      const isDown = this.order.column === index ? !this.order.isDown : index > 0;
      this.order = { column: index, isDown };
      this.draw();
    });
    return element("th", { scope: "col", className: column.isMinor ? "minor" : "" }, button);
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step !== undefined) {
      const buttons = [...this.body.querySelectorAll("button")];
      const at = buttons.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
      const next = buttons[at + step];
      if (at >= 0 && next !== undefined) {
        event.preventDefault();
        next.focus();
      }
    }
  }
}

/** One row on the screen. @template Row */
class TableRowView {
  /** @param {TableOptions<Row>} options */
  constructor({ columns, choose }) {
    this.columns = columns;
    /** @type {Row | null} */
    this.row = null;
    this.texts = columns.map(() => element("span", {}));
    this.hints = columns.map((column) => (column.hint ? element("small", {}) : null));
    this.button = choose ? element("button", { type: "button", className: "table-choice" }, this.texts[0], this.hints[0]) : null;
    this.button?.addEventListener("click", () => void (this.row !== null && choose?.(this.row)));
    this.element = element("tr", {}, ...columns.map((column, index) => this.makeCell(column, index)));
  }

  /** @param {TableColumn<Row>} column @param {number} index */
  makeCell(column, index) {
    const content = index === 0 && this.button ? [this.button] : [this.texts[index], this.hints[index]];
    return index === 0
      ? element("th", { scope: "row" }, ...content)
      : element("td", { className: column.isMinor ? "minor" : "" }, ...content);
  }

  /** @param {Row} row @param {boolean} isChosen */
  show(row, isChosen) {
    this.row = row;
    this.columns.forEach((column, index) => {
      const text = /** @type {HTMLElement} */ (this.texts[index]);
      setText(text, column.text ? column.text(row) : String(column.value(row)));
      const hint = this.hints[index];
      if (hint) {
        setText(hint, column.hint?.(row) ?? "");
      }
    });
    this.button?.setAttribute("aria-pressed", String(isChosen));
  }
}
