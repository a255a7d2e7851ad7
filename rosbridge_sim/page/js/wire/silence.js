/** The watch for a server that no longer answers though the socket is open: a stopped process, a lost network. */

/** Time without a frame after which the server is asked for one [ms]. An idle server sends nothing by itself. */
const ASK_AFTER = 2000;
/** Time that the answer may take [ms]; longer than the longest step of a busy server. */
const ANSWER_WITHIN = 3000;

const CHECK_INTERVAL = 500;

/** Finds out that a server is silent. */
export class SilenceWatch {
  isSilent = false;

  /**
   * @param {() => void} ask - sends a request that each server answers
   * @param {(isSilent: boolean) => void} tell - takes each change
   */
  constructor(ask, tell) {
    this.ask = ask;
    this.tell = tell;
    this.heardAt = 0;
    /** Time of the question that has no answer yet. @type {number | null} */
    this.askedAt = null;
    /** @type {ReturnType<typeof setInterval> | undefined} */
    this.timer = undefined;
  }

  /** Begin with a new socket. */
  start() {
    this.stop();
    this.heardAt = performance.now();
    this.timer = setInterval(() => this.check(), CHECK_INTERVAL);
  }

  /** End with the socket. */
  stop() {
    clearInterval(this.timer);
    this.askedAt = null;
    this.set(false);
  }

  /** A frame has come. */
  hear() {
    this.heardAt = performance.now();
    this.askedAt = null;
    this.set(false);
  }

  check() {
    const now = performance.now();
    if (this.askedAt === null) {
      if (now - this.heardAt >= ASK_AFTER) {
        this.askedAt = now; // the wait counts from here, since a page that slept has heard nothing for long
        this.ask();
      }
    } else if (now - this.askedAt >= ANSWER_WITHIN) {
      this.set(true);
    }
  }

  /** @param {boolean} isSilent */
  set(isSilent) {
    if (isSilent !== this.isSilent) {
      this.isSilent = isSilent;
      this.tell(isSilent);
    }
  }
}
