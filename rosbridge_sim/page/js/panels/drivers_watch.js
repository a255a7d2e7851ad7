// Driver of each ego and master of the time, from `/sim/drivers`; and names of clients for the user.

import { Takers } from "../wire/takers.js";

/** @typedef {import("../wire/connection.js").Connection} Connection */
/** @typedef {{unique_id: number, ctrl_mode: number, gear: number, driver: string, client: string, publishers: string[]}} EgoDriver */
/** @typedef {{time_step: number, real_time_factor: number, master: string, master_clients: string[], barrier_members: string[], egos: EgoDriver[]}} DriversMessage */
/** @typedef {typeof import("../texts.js").TEXTS.clientNames} NameTexts */

/** Ids of pages as clients of synchronous mode; see `makeUserId`. */
const PAGE_ID = /^page-[0-9a-z]+$/;

/**
 * The name of a client, the same wherever the page names it: its address, with its id while it is the master.
 * @param {string} address @param {string} ownAddress of this page; empty: not known yet
 * @param {Pick<DriversMessage, "master" | "master_clients" | "barrier_members"> | null} message @param {NameTexts} texts
 */
export function nameOfClient(address, ownAddress, message, texts) {
  if (address === ownAddress) {
    return texts.thisPage;
  }
  const isMaster = message !== null && message.barrier_members.length === 0 && message.master_clients.includes(address);
  return isMaster ? nameOfMaster({ ...message, master_clients: [address] }, texts) : texts.client(address);
}

/**
 * The name of a master that is another client.
 * @param {Pick<DriversMessage, "master" | "master_clients" | "barrier_members">} message @param {NameTexts} texts
 */
export function nameOfMaster({ master, master_clients: addresses, barrier_members: members }, texts) {
  const name = PAGE_ID.test(master) ? texts.otherPage : master;
  return members.length ? members.join(", ") : addresses.length ? `${name} (${addresses.join(", ")})` : name;
}

export class DriversWatch {
  changes = new Takers();
  onChange = this.changes.addNow;

  /** @param {Connection} connection @param {string} userId of this page @param {NameTexts} texts */
  constructor(connection, userId, texts) {
    this.userId = userId;
    this.texts = texts;
    /** @type {DriversMessage | null} */
    this.message = null;
    /** Address of this page as the server knows it, from the answer of `/sim/control_lease` or as the master; empty before. */
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
    if (message?.master === this.userId) {
      this.ownAddress = message.master_clients[0] ?? this.ownAddress;
    }
    this.changes.tell();
  }

  /** @param {string} address */
  nameOf(address) {
    return nameOfClient(address, this.ownAddress, this.message, this.texts);
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
