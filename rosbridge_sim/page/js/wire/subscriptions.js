/** The takers of one topic, and the one subscription on the wire that serves them all. */

/**
 * @typedef {object} SubscribeOptions
 * @property {number} throttleMs - shortest time between two messages [ms]; the last one of a burst comes at its end
 * @property {number} queueLength - messages that may wait on the server
 * @property {"json" | "cbor"} encoding - form on the wire
 */

/** A function that takes messages, at its own pace. */
export class Taker {
  /** @param {(message: any) => void} take @param {SubscribeOptions} options */
  constructor(take, options) {
    this.take = take;
    this.options = options;
    this.readyAt = -Infinity;
    /** @type {any} */
    this.timer = undefined;
    /** @type {any} */
    this.waiting = undefined;
  }

  /**
   * Take a message now, or when its time has come; then only the last one.
   * @param {any} message @param {boolean} isPaced - the wire brings messages faster than this taker wants them
   */
  offer(message, isPaced) {
    const now = performance.now();
    if (!isPaced || now >= this.readyAt) {
      this.rest();
      this.readyAt = now + this.options.throttleMs;
      this.give(message);
      return;
    }
    this.waiting = message;
    this.timer ??= setTimeout(() => {
      const last = this.waiting;
      this.rest();
      this.readyAt = performance.now() + this.options.throttleMs;
      this.give(last);
    }, this.readyAt - now);
  }

  /** Drop what waits. */
  rest() {
    clearTimeout(this.timer);
    this.timer = this.waiting = undefined;
  }

  /** @param {any} message */
  give(message) {
    try {
      this.take(message);
    } catch (error) {
      // The mistake of one taker takes nothing from the others; the browser reports it.
      queueMicrotask(() => {
        throw error;
      });
    }
  }
}

/** All takers of one topic. */
export class TopicSubscription {
  /** @param {string} topic @param {string} type - message type; empty takes the topic's own */
  constructor(topic, type) {
    this.topic = topic;
    this.type = type;
    /** @type {Set<Taker>} */
    this.takers = new Set();
    /** The options on the wire as text; empty while there is no subscription on the wire. */
    this.sent = "";
    /** The last message in a list of its own, so that any value can be one. @type {any[]} */
    this.last = [];
    /** Bytes of all messages so far, as they are on the wire. */
    this.bytes = 0;
  }

  get isEmpty() {
    return this.takers.size === 0;
  }

  /**
   * Add a taker; it gets the last message soon, after the call.
   * @param {(message: any) => void} take @param {Partial<SubscribeOptions>} options @returns {Taker}
   */
  add(take, options) {
    const taker = new Taker(take, { throttleMs: 0, queueLength: 1, encoding: "json", ...options });
    this.takers.add(taker);
    if (this.last.length > 0) {
      const [message] = this.last;
      queueMicrotask(() => {
        if (this.takers.has(taker)) {
          taker.offer(message, false);
        }
      });
    }
    return taker;
  }

  /** Remove a taker. @param {Taker} taker @returns {boolean} false if it was removed before */
  remove(taker) {
    taker.rest();
    return this.takers.delete(taker);
  }

  /** @param {any} message @param {number} bytes - of its frame */
  deliver(message, bytes) {
    this.bytes += bytes;
    this.last = [message];
    const { throttleMs } = this.merged();
    for (const taker of [...this.takers]) {
      taker.offer(message, taker.options.throttleMs > throttleMs);
    }
  }

  /** Forget what was on the wire, because the connection has ended or the page is hidden. */
  forget() {
    this.sent = "";
    this.last = [];
    for (const taker of this.takers) {
      taker.rest();
    }
  }

  /** Options that serve all takers. @returns {SubscribeOptions} */
  merged() {
    const all = [...this.takers].map((taker) => taker.options);
    return {
      throttleMs: Math.min(...all.map((options) => options.throttleMs)),
      queueLength: Math.max(...all.map((options) => options.queueLength)),
      encoding: all.some((options) => options.encoding === "cbor") ? "cbor" : "json",
    };
  }

  /** Tell whether the wire needs a subscribe op; it is sent then. */
  isChanged() {
    const wanted = JSON.stringify(this.subscribeOp());
    const isNew = wanted !== this.sent;
    this.sent = wanted;
    return isNew;
  }

  /** The op; a second one with the same id replaces the options of the first. */
  subscribeOp() {
    const { throttleMs, queueLength, encoding } = this.merged();
    return {
      op: "subscribe",
      id: `page:sub:${this.topic}`,
      topic: this.topic,
      ...(this.type === "" ? {} : { type: this.type }),
      throttle_rate: throttleMs,
      queue_length: queueLength,
      ...(encoding === "cbor" ? { compression: "cbor" } : {}),
    };
  }

  unsubscribeOp() {
    return { op: "unsubscribe", id: `page:sub:${this.topic}`, topic: this.topic };
  }
}
