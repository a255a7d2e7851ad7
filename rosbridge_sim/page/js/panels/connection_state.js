/** The state of the connection: a mark in the header, a banner while it is lost or silent, and the question for a token. */

import { element, setText } from "../widgets/dom.js";

/** Time for which the banner says that the connection is back [ms]: long enough to be read. */
const BACK_SHOWN = 4000;

/**
 * Show the state of the connection.
 * @param {{connection: import("../wire/connection.js").Connection, texts: import("../layout.js").Texts}} context
 * @param {import("../layout.js").Layout} layout
 */
export function showConnectionState({ connection, texts }, layout) {
  const mark = element("span", { className: "connection-state" });
  layout.header.prepend(mark);
  const form = new TokenForm(connection, texts);
  layout.stage.append(form.element);
  let wasLost = false;
  /** @type {any} */
  let timer;
  connection.onSilence((isSilent) => {
    clearTimeout(timer);
    document.documentElement.dataset.silent = String(isSilent);
    setText(mark, isSilent ? texts.connection.silent : texts.connection.open);
    setText(layout.banner, isSilent ? texts.connection.silentBanner : "");
    layout.banner.hidden = !isSilent;
  });
  connection.onState((state, reason) => {
    clearTimeout(timer);
    document.documentElement.dataset.connection = state;
    setText(mark, state === "lost" ? texts.connection.lost("") : texts.connection[state]);
    form.setState(state, reason);
    if (state === "lost") {
      wasLost = true;
      setText(layout.banner, texts.connection.lost(reason));
      layout.banner.hidden = false;
    } else if (state === "open") {
      setText(layout.banner, wasLost ? texts.connection.back : "");
      layout.banner.hidden = !wasLost;
      timer = setTimeout(() => void (layout.banner.hidden = true), BACK_SHOWN);
      wasLost = false;
    } else if (state === "token") {
      layout.banner.hidden = true;
    }
  });
}

/** The question for the token of the server. */
class TokenForm {
  /** @param {import("../wire/connection.js").Connection} connection @param {import("../layout.js").Texts} texts */
  constructor(connection, texts) {
    this.texts = texts;
    this.isChecking = false;
    this.input = element("input", {
      id: "token",
      type: "password",
      autocomplete: "off",
      required: true,
      "aria-describedby": "token-answer",
    });
    this.answer = element("p", { id: "token-answer", role: "status" });
    this.button = element("button", { type: "submit" }, texts.token.send);
    this.element = element(
      "form",
      { className: "token-form", hidden: true, "aria-label": texts.token.title },
      element("h2", {}, texts.token.title),
      element("p", {}, texts.token.ask, " ", texts.token.kept),
      element("label", { for: "token" }, texts.token.label),
      this.input,
      this.button,
      this.answer,
    );
    this.element.onsubmit = (event) => {
      event.preventDefault();
      this.isChecking = true;
      connection.authenticate(this.input.value);
    };
  }

  /** @param {import("../wire/connection.js").ConnectionState} state @param {string} reason */
  setState(state, reason) {
    const isChecking = this.isChecking && state === "connecting";
    const wasHidden = this.element.hidden;
    this.element.hidden = !(state === "token" || isChecking);
    this.button.disabled = isChecking;
    this.input.readOnly = isChecking;
    setText(this.answer, isChecking ? this.texts.token.checking : reason);
    if (state === "token") {
      this.isChecking = false;
      this.input.setAttribute("aria-invalid", String(reason !== ""));
      if (wasHidden) {
        this.input.focus();
      } else {
        this.input.select();
      }
    } else if (!isChecking) {
      this.input.value = "";
      this.isChecking = false;
    }
  }
}
