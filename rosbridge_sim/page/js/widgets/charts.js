// Charts: values of the last two minutes, one under the other over the same time, with one cursor for all.

import { ChartSeries, csvOf, roundRange } from "./chart_series.js";
import { element, replaceChildren, saveFile, setText } from "./dom.js";

/**
 * @typedef {{key: string, label: string, unit?: string, digits?: number, smallest?: [number, number]}} ChartSpec
 *   smallest: range of values that is always shown; without one the range is that of the values
 */

/** @typedef {typeof import("../texts.js").TEXTS.charts} ChartTexts */

/** Time that a chart shows [s]. */
export const CHART_SPAN = 120;
/** Charts at one time; more do not fit on a screen. */
export const MOST_CHARTS = 6;
/** Shortest time between two drawings: a chart moves less than a pixel in it [ms]. */
const DRAW_INTERVAL = 100;
/** A key moves the cursor so far [s]; with Shift ten times as far. */
const CURSOR_STEP = 0.5;
/** Height of a chart [CSS pixels]. */
const CHART_HEIGHT = 60;

export class Charts {
  /** @param {ChartTexts} texts @param {ChartSpec[]} [specs] of charts that stay; without them the user adds and removes charts */
  constructor(texts, specs = []) {
    this.texts = texts;
    this.areFixed = specs.length > 0;
    /** @type {Map<string, Chart>} */
    this.charts = new Map();
    /** Called when a chart was added or removed. */
    this.onChange = () => undefined;
    /** Time before the latest sample [s]. @type {number | null} */
    this.cursor = null;
    /** Time of the cursor while the past is shown [s]. @type {number | null} */
    this.pinned = null;
    this.isHeld = false;
    this.drawnAt = -Infinity;
    this.isWaiting = false;
    this.holdButton = element("button", { type: "button", className: "small", title: texts.holdHint, "aria-pressed": "false", hidden: !this.areFixed }, texts.hold);
    this.holdButton.onclick = () => this.hold(!this.isHeld);
    const save = element("button", { type: "button", className: "small", title: texts.saveHint }, texts.save);
    save.onclick = () => saveFile("charts.csv", new Blob([this.csv()], { type: "text/csv" }));
    this.head = element("div", { className: "strip-head" }, this.holdButton, save);
    this.element = element("div", { className: "strip-charts" }, this.head);
    specs.forEach((spec) => this.add(spec));
    this.showChoices();
    new ResizeObserver(() => this.draw(true)).observe(this.element);
  }

  /** @param {ChartSpec} spec */
  add(spec) {
    const chart = new Chart(spec, this);
    this.charts.set(spec.key, chart);
    this.element.append(chart.element);
  }

  /** Add a chart, or remove it if it is there. @param {string} key @param {string} label @returns {boolean} false if there are too many */
  toggle(key, label) {
    const chart = this.charts.get(key);
    if (!chart && this.charts.size >= MOST_CHARTS) {
      return false;
    }
    if (chart) {
      chart.element.remove();
      this.charts.delete(key);
    } else {
      this.add({ key, label });
    }
    this.showChoices();
    this.onChange();
    return true;
  }

  /** Offer each chart the others as a second signal. */
  showChoices() {
    this.head.hidden = this.charts.size === 0;
    this.charts.forEach((chart) => chart.showChoices());
  }

  /** @param {number} time [s] @param {(key: string) => any} valueOf a value that is no finite number is a gap */
  push(time, valueOf) {
    for (const [key, chart] of this.charts) {
      const value = valueOf(key);
      chart.series.push(time, ["number", "bigint", "boolean"].includes(typeof value) ? Number(value) : NaN);
    }
    this.draw(false);
  }

  /** Forget all samples, and the charts that the user has added. */
  clear() {
    for (const [key, chart] of this.charts) {
      chart.series.clear();
      this.areFixed || this.toggle(key, "");
    }
    this.hold(false);
  }

  /** @param {boolean} isHeld whether the charts stand still, while samples go on */
  hold(isHeld) {
    this.isHeld = isHeld;
    this.charts.forEach((chart) => void (chart.held = isHeld ? chart.series.copy() : null));
    setText(this.holdButton, isHeld ? this.texts.follow : this.texts.hold);
    this.holdButton.setAttribute("aria-pressed", String(isHeld));
    this.draw(true);
  }

  /** @param {number | null} secondsAgo */
  setCursor(secondsAgo) {
    this.cursor = secondsAgo === null ? null : Math.min(CHART_SPAN, Math.max(0, secondsAgo));
    this.draw(true);
  }

  /** Keep the cursor at a time. @param {number | null} time [s]; null: where the pointer is */
  pin(time) {
    if (time !== this.pinned) {
      this.pinned = time;
      this.draw(true);
    }
  }

