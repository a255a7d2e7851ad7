// Strip charts: values of the last minute, one under the other over the same time, with one cursor for all.

import { ChartSeries, roundRange } from "./chart_series.js";
import { element, setText } from "./dom.js";

/**
 * @typedef {{key: string, label: string, unit: string, digits: number, smallest: [number, number]}} ChartSpec
 *   smallest: range of values that is always shown
 */

/** @typedef {{hold: string, follow: string, holdHint: string, chart: (label: string) => string, reading: (value: string, secondsAgo: string) => string, none: string}} ChartTexts */

/** Shortest time between two drawings: a chart of a minute moves less than a pixel in it [ms]. */
const DRAW_INTERVAL = 100;

/** A key moves the cursor so far [s]; with Shift ten times as far. */
const CURSOR_STEP = 0.5;

/** Height of a chart [CSS pixels]. */
const CHART_HEIGHT = 56;

export class StripCharts {
  /** @param {ChartSpec[]} specs @param {number} spanS time that a chart shows [s] @param {ChartTexts} texts */
  constructor(specs, spanS, texts) {
    this.spanS = spanS;
    this.texts = texts;
    /** @type {number | null} */
    this.cursor = null; // [s] before the latest sample
    this.isHeld = false;
    this.drawnAt = -Infinity;
    this.isWaiting = false;
    this.strips = specs.map((spec) => new Strip(spec, this));
    this.holdButton = element("button", { type: "button", className: "small", title: texts.holdHint, "aria-pressed": "false" }, texts.hold);
    this.holdButton.addEventListener("click", () => this.hold(!this.isHeld));
    this.element = element(
      "div",
      { className: "strip-charts" },
      element("div", { className: "strip-head" }, this.holdButton),
      ...this.strips.map((strip) => strip.element),
    );
    new ResizeObserver(() => this.draw(true)).observe(this.element);
  }

  /**
   * Add a sample to each chart.
   * @param {number} time [s]
   * @param {Record<string, number>} values by key; not finite: a gap
   */
  push(time, values) {
    for (const strip of this.strips) {
      strip.series.push(time, values[strip.spec.key] ?? NaN);
    }
    this.draw(false);
  }

  clear() {
    for (const strip of this.strips) {
      strip.series.clear();
      strip.held = null;
    }
    this.hold(false);
  }

  /** @param {boolean} isHeld whether the charts stand still, while samples go on */
  hold(isHeld) {
    this.isHeld = isHeld;
    for (const strip of this.strips) {
      strip.held = isHeld ? strip.series.copy() : null;
    }
    setText(this.holdButton, isHeld ? this.texts.follow : this.texts.hold);
    this.holdButton.setAttribute("aria-pressed", String(isHeld));
    this.draw(true);
  }

  /** @param {number | null} secondsAgo */
  setCursor(secondsAgo) {
    this.cursor = secondsAgo === null ? null : Math.min(this.spanS, Math.max(0, secondsAgo));
    this.draw(true);
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
      for (const strip of this.strips) {
        strip.draw();
      }
    });
  }
}

/** One chart of several. */
class Strip {
  /** @param {ChartSpec} spec @param {StripCharts} charts */
  constructor(spec, charts) {
    this.spec = spec;
    this.charts = charts;
    this.series = new ChartSeries(charts.spanS);
    /** @type {ChartSeries | null} */
    this.held = null;
    this.value = element("output", { className: "strip-value" });
    this.canvas = element("canvas", {
      className: "strip-canvas",
      tabIndex: 0,
      role: "slider",
      "aria-label": charts.texts.chart(spec.label),
      "aria-valuemin": String(-charts.spanS),
      "aria-valuemax": "0",
      "aria-valuenow": "0",
    });
    this.canvas.addEventListener("pointermove", (event) => this.point(event));
    this.canvas.addEventListener("pointerdown", (event) => this.point(event));
    this.canvas.addEventListener("pointerleave", () => charts.setCursor(null));
    this.canvas.addEventListener("keydown", (event) => this.press(event));
    this.canvas.addEventListener("blur", () => charts.setCursor(null));
    this.element = element(
      "div",
      { className: "strip" },
      element("div", { className: "strip-label" }, element("span", {}, spec.label), this.value),
      this.canvas,
    );
  }

