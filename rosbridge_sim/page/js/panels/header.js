// The values in the header: whether time runs, and who drives. A person sees them on each tab.

import { element, setText } from "../widgets/dom.js";
import { driverText } from "./ego.js";
import { timeStateText } from "./time.js";
import { isLedByOthers } from "./time_state.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/**
 * @param {PanelContext} context
 * @returns {HTMLElement}
 */
export function makeHeaderValues({ time, drivers, ego, texts }) {
  const state = element("span", { className: "header-time" });
  const frame = element("span", { className: "header-frame" });
  const driver = element("span", { className: "header-driver" });
  const show = () => {
    const { kind, frame: number } = time.state;
    setText(state, kind === "unknown" ? "" : timeStateText(time.state, texts.time));
    state.dataset.kind = isLedByOthers(time.state) ? "led" : kind;
    setText(frame, kind === "unknown" ? "" : texts.time.headerFrame(number));
    const one = drivers.ofEgo(ego.number);
    setText(driver, one ? texts.ego.headerDriver(driverText(one, drivers.ownAddress, texts.ego)) : "");
  };
  time.onChange(show);
  drivers.onChange(show);
  ego.onChoice(show);
  return element("span", { className: "header-panel" }, state, frame, driver);
}
