// The scenarios that the server can load, with their pictures; and a field for any other name.

import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { element, replaceRows } from "../widgets/dom.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {import("./server_files.js").ScenarioInfo} ScenarioInfo */

/** Size of a picture in the list [CSS pixels]; it is drawn twice as large, for fine screens. */
const PICTURE_WIDTH = 112;
const PICTURE_HEIGHT = 72;
/** Drawing a large map takes seconds, and the pictures are drawn one after the other [ms]. */
const PICTURE_TIMEOUT = 60_000;

/** @param {PanelContext} context @returns {HTMLElement} */
export function makeScenarioList(context) {
  const { connection, files, time, timeControls: controls, texts: { time: texts } } = context;
  const notice = new Notice();
  const list = element("ul", { className: "rows scenarios" });
  const name = element("input", { type: "text", autocomplete: "off" });
  /** @type {ActionButton[]} */
  let loads = [];
  /** Pictures by the names of their scenarios, kept while the page is open. @type {Map<string, string>} */
  const pictures = new Map();

  /** @param {string} scenario */
  const load = async (scenario) => {
    if (!scenario) {
      throw new Error(texts.scenarios.noName);
    }
    notice.show(texts.scenarios.loading(scenario));
    await controls.load(scenario);
    notice.show(texts.scenarios.loaded(scenario));
    void files.refresh();
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
    const picture = element("img", { alt: "", width: PICTURE_WIDTH, height: PICTURE_HEIGHT, src: pictures.get(info.name) });
    picture.hidden = !pictures.has(info.name);
    const about = info.problem || texts.scenarios.about(info.map, numEntities(info));
    const mark = info.is_loaded ? element("small", { className: "loaded" }, texts.scenarios.isLoaded) : null;
    const row = element(
      "li",
      {},
      picture,
      element("span", { className: "row-name" }, info.name, element("small", {}, about), mark),
      button.element,
    );
    return { info, picture, row };
  };
  const show = () => {
    loads = [];
    const rows = files.scenarios.map(makeRow);
    replaceRows(list, name, ...rows.map(({ row }) => row));
    if (files.problem) {
      notice.show(files.problem, "bad");
    }
    showReasons();
    void showPictures(rows);
  };
  /**
   * Show the pictures, one after the other, while the list is seen: a server draws one at a time.
   * @param {{info: ScenarioInfo, picture: HTMLImageElement}[]} rows
   */
  const showPictures = async (rows) => {
    for (const { info, picture } of rows) {
      if (!pictures.has(info.name) && !info.problem && picture.isConnected) {
        await seen(list);
        const request = { name: info.name, width: 2 * PICTURE_WIDTH, height: 2 * PICTURE_HEIGHT };
        try {
          const answer = await connection.call("/sim/scenario_picture", request, { timeoutMs: PICTURE_TIMEOUT });
          if (answer.result) {
            pictures.set(info.name, `data:image/png;base64,${answer.data}`);
          }
        } catch {
          return; // the connection is lost, or the service is off: the list is of use without pictures
        }
      }
      picture.src = pictures.get(info.name) ?? "";
      picture.hidden = !pictures.has(info.name);
    }
  };
  const showReasons = () => {
    for (const button of [loadNamed, ...loads]) {
      button.setReason(time.reasons.load);
    }
  };
  time.onChange(showReasons);
  files.onChange(show);
  return element(
    "div",
    {},
    list,
    element("div", { className: "button-row" }, labelled(texts.scenarios.name, name), loadNamed.element),
    notice.element,
  );
}

/** @param {ScenarioInfo} info */
function numEntities(info) {
  return info.num_egos + info.num_vehicles + info.num_pedestrians + info.num_obstacles;
}

/**
 * Wait until an element is seen, so that a tab that nobody opens costs the server nothing.
 * @param {HTMLElement} node @returns {Promise<void>}
 */
function seen(node) {
  return new Promise((resolve) => {
    const observer = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) {
        observer.disconnect();
        resolve();
      }
    });
    observer.observe(node);
  });
}