  /** @param {PointerEvent} event */
  point(event) {
    const box = this.canvas.getBoundingClientRect();
    this.charts.setCursor((1 - (event.clientX - box.left) / Math.max(1, box.width)) * this.charts.spanS);
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    const step = event.shiftKey ? 10 * CURSOR_STEP : CURSOR_STEP;
    const cursor = this.charts.cursor ?? 0;
    /** @type {Record<string, number | null>} */
    const places = { ArrowLeft: cursor + step, ArrowRight: cursor - step, Home: this.charts.spanS, End: 0, Escape: null };
    if (Object.hasOwn(places, event.key)) {
      event.preventDefault();
      this.charts.setCursor(places[event.key] ?? null);
    }
  }

  draw() {
    const { canvas, spec, charts } = this;
    const series = this.held ?? this.series;
    const width = canvas.clientWidth;
    if (width === 0) {
      return; // its panel is not shown
    }
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(CHART_HEIGHT * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(CHART_HEIGHT * ratio);
    }
    const context = canvas.getContext("2d");
    if (!context) {
      return;
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, CHART_HEIGHT);
    const style = getComputedStyle(canvas);
    const [low, high] = roundRange(series.range(), spec.smallest);
    const end = series.lastTime;
    const xOf = (/** @type {number} */ time) => width * (1 - (end - time) / charts.spanS);
    const yOf = (/** @type {number} */ value) => CHART_HEIGHT - 3 - ((value - low) / (high - low || 1)) * (CHART_HEIGHT - 6);
    this.drawGrid(context, style, width, yOf, low, high);
    drawSeries(context, series, style.getPropertyValue("--accent") || style.color, xOf, yOf);
    this.drawReading(context, series, style, xOf, yOf);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {CSSStyleDeclaration} style
   * @param {number} width
   * @param {(value: number) => number} yOf
   * @param {number} low
   * @param {number} high
   */
  drawGrid(context, style, width, yOf, low, high) {
    context.strokeStyle = style.getPropertyValue("--line") || style.color;
    context.lineWidth = 1;
    context.beginPath();
    for (let share = 0; share <= 6; share += 1) {
      const x = Math.min(width - 0.5, Math.round((width * share) / 6) + 0.5);
      context.moveTo(x, 0);
      context.lineTo(x, CHART_HEIGHT);
    }
    const zero = Math.round(yOf(0)) + 0.5;
    context.moveTo(0, zero);
    context.lineTo(width, zero);
    context.stroke();
    context.fillStyle = style.getPropertyValue("--ink-2") || style.color;
    context.font = `10px ${style.fontFamily}`;
    context.textBaseline = "top";
    context.fillText(String(high), 3, 2);
    if (low < 0) {
      context.textBaseline = "bottom";
      context.fillText(String(low), 3, CHART_HEIGHT - 1);
    }
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {ChartSeries} series
   * @param {CSSStyleDeclaration} style
   * @param {(time: number) => number} xOf
   * @param {(value: number) => number} yOf
   */
  drawReading(context, series, style, xOf, yOf) {
    const { cursor, texts } = this.charts;
    const index = series.nearest(series.lastTime - (cursor ?? 0));
    const value = index < 0 ? NaN : series.valueAt(index);
    const text = Number.isFinite(value) ? `${value.toFixed(this.spec.digits)} ${this.spec.unit}` : texts.none;
    const secondsAgo = index < 0 ? 0 : series.lastTime - series.timeAt(index);
    setText(this.value, cursor === null ? text : texts.reading(text, secondsAgo.toFixed(1)));
    this.canvas.setAttribute("aria-valuenow", (0 - secondsAgo).toFixed(1));
    this.canvas.setAttribute("aria-valuetext", texts.reading(text, secondsAgo.toFixed(1)));
    if (cursor === null || index < 0) {
      return;
    }
    const x = xOf(series.timeAt(index));
    context.strokeStyle = context.fillStyle = style.color;
    context.beginPath();
    context.moveTo(x, 0);
    context.lineTo(x, CHART_HEIGHT);
    context.stroke();
    if (Number.isFinite(value)) {
      context.beginPath();
      context.arc(x, yOf(value), 3, 0, 2 * Math.PI);
      context.fill();
    }
  }
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {ChartSeries} series
 * @param {string} colour
 * @param {(time: number) => number} xOf
 * @param {(value: number) => number} yOf
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
