/**
 * The socket to the server, which comes back by itself, and all that the page has on it: subscriptions,
 * advertisements and calls.
 *
 * A server merges the subscriptions of one client to one topic, so the page has one subscription for each topic on the
 * wire, with the options that serve all takers.
 */

import { TEXTS } from "../texts.js";
import { decodeCbor } from "./cbor.js";
import { SilenceWatch } from "./silence.js";
import { TopicSubscription } from "./subscriptions.js";
import { Takers } from "./takers.js";

/** @typedef {"connecting" | "token" | "open" | "lost"} ConnectionState */
/** @typedef {import("./subscriptions.js").SubscribeOptions} SubscribeOptions */
/** @typedef {{level: string, msg: string, id?: any}} StatusMessage */
/** @typedef {{service: string, resolve: (values: any) => void, reject: (error: CallError) => void, timer: any}} PendingCall */

/** Waits before a new attempt to connect [ms]: soon after the first loss, later not more often than a person notices. */
const FIRST_WAIT = 500;
const LONGEST_WAIT = 5000;
/** Place of the token in the tab's storage, which no other tab reads and which ends with the tab. */
const TOKEN_KEY = "rosbridge-sim token";
/** Ids of the ops that find out whether the server needs a token, and whether it still answers. */
const AUTH_ID = "page:auth";
const PROBE_ID = "page:probe";
/** A service that each server has and no pattern closes. */
const PROBE_SERVICE = "/rosapi/get_time";

/**
 * Return the URL of the socket beside a page: the directory of the page, by ws or wss.
 * @param {{href: string}} location - the place of the page @returns {string}
 */
export function socketUrl(location) {
  const url = new URL(".", location.href);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  url.search = url.hash = "";
  return url.href;
}

/** A service call that failed; its message is the server's text. */
export class CallError extends Error {
  name = "CallError";

  /** @param {string} message - reason, for people @param {string} service - the called service */
  constructor(message, service) {
    super(message);
    this.service = service;
  }
}

/** A connection to a rosbridge server. */
export class Connection {
  /** @type {Takers<[ConnectionState, string]>} */
  states = new Takers();
  /** @type {Takers<[StatusMessage]>} */
  statuses = new Takers();
  /** Be told of each status message of the server. */
  onStatus = this.statuses.add;
  /** @type {Takers<[boolean]>} */
  silences = new Takers();
  /** Be told when the server no longer answers on an open socket, and when it does again. */
  onSilence = this.silences.add;
  /** @type {ConnectionState} */
  state = "connecting";
  /** Reason of the state, for people; often empty. */
  reason = "";

  /** @param {string} url - URL of the socket */
  constructor(url) {
    this.url = url;
    /** @type {WebSocket | null} */
    this.socket = null;
    this.isStarted = false;
    this.isHidden = false;
    this.wait = FIRST_WAIT;
    /** @type {any} */
    this.timer = undefined;
    this.numCalls = 0;
    this.silence = new SilenceWatch(() => this.probe(), this.silences.tell);
    /** @type {Map<string, TopicSubscription>} */
    this.topics = new Map();
    /** Topics that are advertised on the present socket, with their types. @type {Map<string, string>} */
    this.advertised = new Map();
    /** @type {Map<string, PendingCall>} */
    this.calls = new Map();
  }

  /** Connect, and keep connected until `stop`. */
  start() {
    if (!this.isStarted) {
      this.isStarted = true;
      this.connect();
    }
  }

  /** Close the socket, and do not connect again. */
  stop() {
    this.isStarted = false;
    clearTimeout(this.timer);
    this.drop();
    this.setState("lost", "");
  }

  /**
   * Be told of the state: at once, and with each change.
   * @param {(state: ConnectionState, reason: string) => void} take @returns {() => void} ends it
   */
  onState(take) {
    take(this.state, this.reason);
    return this.states.add(take);
  }

  /** True if the page has the present state: the server is connected and answers. */
  get isLive() {
    return this.state === "open" && !this.silence.isSilent;
  }

  /** True if the page has sent a token to the server. */
  get hasToken() {
    return sessionStorage.getItem(TOKEN_KEY) !== null;
  }