  /** All samples as a table, with a line for each time. */
  csv() {
    return csvOf(Array.from(this.charts.values(), ({ spec, shown }) => ({ label: spec.unit ? `${spec.label} [${spec.unit}]` : spec.label, series: shown })));
  }

  /** @param {boolean} isUrgent whether the interval is ignored, for the answer to a user */
  draw(isUrgent) {
    if (this.isWaiting || (!isUrgent && performance.now() - this.drawnAt < DRAW_INTERVAL)) {
      return;
    }
    this.isWaiting = true;
    requestAnimationFrame(() => {
      this.isWaiting = false;
      this.drawnAt = performance.now();
      this.charts.forEach((chart) => chart.draw());
    });
  }
}

/** One chart of several. */
class Chart {
  /** @param {ChartSpec} spec @param {Charts} charts */
  constructor(spec, charts) {
    const { texts } = charts;
    this.spec = spec;
    this.charts = charts;
    this.series = new ChartSeries(CHART_SPAN);
    /** @type {ChartSeries | null} */
    this.held = null;
    this.value = element("output", { className: "strip-value" });
    this.second = element("select", { className: "strip-second", "aria-label": texts.second(spec.label), title: texts.secondHint });
    this.second.onchange = () => charts.draw(true);
    const remove = element("button", { type: "button", className: "small", "aria-label": texts.remove(spec.label), title: texts.remove(""), hidden: charts.areFixed }, "×");
    remove.onclick = () => void charts.toggle(spec.key, "");
    this.canvas = element("canvas", {
      className: "strip-canvas",
      tabIndex: 0,
      role: "slider",
      "aria-label": texts.chart(spec.label),
      "aria-valuemin": String(-CHART_SPAN),
      "aria-valuemax": "0",
      "aria-valuenow": "0",
    });
    this.canvas.onpointermove = this.canvas.onpointerdown = (event) => this.point(event);
    this.canvas.onpointerleave = this.canvas.onblur = () => charts.setCursor(null);
    this.canvas.onkeydown = (event) => this.press(event);
    const label = element("div", { className: "strip-label" }, element("span", { className: "row-name" }, spec.label), this.value, this.second, remove);
    this.element = element("div", { className: "strip" }, label, this.canvas);
  }

  /** The samples that are shown. */
  get shown() {
    return this.held ?? this.series;
  }

  showChoices() {
    const { value } = this.second;
    const others = [...this.charts.charts.values()].filter((other) => other !== this);
    replaceChildren(
      this.second,
      element("option", { value: "" }, this.charts.texts.noSecond),
      ...others.map(({ spec }) => element("option", { value: spec.key }, spec.label)),
    );
    this.second.value = others.some(({ spec }) => spec.key === value) ? value : "";
    this.second.hidden = others.length === 0;
  }

  /** @param {PointerEvent} event */
  point(event) {
    const box = this.canvas.getBoundingClientRect();
    this.charts.setCursor((1 - (event.clientX - box.left) / Math.max(1, box.width)) * CHART_SPAN);
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    const step = event.shiftKey ? 10 * CURSOR_STEP : CURSOR_STEP;
    const cursor = this.charts.cursor ?? 0;
    /** @type {Record<string, number | null>} */
    const places = { ArrowLeft: cursor + step, ArrowRight: cursor - step, Home: CHART_SPAN, End: 0, Escape: null };
    if (Object.hasOwn(places, event.key)) {
      event.preventDefault();
      this.charts.setCursor(places[event.key] ?? null);
    }
  }

  draw() {
    const { canvas, charts } = this;
    const width = canvas.clientWidth;
    const context = canvas.getContext("2d");
    if (width === 0 || !context) {
      return; // its panel is not shown
    }
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(CHART_HEIGHT * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(CHART_HEIGHT * ratio);
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, CHART_HEIGHT);
    const style = getComputedStyle(canvas);
    const colour = (/** @type {string} */ name) => style.getPropertyValue(name) || style.color;
    const end = this.shown.lastTime;
    const xOf = (/** @type {number} */ time) => width * (1 - (end - time) / CHART_SPAN);
    const other = charts.charts.get(this.second.value);
    context.font = `10px ${style.fontFamily}`;
    const yOf = this.scale();
    drawGrid(context, colour("--line"), width, yOf(0));
    if (other) {
      drawSeries(context, other.shown, colour("--focus"), xOf, other.scale());
      drawRange(context, other.range, colour("--focus"), width - 3, "right");
    }
    drawSeries(context, this.shown, colour("--accent"), xOf, yOf);
    drawRange(context, this.range, other ? colour("--accent") : colour("--ink-2"), 3, "left");
    this.drawReading(context, style.color, xOf, yOf, other);
  }

