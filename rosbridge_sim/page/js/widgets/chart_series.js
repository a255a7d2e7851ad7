// Values over simulated time, for the strip charts: a ring of samples that forgets what is older than its span.

/** Samples at most in one series: a minute at 50 a second. */
const MAX_SAMPLES = 3000;

export class ChartSeries {
  /** @param {number} spanS longest time that is kept [s] */
  constructor(spanS) {
    this.spanS = spanS;
    this.times = new Float64Array(MAX_SAMPLES);
    this.values = new Float64Array(MAX_SAMPLES);
    this.first = 0;
    this.length = 0;
  }

  clear() {
    this.first = 0;
    this.length = 0;
  }

  /** Time of the latest sample [s]; 0 without samples. */
  get lastTime() {
    return this.length ? this.timeAt(this.length - 1) : 0;
  }

  /** @param {number} index from the oldest sample, from 0 */
  timeAt(index) {
    return /** @type {number} */ (this.times[(this.first + index) % MAX_SAMPLES]);
  }

  /** @param {number} index from the oldest sample, from 0 */
  valueAt(index) {
    return /** @type {number} */ (this.values[(this.first + index) % MAX_SAMPLES]);
  }

  /**
   * Add a sample. If time has gone back (a reset, a snapshot), what is later than the sample is forgotten.
   * @param {number} time simulated [s] @param {number} value not finite: a gap
   */
  push(time, value) {
    while (this.length && this.timeAt(this.length - 1) >= time) {
      this.length -= 1;
    }
    if (this.length === MAX_SAMPLES) {
      this.dropFirst();
    }
    const slot = (this.first + this.length) % MAX_SAMPLES;
    this.times[slot] = time;
    this.values[slot] = value;
    this.length += 1;
    while (this.timeAt(0) < time - this.spanS) {
      this.dropFirst();
    }
  }

  dropFirst() {
    this.first = (this.first + 1) % MAX_SAMPLES;
    this.length -= 1;
  }

  /** Index of the sample nearest to a time; -1 without samples. @param {number} time simulated [s] */
  nearest(time) {
    let low = 0;
    let high = this.length - 1;
    if (high < 0) {
      return -1;
    }
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.timeAt(middle) <= time) {
        low = middle;
      } else {
        high = middle;
      }
    }
    return Math.abs(this.timeAt(low) - time) <= Math.abs(this.timeAt(high) - time) ? low : high;
  }

  /** Least and greatest finite value. @returns {[number, number]} [0, 0] without samples */
  range() {
    let least = Infinity;
    let most = -Infinity;
    for (let index = 0; index < this.length; index += 1) {
      const value = this.valueAt(index);
      if (Number.isFinite(value)) {
        least = Math.min(least, value);
        most = Math.max(most, value);
      }
    }
    return least <= most ? [least, most] : [0, 0];
  }

  /** A copy that later samples do not change, for a chart that is held. */
  copy() {
    const twin = new ChartSeries(this.spanS);
    twin.times.set(this.times);
    twin.values.set(this.values);
    twin.first = this.first;
    twin.length = this.length;
    return twin;
  }
}

/**
 * A range of values with a round end at each side, which contains 0 and is never narrower than the smallest one.
 * @param {[number, number]} range @param {[number, number]} smallest that a chart shows, so that noise does not fill it
 * @returns {[number, number]}
 */
export function roundRange([least, most], [smallLeast, smallMost]) {
  return [0 - roundUp(Math.max(-least, -smallLeast, 0)), roundUp(Math.max(most, smallMost, 0))];
}

/** @param {number} value not negative; the next of 1, 2, 5, 10, 20, ... */
function roundUp(value) {
  if (value <= 0) {
    return 0;
  }
  const power = 10 ** Math.floor(Math.log10(value));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= value * (1 - 1e-9)) ?? 10;
  return step * power;
}
/** Series as comma-separated values: a line for each time. @param {{label: string, series: ChartSeries}[]} columns */
export function csvOf(columns) {
  /** @type {Map<number, string[]>} */
  const rows = new Map();
  columns.forEach(({ series }, column) => {
    for (let index = 0; index < series.length; index += 1) {
      const row = rows.get(series.timeAt(index)) ?? new Array(columns.length).fill("");
      rows.set(series.timeAt(index), row);
      row[column] = Number.isFinite(series.valueAt(index)) ? String(series.valueAt(index)) : "";
    }
  });
  const head = ["time [s]", ...columns.map(({ label }) => label)].map((text) => `"${text.replaceAll('"', '""')}"`);
  const lines = [...rows].sort(([a], [b]) => a - b).map(([time, values]) => [time.toFixed(3), ...values]);
  return [head, ...lines].map((cells) => `${cells.join(",")}\r\n`).join("");
}