  /** Connect with a token, which this tab keeps until it is closed. @param {string} token */
  authenticate(token) {
    sessionStorage.setItem(TOKEN_KEY, token);
    if (this.isStarted) {
      this.connect();
    }
  }

  /**
   * Take the messages of a topic, now and after each reconnect. The last message, if one is there, comes at once. With
   * `encoding: "cbor"` by any taker of the topic, numeric arrays come as typed arrays and `uint8[]` as Uint8Array; otherwise
   * they are lists and base64 text.
   * @param {string} topic @param {string} type - message type; empty takes the topic's own @param {(message: any) => void} take
   * @param {Partial<SubscribeOptions>} [options] @returns {{close: () => void}}
   */
  subscribe(topic, type, take, options = {}) {
    let subscription = this.topics.get(topic);
    if (subscription === undefined) {
      subscription = new TopicSubscription(topic, type);
      this.topics.set(topic, subscription);
    }
    const taker = subscription.add(take, options);
    this.sendSubscription(subscription);
    return { close: () => this.endTaker(topic, taker) };
  }

  /**
   * Publish a message, if the page is connected.
   * @param {string} topic @param {string} type - message type @param {object} message
   * @returns {boolean} false if the page is not connected; the message is dropped then
   */
  publish(topic, type, message) {
    if (this.state !== "open") {
      return false;
    }
    if (this.advertised.get(topic) !== type) {
      this.unadvertise(topic);
      this.send({ op: "advertise", id: `page:pub:${topic}`, topic, type });
      this.advertised.set(topic, type);
    }
    this.send({ op: "publish", topic, msg: message });
    return true;
  }

  /** No longer be a publisher of a topic. @param {string} topic */
  unadvertise(topic) {
    if (this.advertised.delete(topic)) {
      this.send({ op: "unadvertise", id: `page:pub:${topic}`, topic });
    }
  }

  /**
   * Call a service.
   * @param {string} service @param {object} [request]
   * @param {{timeoutMs?: number}} [options] - longest wait for the answer; 0 is for ever
   * @returns {Promise<any>} the values of the answer
   * @throws {CallError} the call was refused or failed, no answer came in time, or the connection was lost
   */
  call(service, request = {}, { timeoutMs = 5000 } = {}) {
    return new Promise((resolve, reject) => {
      if (this.state !== "open") {
        reject(new CallError(TEXTS.connection.notConnected, service));
        return;
      }
      const id = `page:call:${++this.numCalls}`;
      const giveUp = () => {
        this.calls.delete(id);
        reject(new CallError(TEXTS.connection.noAnswer(service, timeoutMs / 1000), service));
      };
      const timer = timeoutMs > 0 ? setTimeout(giveUp, timeoutMs) : undefined;
      this.calls.set(id, { service, resolve, reject, timer });
      this.send({ op: "call_service", id, service, args: request });
    });
  }

  /**
   * Say whether the page is seen. A hidden page has no subscriptions, so that it costs the server nothing.
   * @param {boolean} isHidden
   */
  setHidden(isHidden) {
    if (isHidden === this.isHidden) {
      return;
    }
    this.isHidden = isHidden;
    for (const subscription of this.topics.values()) {
      subscription.forget();
      if (isHidden) {
        this.sendUnsubscribe(subscription);
      } else {
        this.sendSubscription(subscription);
      }
    }
  }

  // The socket

  connect() {
    clearTimeout(this.timer);
    this.drop();
    this.setState("connecting", "");
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    let wasOpen = false;
    socket.onopen = () => {
      wasOpen = true;
      this.greet();
    };
    socket.onmessage = (event) => this.receive(event.data);
    socket.onclose = (event) => this.lose(event.reason || (wasOpen ? "" : TEXTS.connection.refusedUnread));
  }

  /** Show the token if there is one, and ask for something that a client without it does not get. */
  greet() {
    const token = sessionStorage.getItem(TOKEN_KEY);
    if (token !== null) {
      this.send({ op: "auth", id: AUTH_ID, token });
    }
    this.probe();
  }

