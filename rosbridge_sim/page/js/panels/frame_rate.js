// The rate of frames as this page measures it: frames of the world against the clock of the browser.

/** Window of the measurement [ms]: the figure is steady, and follows a change within two seconds. */
const RATE_WINDOW = 2000;
/** Shortest window [ms]: less would measure single messages. Without a message for so long, the clock alone counts. */
const SHORTEST_WINDOW = 500;

export class FrameRate {
  /** @type {{at: number, frame: number}[]} the oldest first */
  samples = [];

  /** @param {number} at when the message came [ms] @param {number} frame */
  add(at, frame) {
    const last = this.samples.at(-1);
    if (last && frame < last.frame) {
      this.samples = []; // a reset, or an older snapshot
    }
    this.samples.push({ at, frame });
    while (this.samples.length > 2 && /** @type {{at: number}} */ (this.samples[1]).at < at - RATE_WINDOW) {
      this.samples.shift();
    }
  }

  /** @param {number} now [ms] @returns {number | null} frames in a second; 0: the world stands; null: it is not known yet */
  at(now) {
    const last = this.samples.at(-1);
    if (!last) {
      return null;
    }
    const until = now - last.at > SHORTEST_WINDOW ? now : last.at;
    const first = this.samples.filter(({ at }) => at <= until - RATE_WINDOW).at(-1) ?? /** @type {typeof last} */ (this.samples[0]);
    const span = until - first.at;
    return span < SHORTEST_WINDOW ? null : ((last.frame - first.frame) * 1000) / span;
  }
}
