// Who drives each ego, from `/sim/drivers`.

import { Takers } from "../wire/takers.js";

/** @typedef {import("../wire/connection.js").Connection} Connection */
/** @typedef {{unique_id: number, ctrl_mode: number, gear: number, driver: string, client: string, publishers: string[]}} EgoDriver */
/** @typedef {{time_step: number, real_time_factor: number, master: string, master_clients: string[], egos: EgoDriver[]}} DriversMessage */

export class DriversWatch {
  changes = new Takers();
  onChange = this.changes.addNow;

  /** @param {Connection} connection */
  constructor(connection) {
    /** @type {DriversMessage | null} */
    this.message = null;
    /** Address of this page as the server knows it, from the answer of `/sim/control_lease`; empty before. */
    this.ownAddress = "";
    connection.subscribe("/sim/drivers", "rosbridge_sim_msgs/Drivers", (message) => this.take(message));
    connection.onState((state) => {
      if (state !== "open") {
        this.ownAddress = "";
        this.take(null);
      }
    });
  }

  /** @param {DriversMessage | null} message */
  take(message) {
    this.message = message;
    this.changes.tell();
  }

  /** @param {number} number of the ego @returns {EgoDriver | null} */
  ofEgo(number) {
    return this.message?.egos.find((ego) => ego.unique_id === number) ?? null;
  }

  /** Addresses of the other clients that publish the command of an ego. @param {number} number of the ego @returns {string[]} */
  otherPublishers(number) {
    const publishers = this.ofEgo(number)?.publishers ?? [];
    return publishers.filter((address) => address !== this.ownAddress);
  }
}
