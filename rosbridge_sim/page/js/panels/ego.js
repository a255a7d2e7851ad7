// The panel "Ego": instruments, gear, control mode and lamps, and strip charts of the last minute.

import { controlModeRequest, gearRequest, lampsRequest } from "../wire/requests.js";
import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { element, replaceChildren } from "../widgets/dom.js";
import { Charts } from "../widgets/charts.js";
import { GEAR_LETTERS, LAMP_BITS } from "./ego_values.js";
import { Instruments } from "./instruments.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** Control modes that the user may choose. */
const CHOOSABLE_MODES = [3, 6];

/** @param {PanelContext} context @returns {{element: HTMLElement, title: string}} */
export function makeEgoPanel(context) {
  const texts = context.texts.ego;
  const notice = new Notice();
  const instruments = new Instruments(texts);
  const charts = new Charts(context.texts.charts, [
    { key: "speed", label: texts.charts.speed, unit: "km/h", digits: 1, smallest: [0, 10] },
    { key: "acceleration", label: texts.charts.acceleration, unit: "m/s²", digits: 2, smallest: [-2, 2] },
    { key: "steering", label: texts.charts.steering, unit: "°", digits: 1, smallest: [-5, 5] },
    { key: "offset", label: texts.charts.offset, unit: "m", digits: 2, smallest: [-1, 1] },
  ]);
  connectEgo(context, instruments, charts);
  const content = element(
    "div",
    { className: "ego-panel" },
    makeEgoChoice(context),
    instruments.element,
    makeEgoButtons(context, notice),
    notice.element,
    charts.element,
  );
  return { element: content, title: texts.title };
}

/** @param {PanelContext} context @param {Instruments} instruments @param {Charts} charts */
function connectEgo({ ego, drivers, scene, texts: { ego: texts } }, instruments, charts) {
  ego.onValues(() => {
    instruments.showValues(ego.values, ego.link);
    if (!ego.values) {
      charts.clear();
    }
  });
  ego.onMessage((values, offset) => {
    const steering = (values.steering * 180) / Math.PI;
    /** @type {Record<string, number>} */
    const signals = { speed: values.speed * 3.6, acceleration: values.acceleration, steering, offset };
    charts.push(values.time, (key) => signals[key]);
  });
  ego.onChoice(() => charts.clear());
  const showState = () => {
    charts.pin(scene.past?.time ?? null);
    const driver = scene.past === null ? drivers.ofEgo(ego.number) : null; // of the past nothing tells who drove
    const mode = driver ? (texts.modes[driver.ctrl_mode] ?? String(driver.ctrl_mode)) : texts.none;
    const who = driver ? driverText(driver, drivers, texts) : texts.none;
    instruments.showState({ gear: driver?.gear ?? 0, mode, driver: who, lamps: driver || scene.past ? lampsOf(scene, ego.number) : 0 });
  };
  scene.onState(showState);
  drivers.onChange(showState);
}

/**
 * Text for the driver of an ego.
 * @param {import("./drivers_watch.js").EgoDriver} ego @param {import("./drivers_watch.js").DriversWatch} drivers
 * @param {import("../layout.js").Texts["ego"]} texts
 */
export function driverText({ driver, client }, drivers, texts) {
  return driver === "client" ? drivers.nameOf(client) : (texts.drivers[driver] ?? driver);
}

/** Bits of the lamps of an ego. @param {import("../scene/store.js").SceneStore} scene @param {number} number */
function lampsOf(scene, number) {
  const ego = scene.egos().find((one) => one.number === number);
  const row = ego ? scene.indexOf(ego.id, true) : -1;
  return row < 0 ? 0 : Number(scene.state?.lamps[row] ?? 0);
}

/** @param {PanelContext} context */
function makeEgoChoice({ ego, scene, texts: { ego: texts } }) {
  const choice = element("select", {});
  const field = labelled(texts.choice, choice);
  let shown = "";
  const show = () => {
    const numbers = scene.egos().map(({ number }) => number);
    const key = `${numbers.join()}/${ego.number}`;
    if (key !== shown) {
      shown = key;
      field.hidden = numbers.length < 2;
      replaceChildren(choice, ...numbers.map((number) => element("option", { value: String(number) }, texts.egoName(number))));
      choice.value = String(ego.number);
    }
  };
  choice.addEventListener("change", () => ego.choose(Number(choice.value)));
  scene.onState(show);
  ego.onChoice(show);
  show();
  return field;
}

/** @param {PanelContext} context @param {Notice} notice */
function makeEgoButtons({ ego, drivers, actions, scene, time, texts: { ego: texts } }, notice) {
  const toggles = [1, 2, 3, 4].map((gear) => {
    const letter = GEAR_LETTERS[gear] ?? "";
    const title = texts.setGear(letter);
    const act = () => actions.run(title, gearRequest(ego.number, gear));
    return { button: new ActionButton({ label: letter, name: title, title, notice, act }), isOn: () => drivers.ofEgo(ego.number)?.gear === gear };
  });
  const modes = CHOOSABLE_MODES.map((mode) => {
    const label = texts.modeButtons[mode] ?? "";
    const act = () => actions.run(label, controlModeRequest(ego.number, mode));
    return { button: new ActionButton({ label, title: texts.modeHints[mode] ?? "", notice, act }), isOn: () => drivers.ofEgo(ego.number)?.ctrl_mode === mode };
  });
  const both = LAMP_BITS.left | LAMP_BITS.right;
  const lamps = /** @type {[string, number, number, number][]} */ ([
    ["left", 1, 0, LAMP_BITS.left],
    ["right", 2, 0, LAMP_BITS.right],
    ["hazard", 0, 1, both],
  ]).map(([name, turn, hazard, bits]) => {
    const title = texts.lampButtons[/** @type {"left"} */ (name)];
    const isOn = () => (lampsOf(scene, ego.number) & both) === bits;
    const act = () => actions.run(title, isOn() ? lampsRequest(ego.number, 0, 0) : lampsRequest(ego.number, turn, hazard));
    return { button: new ActionButton({ label: texts.lampSigns[/** @type {"left"} */ (name)], name: title, title, notice, act }), isOn };
  });
  const all = [...toggles, ...modes, ...lamps];
  const show = () => {
    for (const { button, isOn } of all) {
      button.element.setAttribute("aria-pressed", String(isOn()));
      button.setReason(time.reasons.drive);
    }
  };
  scene.onState(show);
  drivers.onChange(show);
  time.onChange(show);
  const row = (/** @type {typeof all} */ buttons, /** @type {string} */ name) =>
    element("div", { className: "button-group", role: "group", "aria-label": name }, ...buttons.map(({ button }) => button.element));
  return element(
    "div",
    { className: "button-row" },
    row(toggles, texts.gears),
    row(lamps, texts.lampsGroup),
    row(modes, texts.mode),
  );
}
