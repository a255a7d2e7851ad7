// Buttons that do something on the server, and the line that says what came of it.

import { element, setText } from "./dom.js";

/** A line of text for results and reasons, which screen readers read out. */
export class Notice {
  constructor() {
    this.element = element("p", { className: "notice", role: "status", hidden: true });
  }

  /** @param {string} text empty hides the line @param {"info" | "bad"} [kind] */
  show(text, kind = "info") {
    this.element.hidden = text === "";
    this.element.dataset.kind = kind;
    setText(this.element, text);
  }

  /** @param {unknown} error */
  showError(error) {
    this.show(error instanceof Error ? error.message : String(error), "bad");
  }
}

/**
 * A button with an action. If the action is not possible now, the button stays in the order of the keyboard, says why,
 * and does nothing; a disabled one could not be reached, and its reason not be read.
 */
export class ActionButton {
  /**
   * @param {{label: string, notice: Notice, act: () => unknown, title?: string, className?: string, name?: string}} options
   *   act: may return a promise; what it throws is shown in the notice; name: for screen readers, if the label is a sign
   */
  constructor({ label, notice, act, title = "", className = "", name }) {
    this.notice = notice;
    this.act = act;
    this.title = title;
    this.reason = "";
    this.isBusy = false;
    this.element = element("button", { type: "button", className, title, "aria-label": name }, label);
    this.element.addEventListener("click", () => void this.press());
  }

  /** @param {string} reason why the action is not possible now; empty: it is possible */
  setReason(reason) {
    if (reason !== this.reason) {
      this.reason = reason;
      this.element.title = reason || this.title;
      this.element.setAttribute("aria-disabled", String(reason !== ""));
    }
  }

  /** Change what the button says. @param {{label: string, title: string}} face */
  setFace({ label, title }) {
    setText(this.element, label);
    this.title = title;
    this.element.title = this.reason || title;
    if (this.element.hasAttribute("aria-label")) {
      this.element.setAttribute("aria-label", title);
    }
  }

  /** Do the action, unless it is under way or not possible. */
  async press() {
    if (this.reason) {
      this.notice.show(this.reason, "bad");
      return;
    }
    if (this.isBusy) {
      return;
    }
    this.isBusy = true;
    this.element.setAttribute("aria-busy", "true");
    try {
      this.notice.show("");
      await this.act();
    } catch (error) {
      this.notice.showError(error);
    } finally {
      this.isBusy = false;
      this.element.removeAttribute("aria-busy");
    }
  }
}

let numFields = 0;

/** A form field with its label. @param {string} label @param {HTMLElement} control @param {string} [hint] */
export function labelled(label, control, hint = "") {
  numFields += 1;
  control.id = `field-${numFields}`;
  const parts = [element("label", { htmlFor: control.id }, label), control];
  if (hint) {
    control.setAttribute("aria-describedby", `${control.id}-hint`);
    parts.push(element("small", { id: `${control.id}-hint`, className: "hint" }, hint));
  }
  return element("div", { className: "field" }, ...parts);
}
