/** Tabs by the ARIA pattern: one of them is in the tab order, the arrow keys, Home and End move between them. */

import { element } from "./dom.js";

/** @typedef {{id: string, title: string}} TabName */

let numTabGroups = 0;

/** Tabs, each with a panel. */
export class Tabs {
  /**
   * @param {string} label - name of the group, for screen readers @param {TabName[]} names - the tabs, in order
   * @param {(id: string) => void} [onShow] - called when another tab is shown
   */
  constructor(label, names, onShow = () => undefined) {
    this.onShow = onShow;
    this.prefix = `tabs${++numTabGroups}`;
    /** @type {Map<string, {tab: HTMLButtonElement, panel: HTMLDivElement}>} */
    this.entries = new Map();
    this.list = element("div", { className: "tab-list", role: "tablist", "aria-label": label });
    this.panels = element("div", { className: "tab-panels" });
    for (const { id, title } of names) {
      this.addTab(id, title);
    }
    this.shown = names[0].id;
    this.show(this.shown);
  }

  /** Return the element that a tab shows. @param {string} id @returns {HTMLDivElement} */
  panelOf(id) {
    return this.entry(id).panel;
  }

  /** Show a tab. @param {string} id */
  show(id) {
    this.entry(id);
    const isNew = id !== this.shown;
    this.shown = id;
    for (const [other, { tab, panel }] of this.entries) {
      const isShown = other === id;
      tab.setAttribute("aria-selected", String(isShown));
      tab.tabIndex = isShown ? 0 : -1;
      panel.hidden = !isShown;
    }
    if (isNew) {
      this.onShow(id);
    }
  }

  /**
   * Show a number at a tab; 0 takes it away.
   * @param {string} id @param {number} count @param {string} label - in words, for screen readers
   */
  setBadge(id, count, label) {
    const { tab } = this.entry(id);
    tab.querySelector(".badge")?.remove();
    if (count > 0) {
      tab.append(element("span", { className: "badge", role: "img", "aria-label": label }, count > 99 ? "99+" : count));
    }
  }

  /** @param {string} id */
  entry(id) {
    const entry = this.entries.get(id);
    if (entry === undefined) {
      throw new RangeError(`tabs: expected one of ${[...this.entries.keys()].join(", ")}; got ${id}`);
    }
    return entry;
  }

  /** @param {string} id @param {string} title */
  addTab(id, title) {
    const tabId = `${this.prefix}-tab-${id}`;
    const panelId = `${this.prefix}-panel-${id}`;
    const tab = element(
      "button",
      { id: tabId, className: "tab", type: "button", role: "tab", "aria-controls": panelId },
      title,
    );
    tab.onclick = () => this.show(id);
    tab.onkeydown = (event) => this.move(event, id);
    const panel = element("div", {
      id: panelId,
      className: "tab-panel",
      role: "tabpanel",
      tabIndex: 0,
      "aria-labelledby": tabId,
    });
    this.list.append(tab);
    this.panels.append(panel);
    this.entries.set(id, { tab, panel });
  }

  /** @param {KeyboardEvent} event @param {string} id - tab that has the focus */
  move(event, id) {
    const ids = [...this.entries.keys()];
    const at = ids.indexOf(id);
    const next = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: ids.length - 1 }[event.key];
    if (next === undefined) {
      return;
    }
    event.preventDefault();
    const chosen = ids[(next + ids.length) % ids.length];
    this.show(chosen);
    this.entry(chosen).tab.focus();
  }
}
