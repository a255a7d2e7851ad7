/** Charts of single numbers of a message, over the last minute of the clock. */

import { ChartSeries } from "./chart_series.js";
import { element, setText } from "./dom.js";

/** @typedef {{remove: string, chart: (name: string) => string, range: (low: string, high: string) => string, full: string}} ValueChartTexts */

/** Charts at one time; more do not fit on a screen. */
export const MAX_VALUE_CHARTS = 6;

/** Time that a chart shows [s]. */
const VALUE_CHART_SPAN = 60;

/** Height of a chart [CSS pixels]. */
const VALUE_CHART_HEIGHT = 64;

/** The charts below a message. */
export class ValueCharts {
  /** @param {ValueChartTexts} texts */
  constructor(texts) {
    this.texts = texts;
    /** @type {Map<string, ValueChart>} */
    this.charts = new Map();
    /** Called when a chart was added or removed. */
    this.onChange = () => undefined;
    this.element = element("div", { className: "value-charts" });
  }

  /**
   * Add a chart, or remove it if it is there.
   * @param {string} key
   * @param {string} name - for people
   * @returns {boolean} false if there are too many
   */
  toggle(key, name) {
    const chart = this.charts.get(key);
    if (chart !== undefined) {
      chart.element.remove();
      this.charts.delete(key);
    } else if (this.charts.size >= MAX_VALUE_CHARTS) {
      return false;
    } else {
      const added = new ValueChart(name, this.texts, () => void this.toggle(key, name));
      this.charts.set(key, added);
      this.element.append(added.element);
    }
    this.onChange();
    return true;
  }

  clear() {
    for (const key of [...this.charts.keys()]) {
      this.toggle(key, "");
    }
  }

  /** Add a sample to each chart. @param {number} time - of the clock [s] @param {(key: string) => any} valueOf */
  push(time, valueOf) {
    for (const [key, chart] of this.charts) {
      chart.push(time, valueOf(key));
    }
  }
}

/** The chart of one number. */
class ValueChart {
  /** @param {string} name @param {ValueChartTexts} texts @param {() => void} remove */
  constructor(name, texts, remove) {
    this.texts = texts;
    this.series = new ChartSeries(VALUE_CHART_SPAN);
    this.value = element("output", { className: "strip-value" });
    this.range = element("small", { className: "hint" });
    this.canvas = element("canvas", { className: "value-canvas", role: "img", "aria-label": texts.chart(name) });
    const close = element("button", { type: "button", className: "small", "aria-label": `${texts.remove} ${name}`, title: texts.remove }, "×");
    close.addEventListener("click", remove);
    this.element = element(
      "div",
      { className: "value-chart" },
      element("div", { className: "strip-label" }, element("span", { className: "row-name" }, name), this.value, close),
      this.canvas,
      this.range,
    );
    this.isWaiting = false;
  }

  /** @param {number} time @param {any} value */
  push(time, value) {
    const number = ["number", "bigint", "boolean"].includes(typeof value) ? Number(value) : NaN;
    this.series.push(time, number);
    setText(this.value, Number.isFinite(number) ? String(Number(number.toPrecision(7))) : "–");
    if (!this.isWaiting) {
      this.isWaiting = true;
      requestAnimationFrame(() => {
        this.isWaiting = false;
        this.draw();
      });
    }
  }

  draw() {
    const { canvas, series } = this;
    const width = canvas.clientWidth;
    const context = canvas.getContext("2d");
    if (width === 0 || context === null) {
      return; // its panel is not shown
    }
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(VALUE_CHART_HEIGHT * ratio);
    context.scale(ratio, ratio);
    const [low, high] = chartRange(series.range());
    setText(this.range, this.texts.range(String(Number(low.toPrecision(6))), String(Number(high.toPrecision(6)))));
    const style = getComputedStyle(canvas);
    context.strokeStyle = style.getPropertyValue("--accent") || style.color;
    context.lineWidth = 1.5;
    context.beginPath();
    let isDown = false;
    for (let index = 0; index < series.length; index += 1) {
      const value = series.valueAt(index);
      const x = width * (1 - (series.lastTime - series.timeAt(index)) / VALUE_CHART_SPAN);
      const y = VALUE_CHART_HEIGHT - 3 - ((value - low) / (high - low)) * (VALUE_CHART_HEIGHT - 6);
      if (!Number.isFinite(value)) {
        isDown = false;
      } else if (isDown) {
        context.lineTo(x, y);
      } else {
        context.moveTo(x, y);
        isDown = true;
      }
    }
    context.stroke();
  }
}

/**
 * A range that is never empty, so that a value that stays is a line in the middle.
 * @param {[number, number]} range - least and greatest value
 * @returns {[number, number]}
 */
export function chartRange([low, high]) {
  const least = Math.max(Math.abs(low), Math.abs(high)) * 1e-6 || 1;
  const lacking = Math.max(0, least - (high - low)) / 2;
  return [low - lacking, high + lacking];
}
