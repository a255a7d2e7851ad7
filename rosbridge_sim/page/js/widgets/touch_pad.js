// A pad for a thumb: where the thumb is, from -1 to 1 on each axis. It springs back when it is let go.

import { element } from "./dom.js";

export class TouchPad {
  /**
   * @param {{label: string, className: string, signs: [string, string], onMove: (x: number, y: number) => void}} options
   *   signs: of both ends, the left or upper one first; x: to the right, y: upwards, each -1 to 1; both 0 when the pad is let go
   */
  constructor({ label, className, signs, onMove }) {
    this.onMove = onMove;
    this.knob = element("span", { className: "pad-knob" });
    this.element = element("div", { className: `pad ${className}`, role: "img", "aria-label": label });
    this.element.append(...signs.map((sign) => element("span", { className: "pad-sign" }, sign)), this.knob);
    this.element.addEventListener("pointerdown", (event) => {
      this.element.setPointerCapture(event.pointerId);
      this.move(event);
    });
    this.element.addEventListener("pointermove", (event) => {
      if (this.element.hasPointerCapture(event.pointerId)) {
        this.move(event);
      }
    });
    for (const type of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) {
      this.element.addEventListener(type, () => this.set(0, 0));
    }
    this.element.addEventListener("contextmenu", (event) => event.preventDefault()); // a long touch
  }

  /** @param {PointerEvent} event */
  move(event) {
    const box = this.element.getBoundingClientRect();
    const x = ((event.clientX - box.left) / Math.max(1, box.width)) * 2 - 1;
    const y = 1 - ((event.clientY - box.top) / Math.max(1, box.height)) * 2;
    this.set(Math.min(1, Math.max(-1, x)), Math.min(1, Math.max(-1, y)));
  }

  /** @param {number} x @param {number} y */
  set(x, y) {
    this.knob.style.left = `${50 + 40 * x}%`;
    this.knob.style.top = `${50 - 40 * y}%`;
    this.onMove(x, y);
  }
}