  probe() {
    this.send({ op: "call_service", id: PROBE_ID, service: PROBE_SERVICE, args: {} });
  }

  /** @param {string} reason */
  lose(reason) {
    this.drop();
    this.setState("lost", reason);
    this.timer = setTimeout(() => this.connect(), this.wait);
    this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
  }

  /** Forget the socket and what was under way on it. */
  drop() {
    const socket = this.socket;
    this.socket = null;
    if (socket !== null) {
      socket.onopen = socket.onmessage = socket.onclose = null;
      socket.close();
    }
    this.silence.stop();
    this.advertised.clear();
    for (const subscription of this.topics.values()) {
      subscription.forget();
    }
    const calls = [...this.calls.values()];
    this.calls.clear();
    for (const call of calls) {
      clearTimeout(call.timer);
      call.reject(new CallError(TEXTS.connection.lostMeanwhile, call.service));
    }
  }

  /** Wait for a token without a connection, because the server closes one that does not show it soon. @param {string} reason */
  wantToken(reason) {
    sessionStorage.removeItem(TOKEN_KEY);
    this.drop();
    this.setState("token", reason);
  }

  /** @param {ConnectionState} state @param {string} reason */
  setState(state, reason) {
    if (state === this.state && reason === this.reason) {
      return;
    }
    this.state = state;
    this.reason = reason;
    if (state === "open") {
      this.wait = FIRST_WAIT;
      this.silence.start();
      for (const subscription of this.topics.values()) {
        this.sendSubscription(subscription);
      }
    }
    this.states.tell(state, reason);
  }

  /** @param {object} op */
  send(op) {
    if (this.socket !== null && this.socket.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify(op));
    }
  }

  // Frames from the server

  /** @param {string | ArrayBuffer} data */
  receive(data) {
    this.silence.hear();
    const frame = typeof data === "string" ? JSON.parse(data) : decodeCbor(data);
    switch (frame.op) {
      case "publish":
        this.topics.get(frame.topic)?.deliver(frame.msg, typeof data === "string" ? data.length : data.byteLength);
        break;
      case "service_response":
        this.takeAnswer(frame);
        break;
      case "status":
        this.takeStatus(frame);
        break;
    }
  }

  /** @param {{id?: any, result: boolean, values: any}} frame */
  takeAnswer(frame) {
    if (frame.id === PROBE_ID && this.state === "connecting") {
      if (frame.result) {
        this.setState("open", "");
      } else {
        this.wantToken("");
      }
      return;
    }
    const call = this.calls.get(frame.id);
    if (call === undefined) {
      return; // it came too late
    }
    this.calls.delete(frame.id);
    clearTimeout(call.timer);
    if (frame.result) {
      call.resolve(frame.values);
    } else {
      const text = typeof frame.values === "string" ? frame.values : TEXTS.connection.refused(call.service);
      call.reject(new CallError(text, call.service));
    }
  }

  /** @param {StatusMessage} frame */
  takeStatus(frame) {
    if (frame.id === AUTH_ID && this.state === "connecting") {
      this.wantToken(TEXTS.token.wrong);
      return;
    }
    this.statuses.tell(frame);
  }

  // Subscriptions on the wire

  /** @param {TopicSubscription} subscription */
  sendSubscription(subscription) {
    if (this.state === "open" && !this.isHidden && subscription.isChanged()) {
      this.send(subscription.subscribeOp());
    }
  }

  /** @param {TopicSubscription} subscription */
  sendUnsubscribe(subscription) {
    if (this.state === "open") {
      this.send(subscription.unsubscribeOp());
    }
  }

  /** @param {string} topic @param {import("./subscriptions.js").Taker} taker */
  endTaker(topic, taker) {
    const subscription = this.topics.get(topic);
    if (subscription === undefined || !subscription.remove(taker)) {
      return;
    }
    if (subscription.isEmpty) {
      this.topics.delete(topic);
      if (!this.isHidden) {
        this.sendUnsubscribe(subscription);
      }
    } else {
      this.sendSubscription(subscription);
    }
  }
}
