// The instruments of an ego: speed, steering wheel, pedals, gear, lamps.

import { element, setText, svgElement } from "../widgets/dom.js";
import { GEAR_LETTERS, LAMP_BITS } from "./ego_values.js";

/** @typedef {import("./ego_values.js").EgoValues} EgoValues */
/** @typedef {import("../layout.js").Texts["ego"]} EgoTexts */

/** The steering wheel turns so much for an angle of the front wheels, as the gear of a usual car. */
const STEERING_RATIO = 15;

const MPS_TO_KMH = 3.6;
/** The steering wheel as paths in a box of 100 by 100. */
const WHEEL_PATHS = ["M50 6a44 44 0 1 0 .01 0z", "M8 46h84", "M50 54v38", "M42 40h16v16h-16z"];

export class Instruments {
  /** @param {EgoTexts} texts */
  constructor(texts) {
    this.texts = texts;
    this.speed = element("span", { className: "speed-value" }, texts.none);
    this.wheel = svgElement("g", {}, ...WHEEL_PATHS.map((d) => svgElement("path", { d })));
    this.wheelPicture = svgElement("svg", { viewBox: "0 0 100 100", class: "wheel", role: "img" }, this.wheel);
    this.wheelPicture.setAttribute("aria-label", texts.wheelName(texts.none));
    this.wheelText = element("span", { className: "wheel-text" });
    this.throttle = new PedalBar(texts.throttle, "throttle");
    this.brake = new PedalBar(texts.brake, "brake");
    this.mode = element("dd", {});
    this.gear = element("dd", {});
    this.driver = element("dd", {});
    this.place = element("dd", {});
    this.heading = element("dd", {});
    this.lane = element("dd", {});
    this.lamps = Object.entries(LAMP_BITS).map(([name, bit]) => ({
      bit,
      name: texts.lamps[/** @type {"left"} */ (name)],
      mark: element("span", { className: `lamp lamp-${name}`, role: "img" }, texts.lampSigns[/** @type {"left"} */ (name)]),
    }));
    const figure = (/** @type {string} */ label, /** @type {HTMLElement} */ value) =>
      element("div", {}, element("dt", {}, label), value);
    this.element = element(
      "div",
      { className: "instruments" },
      element(
        "div",
        { className: "instrument-row" },
        element(
          "div",
          { className: "speed" },
          element("div", {}, this.speed, element("span", { className: "unit" }, texts.speedUnit)),
          element("div", { className: "lamps" }, ...this.lamps.map(({ mark }) => mark)),
        ),
        element("div", { className: "wheel-box" }, this.wheelPicture, this.wheelText),
        element("div", { className: "pedals" }, this.brake.element, this.throttle.element),
      ),
      element(
        "dl",
        { className: "figures" },
        figure(texts.driver, this.driver),
        figure(texts.mode, this.mode),
        figure(texts.gears, this.gear),
        figure(texts.lane, this.lane),
        figure(texts.place, this.place),
        figure(texts.heading, this.heading),
      ),
    );
    this.showValues(null, "");
    this.showState({ gear: 0, mode: texts.none, driver: texts.none, lamps: 0 });
  }

  /**
   * @param {EgoValues | null} values null: nothing is known, and each instrument shows a dash
   * @param {string} link id of the lane; empty beside the road
   */
  showValues(values, link) {
    const { texts } = this;
    if (values === null) {
      for (const node of [this.speed, this.place, this.heading, this.lane]) {
        setText(node, texts.none);
      }
      this.showControls(NaN, NaN, NaN);
      return;
    }
    setText(this.speed, Math.abs(values.speed * MPS_TO_KMH).toFixed(Math.abs(values.speed) < 2.75 ? 1 : 0));
    this.showControls(values.steering, values.accel, values.brake);
    setText(this.place, texts.placeText(values.x.toFixed(2), values.y.toFixed(2), values.z.toFixed(2)));
    setText(this.heading, texts.headingText((((values.heading * 180) / Math.PI + 360) % 360).toFixed(1)));
    setText(this.lane, link || texts.offRoad);
  }

  /**
   * @param {number} steering [rad]; NaN: it is not known @param {number} accel 0 to 1; NaN: it is not known
   * @param {number} brake the same
   */
  showControls(steering, accel, brake) {
    const { texts } = this;
    const degrees = (steering * 180) / Math.PI;
    const isKnown = Number.isFinite(steering);
    this.wheel.setAttribute("transform", `rotate(${(0 - (isKnown ? degrees * STEERING_RATIO : 0)).toFixed(1)} 50 50)`);
    const angle = isKnown ? texts.wheelAngle(Math.abs(degrees).toFixed(1), Math.sign(Math.round(degrees * 10))) : texts.none;
    this.wheelPicture.setAttribute("aria-label", texts.wheelName(angle));
    setText(this.wheelText, angle);
    this.throttle.show(accel);
    this.brake.show(brake);
  }

  /** @param {{gear: number, mode: string, driver: string, lamps: number}} state lamps: bits of the scene's state */
  showState({ gear, mode, driver, lamps }) {
    const { texts } = this;
    setText(this.gear, GEAR_LETTERS[gear] ?? texts.none);
    setText(this.mode, mode);
    setText(this.driver, driver);
    for (const { bit, name, mark } of this.lamps) {
      const isOn = (lamps & bit) !== 0;
      mark.classList.toggle("on", isOn);
      mark.setAttribute("aria-label", texts.lampName(name, isOn));
      mark.title = texts.lampName(name, isOn);
    }
  }
}

/** The position of a pedal as a bar. */
class PedalBar {
  /** @param {string} label @param {string} kind for its colour */
  constructor(label, kind) {
    this.fill = element("span", { className: `pedal-fill pedal-${kind}` });
    this.bar = element(
      "span",
      { className: "pedal-bar", role: "meter", "aria-label": label, "aria-valuemin": "0", "aria-valuemax": "100", "aria-valuenow": "0" },
      this.fill,
    );
    this.element = element("div", { className: "pedal", title: label }, this.bar, element("span", { "aria-hidden": "true" }, label));
  }

  /** @param {number} share 0 to 1; NaN: it is not known, and shown as empty */
  show(share) {
    const percent = Math.round(Math.min(1, Math.max(0, share || 0)) * 100);
    this.fill.style.height = `${percent}%`;
    this.bar.setAttribute("aria-valuenow", String(percent));
  }
}
