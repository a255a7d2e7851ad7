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
   * @param {LogLevel} level @param {string} source @param {string} text @param {number} time - [s] since 1970
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

  /** Remove lines. @param {(line: LogLine) => boolean} which */
  remove(which) {
    this.lines = this.lines.filter((line) => !which(line));
    this.onChange();
  }

  clear() {
    this.lines = [];
    this.onChange();
  }

  /**
   * Return the latest lines of a level or a higher one that have all words, newest first.
   * @param {LogLevel} level @param {string} search @param {number} limit
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
 * @param {number} level - 1, 2, 4, 8, 16 (ROS 1) or 10, 20, 30, 40, 50 (ROS 2) @param {boolean} isRos2 @returns {LogLevel}
 */
export function rosoutLevel(level, isRos2) {
  const [info, warning, error] = isRos2 ? [20, 30, 40] : [2, 4, 8];
  return level >= error ? "error" : level >= warning ? "warning" : level >= info ? "info" : "debug";
}

/** A line of the server's log about refused requests, which `/sim/refusals` tells, too. */
const REFUSED = /^\S+: (refused: |[\d,]+ more refused \()/;
/** Name of the logger that writes them. */
const SERVER = "/rosbridge_sim/server";
/** Time within which a status and a refusal with the same text are of one mistake [s]. */
const SAME_MISTAKE = 10;

/**
 * Reader of all that tells of mistakes, so that each stands once in the log: refusals of `/sim/refusals`, which come again
 * with each message; lines of the server's log about them; and the statuses of this page's own mistakes.
 */
export class RefusalReader {
  /** @param {LogStore} store @param {string} [statusSource] - source of lines about statuses */
  constructor(store, statusSource = "") {
    this.store = store;
    this.statusSource = statusSource;
    /** `/sim/refusals` has come at least once. */
    this.isHere = false;
    /** Texts of the latest refusals, with their times [s]. @type {Map<string, number>} */
    this.latest = new Map();
    /** Count of each refusal of the last message. @type {Map<string, number>} */
    this.counts = new Map();
    /** Called for each refusal that is not one of before again. @type {(text: string) => void} */
    this.onNew = () => undefined;
  }

  /** Begin anew with another connection, whose server counts anew. */
  forget() {
    this.counts = new Map();
  }

  /**
   * Take a line of `/rosout`.
   * @param {LogLevel} level @param {string} source @param {string} text @param {number} time - [s] since 1970
   */
  takeLine(level, source, text, time) {
    if (!this.isHere || !isAboutRefusal(source, text)) {
      this.store.add(level, source, text, time);
    }
  }

  /** Take a status of the server. @param {LogLevel} level @param {string} text @param {number} time - [s] since 1970 */
  takeStatus(level, text, time) {
    const isKnown = [...this.latest].some(([told, at]) => time - at < SAME_MISTAKE && isSameText(text, told));
    if (!isKnown) {
      this.store.add(level, this.statusSource, text, time);
    }
  }

  /** @param {any} message */
  take(message) {
    if (!this.isHere) {
      this.isHere = true;
      this.store.remove((line) => isAboutRefusal(line.source, line.text));
    }
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
        this.store.remove((line) => line.source === this.statusSource && isSameText(line.text, text));
        this.latest.delete(text);
        this.latest.set(text, time);
        const told = `${[op, subject].filter(Boolean).join(" ")}: ${text} (${reason})`;
        this.store.add("warning", client, told, time, Math.min(count, added - known));
        if (known === 0) {
          this.onNew(`${client}: ${told}`);
        }
      }
    }
    this.counts = counts;
    for (const text of [...this.latest.keys()].slice(0, -KEPT_REFUSALS)) {
      this.latest.delete(text);
    }
  }
}

/** Texts of refusals that are kept. */
const KEPT_REFUSALS = 50;

/** Return whether a line of the server's log tells what `/sim/refusals` tells. @param {string} source @param {string} text */
function isAboutRefusal(source, text) {
  return source === SERVER && REFUSED.test(text);
}

/**
 * Return whether a refusal has the text of a status; a long one is cut in its middle.
 * @param {string} text @param {string} told
 */
function isSameText(text, told) {
  const cut = told.indexOf(" ... ");
  return text === told || (cut > 0 && text.startsWith(told.slice(0, cut)) && text.endsWith(told.slice(cut + 5)));
}
