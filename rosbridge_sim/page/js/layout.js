/**
 * The frame of the page: header, map, and a side column with tabs, which is a sheet at the lower edge on phones.
 *
 * Parts of the page fill it: `header` takes small values, `stage` the map, and `addPanel` puts a panel under a tab.
 */

import { element } from "./widgets/dom.js";
import { Tabs } from "./widgets/tabs.js";

/** @typedef {{element: HTMLElement, title: string}} Panel */
/** @typedef {typeof import("./texts.js").TEXTS} Texts */

/** Tabs in order; TEXTS.tabs has their titles. */
export const TAB_IDS = /** @type {const} */ (["ego", "time", "objects", "graph", "log", "code"]);

/** @typedef {(typeof TAB_IDS)[number]} TabId */

/** The frame of the page. */
export class Layout {
  /** @param {Texts} texts */
  constructor(texts) {
    this.header = element("div", { className: "header-values" });
    this.banner = element("div", { className: "banner", role: "status", "aria-live": "polite", hidden: true });
    this.stage = element("main", { id: "map", className: "stage", tabIndex: -1, "aria-label": texts.page.map });
    this.tabs = new Tabs(
      texts.tabs.label,
      TAB_IDS.map((id) => ({ id, title: texts.tabs[id] })),
    );
    for (const id of TAB_IDS) {
      this.tabs.panelOf(id).append(element("p", { className: "empty" }, texts.tabs.empty));
    }
    this.side = this.makeSide(texts);
    this.elements = [
      element("a", { className: "skip", href: "#controls" }, texts.page.skip),
      element("header", { className: "header" }, element("h1", { className: "name" }, texts.page.name), this.header),
      this.banner,
      this.stage,
      this.side,
    ];
  }

  /** Put a panel under a tab, below the ones that are there. @param {TabId} id @param {Panel} panel */
  addPanel(id, panel) {
    const place = this.tabs.panelOf(id);
    place.querySelector(":scope > .empty")?.remove();
    place.append(
      element("section", { className: "panel", "aria-label": panel.title }, element("h2", {}, panel.title), panel.element),
    );
  }

  /** @param {Texts} texts */
  makeSide(texts) {
    const toggle = element("button", {
      className: "side-toggle",
      type: "button",
      "aria-expanded": "true",
      "aria-controls": "controls",
      title: texts.tabs.hide,
      "aria-label": texts.tabs.hide,
    });
    const content = element("div", { id: "controls", className: "side-content", tabIndex: -1 }, this.tabs.list, this.tabs.panels);
    toggle.onclick = () => {
      const isShown = content.hidden;
      content.hidden = !isShown;
      toggle.setAttribute("aria-expanded", String(isShown));
      toggle.title = isShown ? texts.tabs.hide : texts.tabs.show;
      toggle.setAttribute("aria-label", toggle.title);
    };
    return element("aside", { className: "side", "aria-label": texts.page.controls }, toggle, content);
  }
}
