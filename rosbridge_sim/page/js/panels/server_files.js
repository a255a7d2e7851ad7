// The scenarios and recordings of the server, read once for all panels.

import { Takers } from "../wire/takers.js";

/** @typedef {import("../wire/connection.js").Connection} Connection */

/**
 * @typedef {{
 *   name: string, map: string, num_egos: number, num_vehicles: number, num_pedestrians: number, num_obstacles: number,
 *   is_loaded: boolean, problem: string,
 * }} ScenarioInfo
 */

/** @typedef {{name: string, size: number}} RecordingInfo */

/** So many scenarios and recordings are listed; a longer list needs the field for the name. */
const MOST_LISTED = 200;
/** A page of the server's list. */
const PAGE_SIZE = 50;
/** The server reads the files of a page in the background; a large map takes seconds [ms]. */
const LIST_TIMEOUT = 60_000;

export class ServerFiles {
  changes = new Takers();
  onChange = this.changes.addNow;

  /** @param {Connection} connection */
  constructor(connection) {
    this.connection = connection;
    /** @type {ScenarioInfo[]} */
    this.scenarios = [];
    /** @type {RecordingInfo[]} */
    this.recordings = [];
    /** Why there is no list; empty if there is. */
    this.problem = "";
    connection.onState((state) => {
      if (state === "open") {
        void this.refresh();
      }
    });
  }

  /** Read the lists. A failure is kept as `problem`. */
  async refresh() {
    /** @type {ScenarioInfo[]} */
    const scenarios = [];
    /** @type {RecordingInfo[]} */
    const recordings = [];
    this.problem = "";
    try {
      for (let first = 0; first < MOST_LISTED; first += PAGE_SIZE) {
        const request = { first, count: PAGE_SIZE };
        const answer = await this.connection.call("/sim/scenarios", request, { timeoutMs: LIST_TIMEOUT });
        if (!answer.result) {
          throw new Error(answer.message);
        }
        scenarios.push(...answer.scenarios);
        recordings.push(...answer.recordings);
        if (first + PAGE_SIZE >= Math.max(answer.num_scenarios, answer.num_recordings)) {
          break;
        }
      }
    } catch (error) {
      this.problem = error instanceof Error ? error.message : String(error);
    }
    this.scenarios = scenarios;
    this.recordings = recordings;
    this.changes.tell();
  }
}
