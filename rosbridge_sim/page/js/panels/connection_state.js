/** The state of the connection: a mark in the header, a banner while it is lost or silent, and the question for a token. */

import { element, setText } from "../widgets/dom.js";

/** Time for which the banner says that the connection is back [ms]: long enough to be read. */
const BACK_SHOWN = 4000;
/** Interval between updates of the age [ms]. */
const STATE_AGE_INTERVAL = 1000;

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
  const words = element("span", {});
  const age = element("span", { "aria-live": "off" }); // screen readers should not count the seconds
  layout.banner.append(words, " ", age);
  let isLost = false;
  /** @type {any} */
  let timer;
  const showAge = () => {
    const { heardAt } = connection.silence;
    setText(age, isLost && heardAt > 0 ? texts.connection.age(Math.round((performance.now() - heardAt) / 1000)) : "");
  };
  setInterval(showAge, STATE_AGE_INTERVAL);
  /** Show the loss in one place: the mark is hidden while the banner shows it. @param {string} text */
  const tell = (text) => {
    clearTimeout(timer);
    setText(words, text);
    showAge();
    layout.banner.hidden = text === "";
    mark.hidden = isLost;
  };
  connection.onSilence((isSilent) => {
    document.documentElement.dataset.silent = String(isSilent);
    isLost = isSilent;
    tell(isSilent ? texts.connection.silent : "");
  });
  connection.onState((state, reason) => {
    document.documentElement.dataset.connection = state;
    form.setState(state, reason);
    const wasLost = isLost;
    isLost = state === "lost" || (wasLost && state === "connecting");
    setText(mark, state === "lost" ? "" : texts.connection[state]);
    if (state === "lost") {
      tell(texts.connection.lost(reason));
    } else if (state !== "connecting") {
      tell(wasLost && state === "open" ? texts.connection.back : "");
      timer = setTimeout(() => void (layout.banner.hidden = true), BACK_SHOWN);
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
