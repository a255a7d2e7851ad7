// The actions of the page: done by the connection, and remembered for "Copy as code".

import { callOperation, publishOperation } from "../wire/requests.js";
import { Takers } from "../wire/takers.js";

/** @typedef {import("../wire/requests.js").Operation} Operation */
/** @typedef {import("../wire/connection.js").Connection} Connection */

/**
 * An action of the user.
 * @typedef {{
 *   number: number,
 *   title: string,
 *   operation: Operation,
 *   count: number,
 *   outcome: "waiting" | "done" | "failed",
 *   reason: string,
 * }} Action
 *   count: so many equal ones in a row; reason: the server's text if it failed
 */

/** So many actions are kept; more than a user reads, and a driver with a stick cannot fill the memory. */
const KEPT_ACTIONS = 50;

/** A refusal of the server that came as an answer. */
export class ActionError extends Error {}

export class Actions {
  changes = new Takers();
  onChange = this.changes.add;
  tell = this.changes.tell;

  /** @param {Connection} connection @param {{refused: string}} texts */
  constructor(connection, texts) {
    this.connection = connection;
    this.texts = texts;
    /** @type {Action[]} the latest one first */
    this.recent = [];
    this.made = 0;
    this.lastWarning = "";
    connection.onStatus((/** @type {{level: string, msg: string}} */ status) => {
      if (status.level === "error" || status.level === "warning") {
        this.lastWarning = status.msg;
      }
    });
  }

  /**
   * Call a service.
   * @param {string} title for the user @param {string} service @param {string} type @param {Record<string, unknown>} request
   * @param {{timeoutMs?: number}} [options]
   * @returns {Promise<any>} the answer; rejects with the server's reason, also if the answer has `result: false`
   */
  call(title, service, type, request, options = {}) {
    return this.run(title, callOperation(service, type, request), options);
  }

  /**
   * Publish a message.
   * @param {string} title for the user @param {string} topic @param {string} type @param {Record<string, unknown>} message
   */
  publish(title, topic, type, message) {
    this.send(title, publishOperation(topic, type, message));
  }

  /**
   * Carry out an operation that is a call.
   * @param {string} title for the user @param {Operation} operation @param {{timeoutMs?: number}} [options]
   * @returns {Promise<any>} the answer; rejects with the server's reason, also if the answer has `result: false`
   */
  async run(title, operation, options = {}) {
    const action = this.record(title, operation);
    this.lastWarning = "";
    try {
      const answer = await this.connection.call(operation.name, operation.values, options);
      const refusal = refusalOf(answer);
      if (refusal !== null) {
        throw new ActionError(refusal || this.lastWarning || this.texts.refused);
      }
      this.finish(action, "done", "");
      return answer;
    } catch (error) {
      this.finish(action, "failed", error instanceof Error ? error.message : String(error));
      throw error;
    }
  }

  /** Carry out an operation that is a message. @param {string} title for the user @param {Operation} operation */
  send(title, operation) {
    const last = this.recent[0];
    const isRepeated = last?.title === title && last.operation.name === operation.name;
    this.connection.publish(operation.name, operation.type, operation.values);
    if (isRepeated && last) {
      last.operation = operation; // a driver sends 30 a second: one entry, with the latest values
      last.count += 1;
      this.tell();
    } else {
      this.finish(this.record(title, operation), "done", "");
    }
  }

  /**
   * Add an action to the list, for a caller that carries it out by itself.
   * @param {string} title @param {Operation} operation @returns {Action}
   */
  record(title, operation) {
    this.made += 1;
    /** @type {Action} */
    const action = { number: this.made, title, operation, count: 1, outcome: "waiting", reason: "" };
    this.recent = [action, ...this.recent.slice(0, KEPT_ACTIONS - 1)];
    this.tell();
    return action;
  }

  /** @param {Action} action @param {"done" | "failed"} outcome @param {string} reason */
  finish(action, outcome, reason) {
    action.outcome = outcome;
    action.reason = reason;
    this.tell();
  }

}

/**
 * The reason of a refusal in an answer: empty if the answer has none, null if it is no refusal.
 * @param {any} answer @returns {string | null}
 */
export function refusalOf(answer) {
  const inner = answer?.response ?? answer;
  const isRefused = inner?.result === false || inner?.tick_status === false;
  return isRefused ? String(inner.message ?? "") : null;
}
