// A slider over time, with marks above it and a clock beside it: for recordings, and for the live drive.

import { element, replaceChildren, setText } from "./dom.js";

/** @typedef {{at: number, kind: string, title: string}} ScrubberMark at: time [s] */

export class Scrubber {
  /**
   * @param {{label: string, step: number, clock: (time: number) => string, onInput?: (time: number) => void, onChange?: (time: number) => void}} options
   *   step: [s]; clock: text of a time; onInput: while the user drags; onChange: when it is let go
   */
  constructor({ label, step, clock, onInput, onChange }) {
    this.clockText = clock;
    this.isDragged = false;
    this.slider = element("input", { type: "range", min: "0", step: String(step), "aria-label": label });
    this.clock = element("output", {});
    this.marks = element("div", { className: "scrubber-marks" });
    this.marksKey = "";
    this.element = element("div", { className: "slider-row" }, element("div", { className: "scrubber" }, this.marks, this.slider), this.clock);
    this.slider.addEventListener("input", () => {
      this.isDragged = true;
      this.showClock();
      onInput?.(this.time);
    });
    this.slider.addEventListener("change", () => {
      this.isDragged = false;
      onChange?.(this.time);
    });
  }

  get time() {
    return Number(this.slider.value);
  }

  /** @param {{from: number, to: number, time: number, isDisabled?: boolean}} state - [s] */
  show({ from, to, time, isDisabled = false }) {
    this.slider.disabled = isDisabled;
    this.slider.min = String(from);
    this.slider.max = String(to);
    if (!this.isDragged) {
      this.slider.value = String(time);
    }
    this.showClock();
  }

  showClock() {
    setText(this.clock, this.clockText(this.time));
    this.slider.setAttribute("aria-valuetext", this.clock.textContent ?? "");
  }

  /** @param {ScrubberMark[]} marks @param {(mark: ScrubberMark) => void} choose */
  showMarks(marks, choose) {
    const key = marks.map(({ at, kind }) => `${kind}${at}`).join();
    if (key !== this.marksKey) {
      this.marksKey = key;
      replaceChildren(this.marks, ...marks.map((mark) => {
        const button = element("button", { type: "button", className: `mark mark-${mark.kind}`, title: mark.title, "aria-label": mark.title });
        button.onclick = () => choose(mark);
        return button;
      }));
    }
    const [from, to] = [Number(this.slider.min), Number(this.slider.max)];
    marks.forEach(({ at }, i) => {
      const share = Math.min(1, Math.max(0, (at - from) / (to - from || 1)));
      /** @type {HTMLElement} */ (this.marks.children[i]).style.left = `calc(${(100 * share).toFixed(2)}% + ${(8 - 16 * share).toFixed(1)}px)`;
    });
  }
}
