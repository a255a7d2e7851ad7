// The values in the header: the scenario, whether time runs, and who drives. A person sees them on each tab.

import { chooseLanguage, otherLanguage } from "../language.js";
import { element, setText } from "../widgets/dom.js";
import { driverText } from "./ego.js";
import { SCENARIOS_ID } from "./time.js";
import { isLedByOthers, paceText, timeStateText } from "./time_state.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** @param {PanelContext} context @param {import("./driving.js").Driving} driving @returns {HTMLElement} */
export function makeHeaderValues({ connection, time, drivers, ego, scene, showTab, texts }, driving) {
  const scenario = element("button", { type: "button", className: "header-scenario", title: texts.time.scenarios.open, hidden: true });
  scenario.onclick = () => {
    showTab("time");
    const list = document.getElementById(SCENARIOS_ID);
    list?.focus();
    list?.scrollIntoView();
  };
  scene.onState(() => {
    const name = scene.state?.scenario ?? "";
    setText(scenario, name);
    scenario.hidden = name === "";
  });
  const end = element("button", { type: "button", className: "small", title: texts.driving.end.title, hidden: true }, texts.driving.end.label);
  end.onclick = () => driving.end();
  driving.onChange((isOn) => void (end.hidden = !isOn));
  const state = element("span", { className: "header-time" });
  const activity = element("span", { className: "header-activity" });
  const master = element("span", { className: "header-master" });
  const frame = element("span", { className: "header-frame" });
  const driver = element("span", { className: "header-driver" });
  const show = () => {
    const { kind, frame: number, master: name } = time.state;
    const isKnown = kind !== "unknown" && connection.isLive;
    const words = [timeStateText(time.state, texts.time.states), paceText(time.state, time.factor, texts.time)];
    setText(state, isKnown ? words.filter(Boolean).join(", ") : "");
    state.dataset.kind = isLedByOthers(time.state) ? "led" : kind;
    setText(master, isKnown && name ? texts.time.master(name) : "");
    setText(frame, isKnown ? texts.time.headerFrame(number) : "");
    const one = drivers.ofEgo(ego.number);
    setText(driver, one ? texts.ego.headerDriver(driverText(one, drivers, texts.ego)) : "");
    const does = isKnown && one && ego.activity(one.driver);
    setText(activity, does ? texts.ego.headerActivity(ego.number, texts.ego.activities[does]) : "");
    activity.dataset.activity = does || "";
  };
  time.onChange(show);
  drivers.onChange(show);
  ego.onChoice(show);
  scene.onLive(show);
  return element("span", { className: "header-panel" }, state, activity, master, frame, driver, end, scenario, makeLanguageSwitch(texts.page));
}

/** @param {PanelContext["texts"]["page"]} texts @returns {HTMLElement} */
function makeLanguageSwitch(texts) {
  const { language, label } = otherLanguage();
  const button = element("button", { type: "button", className: "small header-language", title: texts.language, lang: language }, label);
  button.onclick = () => chooseLanguage(language);
  return button;
}
