// The panel "Time": whether time runs, who moves it, and the buttons for it.

import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { askUser } from "../widgets/dialog.js";
import { chooseNumber, element, setText } from "../widgets/dom.js";
import { makeReplayControls } from "./replay.js";
import { makeScenarioList } from "./scenarios.js";
import { makeSnapshotList } from "./snapshots.js";
import { makeStory } from "./story.js";
import { isLedByOthers, paceText, timeStateText } from "./time_state.js";
import { FRAME_S } from "./time_watch.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** Id of the list of scenarios, which the header opens. */
export const SCENARIOS_ID = "scenarios";
/** Most steps in one call of the server. */
const MOST_STEPS = 1000;
/** Factors to choose from; 0 is as fast as possible. */
const FACTORS = [0.1, 0.25, 0.5, 1, 2, 4, 10, 20, 0];

/** @param {PanelContext} context @returns {{element: HTMLElement, title: string}} */
export function makeTimePanel(context) {
  const texts = context.texts.time;
  const notice = new Notice();
  const parts = [
    makeFigures(context),
    makeTransport(context, notice),
    notice.element,
    makeFactor(context, notice),
    makeStory(context),
    section(texts.snapshots.title, makeSnapshotList(context)),
    section(texts.scenarios.title, makeScenarioList(context), SCENARIOS_ID),
    section(texts.replay.title, makeReplayControls(context)),
  ];
  return { element: element("div", { className: "time-panel" }, ...parts), title: texts.title };
}

/** @param {string} title @param {HTMLElement} content @param {string} [id] */
function section(title, content, id) {
  return element("section", { id, tabIndex: id ? -1 : undefined, className: "subsection", "aria-label": title }, element("h3", {}, title), content);
}

/** @param {PanelContext} context */
function makeFigures({ time, texts: { time: texts } }) {
  const words = element("span", { role: "status" });
  const pace = element("span", {}); // it changes all the time, so screen readers should not read it
  const leader = element("span", { role: "status" });
  const state = element("p", { className: "time-state" }, words, pace, leader);
  const names = /** @type {const} */ (["frame", "simTime", "timeStep", "ticks", "factor", "members"]);
  const values = names.map((name) => ({ name, value: element("dd", {}), label: element("dt", {}, texts.figures[name]) }));
  const list = element("dl", { className: "figures" }, ...values.map(({ label, value }) => element("div", {}, label, value)));
  const show = () => {
    const { frame, kind, master, members, timeStep } = time.state;
    const { factor } = time;
    const isInSteps = kind === "synchronous";
    const pacing = paceText(time.state, factor, texts);
    setText(words, timeStateText(time.state, texts.states));
    setText(pace, pacing && `, ${pacing}`);
    setText(leader, isInSteps ? `. ${texts.master(master || texts.noMaster)}` : "");
    state.dataset.kind = isLedByOthers(time.state) ? "led" : kind;
    /** @type {Record<string, string>} */
    const shown = {
      frame: String(frame),
      simTime: `${(frame * FRAME_S).toFixed(2)} s`,
      timeStep: isInSteps && timeStep ? `${timeStep} ms` : texts.none,
      ticks: isInSteps && timeStep && factor !== null ? `${((factor * 1000) / timeStep).toFixed(1)} /s` : texts.none,
      factor: factor === null ? texts.none : `${factor.toFixed(2)} ×`,
      members: members.join(", "),
    };
    for (const { name, value, label } of values) {
      setText(value, shown[name] ?? "");
      /** @type {HTMLElement} */ (label.parentElement).hidden = name === "members" && members.length === 0;
    }
  };
  time.onChange(show);
  return element("div", {}, state, list);
}

/** @param {PanelContext} context @param {Notice} notice */
function makeTransport({ time, timeControls: controls, texts: { time: texts } }, notice) {
  const steps = element("input", { type: "number", min: "1", max: String(MOST_STEPS), value: "1", required: true });
  const timeStep = element("input", { type: "number", min: "20", max: "1000", step: "20", value: "20", required: true });
  const seed = element("input", { type: "number", step: "1", placeholder: texts.seedHint });
  /** @param {string} name @param {() => unknown} act @param {string} [className] */
  const button = (name, act, className = "") => {
    const { label, title } = texts.buttons[/** @type {"pause"} */ (name)];
    return new ActionButton({ label, title, notice, act, className });
  };
  const buttons = {
    pause: button("pause", () => controls.pause()),
    run: button("run", () => controls.run()),
    step: button("step", () => controls.step(wholeNumber(steps, texts), wholeNumber(timeStep, texts)), "primary"),
    take: button("take", () => controls.take(wholeNumber(timeStep, texts))),
    leave: button("leave", () => controls.leave()),
    reset: button("reset", async () => {
      const seedField = labelled(texts.seed, seed);
      const { title, body, confirm } = texts.resetDialog;
      const content = [element("p", {}, body), seedField];
      if (await askUser({ title, confirm, cancel: texts.cancel, content })) {
        await controls.reset(seed.value === "" ? -1 : wholeNumber(seed, texts));
        notice.show(texts.resetDone);
      }
    }),
  };
  time.onChange(() => {
    const { kind, master, timeStep: inForce } = time.state;
    timeStep.disabled = kind === "synchronous" && master !== "" && inForce > 0; // the mode has one already
    if (timeStep.disabled) {
      timeStep.value = String(inForce);
    }
    for (const [name, part] of Object.entries(buttons)) {
      part.setReason(time.reasons[/** @type {"pause"} */ (name)]);
    }
  });
  return element(
    "div",
    { className: "transport" },
    element("div", { className: "button-row" }, buttons.pause.element, buttons.run.element, buttons.reset.element),
    element(
      "div",
      { className: "button-row" },
      buttons.step.element,
      labelled(texts.steps, steps),
      labelled(texts.timeStep, timeStep),
    ),
    element("div", { className: "button-row" }, buttons.take.element, buttons.leave.element),
  );
}

/** @param {PanelContext} context @param {Notice} notice */
function makeFactor({ time, drivers, timeControls: controls, texts: { time: texts } }, notice) {
  const choice = element(
    "select",
    {},
    ...FACTORS.map((factor) => element("option", { value: String(factor) }, texts.factorName(factor))),
  );
  const set = new ActionButton({
    ...texts.buttons.factor,
    notice,
    act: async () => {
      const answer = await controls.setFactor(Number(choice.value));
      notice.show(texts.factorDone(answer.factor));
    },
  });
  time.onChange(() => set.setReason(time.reasons.factor));
  let inForce = NaN;
  drivers.onChange(() => {
    const factor = drivers.message?.real_time_factor ?? inForce;
    if (factor !== inForce) { // what the user has chosen meanwhile stays
      inForce = factor;
      chooseNumber(choice, factor, texts.factorName);
    }
  });
  return element("div", { className: "button-row" }, labelled(texts.factor, choice), set.element);
}

/** @param {HTMLInputElement} input @param {{badNumber: (label: string) => string}} texts */
function wholeNumber(input, texts) {
  if (!input.checkValidity() || !Number.isInteger(input.valueAsNumber)) {
    input.reportValidity();
    throw new Error(texts.badNumber(input.labels?.[0]?.textContent ?? ""));
  }
  return input.valueAsNumber;
}
