// The way back from changes of the scene, the latest one first.

import { Takers } from "../wire/takers.js";

/** @typedef {{title: string, undo: () => Promise<unknown> | void}} UndoStep */

/** So many changes can be taken back. */
const UNDO_DEPTH = 20;

export class UndoList {
  /** @type {UndoStep[]} */
  steps = [];
  changes = new Takers();
  onChange = this.changes.addNow;
  tell = this.changes.tell;

  /** @param {string} title of the change, for the user @param {() => Promise<unknown> | void} undo */
  add(title, undo) {
    this.steps = [...this.steps, { title, undo }].slice(-UNDO_DEPTH);
    this.tell();
  }

  /** Forget all changes: the scene is another one. */
  clear() {
    this.steps = [];
    this.tell();
  }

  /** Take the latest change back. It leaves the list also if that fails: the scene may have lost what it concerned. */
  async undo() {
    const step = this.steps.pop();
    this.tell();
    await step?.undo();
  }
}
