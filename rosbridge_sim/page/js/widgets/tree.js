/**
 * A message as a tree by the ARIA pattern: one row has the focus, arrow keys move, open and close, Enter chooses.
 *
 * Rows are kept and only their texts change, so five updates a second cost little and the focus stays.
 */

import { element, setText } from "./dom.js";
import { treeRows } from "./tree_rows.js";

/** @typedef {import("./tree_rows.js").TreeRow} TreeRow */
/** @typedef {{label: string, cut: string, choose?: string}} TreeTexts choose: title of a row that can be chosen */

/** Nodes that are closed before somebody opens them: long ones, and deep ones. */
const AUTO_OPEN_SIZE = 20;
const AUTO_OPEN_DEPTH = 2;
/** Open and closed nodes that are remembered; the oldest are forgotten. */
const MAX_TREE_CHOICES = 1000;

/** A message as a tree. */
export class MessageTree {
  /** @param {TreeTexts} texts @param {(path: string) => void} [choose] - called with a row of a number that was clicked */
  constructor(texts, choose) {
    this.texts = texts;
    this.choose = choose;
    /** @type {any} */
    this.message = null;
    /** Nodes that the user has opened or closed. @type {Map<string, boolean>} */
    this.choices = new Map();
    /** @type {TreeRow[]} */
    this.rows = [];
    /** @type {RowView[]} */
    this.views = [];
    /** Row of the focus. */
    this.at = 0;
    this.list = element("div", { className: "tree", role: "tree", "aria-label": texts.label });
    this.cutNote = element("p", { className: "hint", hidden: true }, texts.cut);
    this.element = element("div", {}, this.list, this.cutNote);
    this.list.addEventListener("click", (event) => this.click(event));
    this.list.addEventListener("keydown", (event) => this.press(event));
  }

  /** @param {any} message */
  show(message) {
    this.message = message;
    this.draw();
  }

  draw() {
    const isOpen = (/** @type {string} */ path, /** @type {number} */ depth, /** @type {number} */ size) =>
      this.choices.get(path) ?? (depth < AUTO_OPEN_DEPTH && size <= AUTO_OPEN_SIZE);
    const { rows, isCut } = treeRows(this.message, isOpen);
    const hasFocus = this.list.contains(document.activeElement);
    this.rows = rows;
    this.at = Math.max(0, Math.min(this.at, rows.length - 1));
    while (this.views.length < rows.length) {
      const view = new RowView(this.views.length);
      this.views.push(view);
      this.list.append(view.element);
    }
    for (const view of this.views.splice(rows.length)) {
      view.element.remove();
    }
    rows.forEach((row, index) => this.views[index]?.show(row, index === this.at, this.texts.choose && this.choose ? this.texts.choose : ""));
    if (hasFocus && !this.list.contains(document.activeElement)) {
      this.views[this.at]?.element.focus();
    }
    this.cutNote.hidden = !isCut;
  }

  /** @param {MouseEvent} event */
  click(event) {
    const target = event.target instanceof Element ? event.target.closest("[data-row]") : null;
    const index = target instanceof HTMLElement ? Number(target.dataset.row) : -1;
    if (index >= 0) {
      this.focus(index);
      this.activate(index);
    }
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    const row = this.rows[this.at];
    if (row === undefined || event.ctrlKey || event.altKey || event.metaKey) {
      return;
    }
    const isNode = row.kind === "node";
    const forward = () => (isNode && !row.isOpen ? this.setOpen(row, true) : isNode && this.focus(this.at + 1));
    const back = () => (row.isOpen ? this.setOpen(row, false) : this.focus(this.parentOf(this.at)));
    const activate = () => this.activate(this.at);
    /** @type {Record<string, () => unknown>} */
    const keys = {
      ArrowDown: () => this.focus(this.at + 1),
      ArrowUp: () => this.focus(this.at - 1),
      Home: () => this.focus(0),
      End: () => this.focus(this.rows.length - 1),
      ArrowRight: forward,
      ArrowLeft: back,
      Enter: activate,
      " ": activate,
    };
    if (Object.hasOwn(keys, event.key)) {
      keys[event.key]?.();
      event.preventDefault();
      event.stopPropagation();
    }
  }

  /** @param {number} index row of the node around a row; -1 if there is none */
  parentOf(index) {
    const depth = this.rows[index]?.depth ?? 0;
    let parent = index - 1;
    while (parent >= 0 && (this.rows[parent]?.depth ?? 0) >= depth) {
      parent -= 1;
    }
    return parent;
  }

  /** @param {number} index */
  activate(index) {
    const row = this.rows[index];
    if (row?.kind === "node") {
      this.setOpen(row, !row.isOpen);
    } else if (row?.kind === "number") {
      this.choose?.(row.path);
    }
  }

  /** @param {TreeRow} row @param {boolean} isOpen */
  setOpen(row, isOpen) {
    this.choices.delete(row.path);
    this.choices.set(row.path, isOpen);
    for (const path of this.choices.keys()) {
      if (this.choices.size <= MAX_TREE_CHOICES) {
        break;
      }
      this.choices.delete(path);
    }
    this.draw();
  }

  /** @param {number} index */
  focus(index) {
    const view = this.views[index];
    if (view !== undefined) {
      const old = this.views[this.at];
      if (old !== undefined) {
        old.element.tabIndex = -1;
      }
      this.at = index;
      view.element.tabIndex = 0;
      view.element.focus();
    }
  }
}

/** One row on the screen. */
class RowView {
  /** @param {number} index */
  constructor(index) {
    this.sign = element("span", { className: "tree-sign", "aria-hidden": "true" });
    this.name = element("span", { className: "tree-name" });
    this.value = element("span", { className: "tree-value" });
    this.element = element("div", { className: "tree-row", role: "treeitem", tabIndex: -1, dataset: { row: String(index) } }, this.sign, this.name, this.value);
    this.path = "";
    this.shape = "";
  }

  /**
   * @param {TreeRow} row @param {boolean} isCurrent - whether the tab key leads to it
   * @param {string} choose - title of a row that can be chosen
   */
  show(row, isCurrent, choose) {
    setText(this.name, row.name);
    setText(this.value, row.text);
    this.element.tabIndex = isCurrent ? 0 : -1;
    const shape = `${row.depth} ${row.kind} ${row.isOpen}`;
    if (shape === this.shape) {
      return;
    }
    this.shape = shape;
    setText(this.sign, row.kind !== "node" ? "" : row.isOpen ? "▾" : "▸");
    this.element.style.paddingLeft = `${Math.min(row.depth, 20)}rem`;
    this.element.setAttribute("aria-level", String(row.depth + 1));
    if (row.kind === "node") {
      this.element.setAttribute("aria-expanded", String(row.isOpen));
    } else {
      this.element.removeAttribute("aria-expanded");
    }
    this.value.dataset.kind = row.kind;
    this.element.title = row.kind === "number" ? choose : "";
  }
}
