// The scenarios that the server can load, with their pictures; and a field for any other name.

import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { element, replaceChildren } from "../widgets/dom.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** @typedef {{name: string, map: string, title: string, num_entities: number}} ScenarioInfo */

/**
 * @param {PanelContext} context
 * @returns {HTMLElement}
 */
export function makeScenarioList(context) {
  const { connection, time, timeControls: controls, texts: { time: texts } } = context;
  const notice = new Notice();
  const list = element("ul", { className: "rows scenarios" });
  const name = element("input", { type: "text", autocomplete: "off" });
  /** @type {ActionButton[]} */
  let loads = [];

  /** @param {string} scenario */
  const load = async (scenario) => {
    if (!scenario) {
      throw new Error(texts.scenarios.noName);
    }
    notice.show(texts.scenarios.loading(scenario));
    await controls.load(scenario);
    notice.show(texts.scenarios.loaded(scenario));
  };
  const loadNamed = new ActionButton({ ...texts.buttons.load, notice, act: () => load(name.value.trim()) });
  name.addEventListener("keydown", (event) => {
    if (event.key === "Enter") {
      void loadNamed.press();
    }
  });

  /** @param {ScenarioInfo} info */
  const makeRow = (info) => {
    const button = new ActionButton({
      ...texts.buttons.load,
      name: texts.scenarios.loadName(info.name),
      notice,
      act: () => load(info.name),
    });
    loads.push(button);
    const picture = element("img", { alt: "", width: 96, height: 64, hidden: true });
    showPicture(context, info.name, picture);
    const about = texts.scenarios.about(info.map, Number(info.num_entities));
    return element(
      "li",
      {},
      picture,
      element("span", { className: "row-name" }, info.name, element("small", {}, info.title), element("small", {}, about)),
      button.element,
    );
  };
  const refresh = async () => {
    const answer = await connection.call("/sim/scenarios", {}, { timeoutMs: 20_000 });
    loads = [];
    replaceChildren(list, ...answer.scenarios.map(makeRow));
    showReasons();
  };
  const showReasons = () => {
    for (const button of [loadNamed, ...loads]) {
      button.setReason(time.reasons.load);
    }
  };
  time.onChange(showReasons);
  connection.onState((state) => {
    if (state === "open") {
      refresh().catch((error) => notice.showError(error));
    }
  });
  return element(
    "div",
    {},
    list,
    element("div", { className: "button-row" }, labelled(texts.scenarios.name, name), loadNamed.element),
    notice.element,
  );
}

/**
 * @param {PanelContext} context
 * @param {string} scenario
 * @param {HTMLImageElement} picture
 */
async function showPicture({ connection }, scenario, picture) {
  try {
    const answer = await connection.call("/sim/scenario_picture", { name: scenario }, { timeoutMs: 60_000 });
    picture.src = `data:image/png;base64,${answer.data}`;
    picture.hidden = false;
  } catch {
    picture.hidden = true; // the list is of use without it
  }
}