  /** Range of values that the chart shows. @returns {[number, number]} */
  get range() {
    const { smallest } = this.spec;
    return smallest ? roundRange(this.shown.range(), smallest) : chartRange(this.shown.range());
  }

  /** @returns {(value: number) => number} from values to pixels */
  scale() {
    const [low, high] = this.range;
    return (value) => CHART_HEIGHT - 3 - ((value - low) / (high - low || 1)) * (CHART_HEIGHT - 6);
  }

  /** @param {number} time @returns {{text: string, value: number, time: number}} the value nearest to a time */
  reading(time) {
    const { spec, shown } = this;
    const index = shown.nearest(time);
    const value = index < 0 ? NaN : shown.valueAt(index);
    const number = spec.digits === undefined ? String(Number(value.toPrecision(7))) : value.toFixed(spec.digits);
    const text = Number.isFinite(value) ? `${number} ${spec.unit ?? ""}`.trim() : this.charts.texts.none;
    return { text, value, time: index < 0 ? shown.lastTime : shown.timeAt(index) };
  }

  /**
   * @param {CanvasRenderingContext2D} context @param {string} ink
   * @param {(time: number) => number} xOf @param {(value: number) => number} yOf @param {Chart | undefined} other
   */
  drawReading(context, ink, xOf, yOf, other) {
    const { cursor, pinned, texts } = this.charts;
    const { lastTime } = this.shown;
    const isRead = cursor !== null || pinned !== null;
    const at = cursor === null ? (pinned ?? lastTime) : lastTime - cursor;
    const { text, value, time } = this.reading(at);
    const both = other ? `${text}; ${other.reading(at).text}` : text;
    const reading = texts.reading(both, (lastTime - time).toFixed(1));
    setText(this.value, isRead ? reading : both);
    this.canvas.setAttribute("aria-valuenow", (time - lastTime).toFixed(1));
    this.canvas.setAttribute("aria-valuetext", reading);
    if (!isRead) {
      return;
    }
    context.strokeStyle = context.fillStyle = ink;
    context.beginPath();
    context.moveTo(xOf(time), 0);
    context.lineTo(xOf(time), CHART_HEIGHT);
    context.stroke();
    if (Number.isFinite(value)) {
      context.beginPath();
      context.arc(xOf(time), yOf(value), 3, 0, 2 * Math.PI);
      context.fill();
    }
  }
}

/** A range that is never empty, so that a value that stays is a line in the middle. @param {[number, number]} range @returns {[number, number]} */
export function chartRange([low, high]) {
  const least = Math.max(Math.abs(low), Math.abs(high)) * 1e-6 || 1;
  const lacking = Math.max(0, least - (high - low)) / 2;
  return [low - lacking, high + lacking];
}

/** @param {CanvasRenderingContext2D} context @param {string} colour @param {number} width @param {number} zero y of the value 0 */
function drawGrid(context, colour, width, zero) {
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.beginPath();
  for (let share = 0; share <= 6; share += 1) {
    const x = Math.min(width - 0.5, Math.round((width * share) / 6) + 0.5);
    context.moveTo(x, 0);
    context.lineTo(x, CHART_HEIGHT);
  }
  context.moveTo(0, Math.round(zero) + 0.5);
  context.lineTo(width, Math.round(zero) + 0.5);
  context.stroke();
}

/**
 * @param {CanvasRenderingContext2D} context @param {[number, number]} range @param {string} colour
 * @param {number} x @param {"left" | "right"} side
 */
function drawRange(context, [low, high], colour, x, side) {
  context.fillStyle = colour;
  context.textAlign = side;
  context.textBaseline = "top";
  context.fillText(String(Number(high.toPrecision(6))), x, 2);
  context.textBaseline = "bottom";
  context.fillText(String(Number(low.toPrecision(6))), x, CHART_HEIGHT - 1);
}

/**
 * @param {CanvasRenderingContext2D} context @param {ChartSeries} series @param {string} colour
 * @param {(time: number) => number} xOf @param {(value: number) => number} yOf
 */
function drawSeries(context, series, colour, xOf, yOf) {
  context.strokeStyle = colour;
  context.lineWidth = 1.5;
  context.lineJoin = "round";
  context.beginPath();
  let isDown = false;
  for (let index = 0; index < series.length; index += 1) {
    const value = series.valueAt(index);
    if (Number.isFinite(value)) {
      const [x, y] = [xOf(series.timeAt(index)), yOf(value)];
      if (isDown) {
        context.lineTo(x, y);
      } else {
        context.moveTo(x, y);
      }
    }
    isDown = Number.isFinite(value);
  }
  context.stroke();
}
