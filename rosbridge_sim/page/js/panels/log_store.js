// The lines of the log: bounded in number and in characters, however many come.

import { cutText } from "../widgets/tree_rows.js";
import { stampSeconds } from "./ego_values.js";

/** @typedef {"debug" | "info" | "warning" | "error"} LogLevel */

/** @typedef {{number: number, time: number, level: LogLevel, source: string, text: string, count: number}} LogLine */

/** Lines that are kept; the oldest are forgotten. */
export const KEPT_LINES = 500;

/** Characters of a line; a whole message of a server has fewer. */
const MAX_LINE = 1000;

/** Levels, the least one first. */
export const LOG_LEVELS = /** @type {const} */ (["debug", "info", "warning", "error"]);

/** The lines of the log, oldest first. */
export class LogStore {
  constructor() {
    /** @type {LogLine[]} */
    this.lines = [];
    this.made = 0;
    /** Called after each change. */
    this.onChange = () => undefined;
  }

  /**
   * Add a line; an equal one after another is counted.
   * @param {LogLevel} level
   * @param {string} source
   * @param {string} text
   * @param {number} time - [s] since 1970
   * @param {number} [count] - so many equal ones
   */
  add(level, source, text, time, count = 1) {
    const line = { level, source: cutText(String(source), 200), text: cutText(String(text), MAX_LINE), time, count };
    const last = this.lines.at(-1);
    if (last && last.level === level && last.source === line.source && last.text === line.text) {
      last.count += count;
      last.time = time;
    } else {
      this.made += 1;
      this.lines.push({ number: this.made, ...line });
      if (this.lines.length > 2 * KEPT_LINES) {
        this.lines.splice(0, this.lines.length - KEPT_LINES); // seldom, so that a flood does not copy the list each time
      }
    }
    this.onChange();
  }

  clear() {
    this.lines = [];
    this.onChange();
  }

  /**
   * Return the latest lines of a level or a higher one that have all words, newest first.
   * @param {LogLevel} level
   * @param {string} search
   * @param {number} limit
   */
  find(level, search, limit) {
    const least = LOG_LEVELS.indexOf(level);
    const words = search.toLowerCase().split(/\s+/).filter(Boolean);
    const found = [];
    for (let index = this.lines.length - 1; index >= Math.max(0, this.lines.length - KEPT_LINES) && found.length < limit; index -= 1) {
      const line = /** @type {LogLine} */ (this.lines[index]);
      const text = `${line.source} ${line.text}`.toLowerCase();
      if (LOG_LEVELS.indexOf(line.level) >= least && words.every((word) => text.includes(word))) {
        found.push(line);
      }
    }
    return found;
  }
}

/**
 * Return the level of a line of `/rosout`, of either ROS generation.
 * @param {number} level - 1, 2, 4, 8, 16 (ROS 1) or 10, 20, 30, 40, 50 (ROS 2)
 * @param {boolean} isRos2
 * @returns {LogLevel}
 */
export function rosoutLevel(level, isRos2) {
  const [info, warning, error] = isRos2 ? [20, 30, 40] : [2, 4, 8];
  if (level >= error) {
    return "error";
  }
  if (level >= warning) {
    return "warning";
  }
  return level >= info ? "info" : "debug";
}

/** Refusals of `/sim/refusals`, which come again with each message: only the new ones are lines. */
export class RefusalReader {
  /** @param {LogStore} store */
  constructor(store) {
    this.store = store;
    /** Count of each refusal of the last message. @type {Map<string, number>} */
    this.counts = new Map();
  }

  /** @param {any} message */
  take(message) {
    /** @type {Map<string, number>} */
    const counts = new Map();
    for (const refusal of message.refusals) {
      const { client, reason, op, subject, text } = refusal;
      const key = JSON.stringify([client, reason, op, subject, text]);
      const count = Number(refusal.count);
      const known = this.counts.get(key) ?? 0;
      const added = (counts.get(key) ?? 0) + count;
      counts.set(key, added);
      if (added > known) {
        const time = stampSeconds(refusal.stamp);
        this.store.add("warning", client, `${[op, subject].filter(Boolean).join(" ")}: ${text} (${reason})`, time, Math.min(count, added - known));
      }
    }
    this.counts = counts;
  }
}
