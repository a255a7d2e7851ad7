// The panel "Code": the latest actions of the user, and the same as a program.

import { ActionButton, Notice } from "../widgets/action_button.js";
import { element, replaceChildren, setText } from "../widgets/dom.js";
import { codeFor } from "../wire/code.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {import("./actions.js").Action} Action */

const LANGUAGES = /** @type {const} */ (["python", "javascript", "shell"]);

/** @param {PanelContext} context @returns {{element: HTMLElement, title: string}} */
export function makeCodePanel({ actions, connection, texts: { code: texts } }) {
  const notice = new Notice();
  const list = element("ol", { className: "rows actions", reversed: true });
  const program = element("code", {});
  const text = element("pre", { className: "code", tabIndex: 0, "aria-label": texts.program }, program);
  /** @type {(typeof LANGUAGES)[number]} */
  let language = "python";
  /** The chosen action; null follows the latest one. @type {Action | null} */
  let chosen = null;
  let isWaiting = false;

  const tabs = LANGUAGES.map((name) => {
    const tab = element("button", { type: "button", role: "radio" }, texts.languages[name]);
    tab.addEventListener("click", () => chooseLanguage(name));
    tab.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (step) {
        event.preventDefault();
        const next = (LANGUAGES.indexOf(name) + step + LANGUAGES.length) % LANGUAGES.length;
        chooseLanguage(LANGUAGES[next] ?? "python");
        tabs[next]?.focus();
      }
    });
    return tab;
  });
  /** @param {(typeof LANGUAGES)[number]} name */
  const chooseLanguage = (name) => {
    language = name;
    show();
  };

  const show = () => {
    isWaiting = false;
    const action = chosen ?? actions.recent[0];
    tabs.forEach((tab, index) => {
      const isOn = LANGUAGES[index] === language;
      tab.setAttribute("aria-checked", String(isOn));
      tab.tabIndex = isOn ? 0 : -1;
    });
    const options = { address: connection.url, hasToken: connection.hasToken, texts };
    setText(program, action ? codeFor(action.operation, options)[language] : texts.empty);
    text.classList.toggle("is-empty", !action);
    copy.setReason(action ? "" : texts.empty);
    const focused = list.contains(document.activeElement) ? Number(/** @type {HTMLElement} */ (document.activeElement).dataset.number) : 0;
    replaceChildren(list, ...actions.recent.map((one) => makeRow(one, one === action)));
    if (focused) {
      /** @type {HTMLElement | null} */ (list.querySelector(`[data-number="${focused}"]`))?.focus();
    }
  };

  /** @param {Action} action @param {boolean} isShown */
  const makeRow = (action, isShown) => {
    const outcome = action.outcome === "failed" ? texts.failed(action.reason) : texts.outcomes[action.outcome];
    const count = action.count > 1 ? ` ×${action.count}` : "";
    const button = element(
      "button",
      { type: "button", className: "row-button", "aria-pressed": String(isShown), dataset: { number: String(action.number) } },
      element("span", {}, action.title + count),
      element("small", { className: `outcome-${action.outcome}` }, outcome),
    );
    button.addEventListener("click", () => {
      chosen = action;
      show();
    });
    return element("li", {}, button);
  };

  const copy = new ActionButton({
    ...texts.copy,
    className: "primary",
    notice,
    act: async () => {
      await copyText(program);
      notice.show(texts.copied);
    },
  });
  actions.onChange(() => {
    if (!isWaiting) {
      isWaiting = true;
      requestAnimationFrame(show); // a driver sends 30 a second
    }
  });
  show();
  return {
    element: element(
      "div",
      { className: "code-panel" },
      element("p", { className: "hint" }, texts.hint),
      element("div", { className: "button-row" }, element("div", { className: "button-group", role: "radiogroup", "aria-label": texts.language }, ...tabs), copy.element),
      text,
      notice.element,
      element("h3", {}, texts.actions),
      list,
    ),
    title: texts.title,
  };
}

/** Copy a text. Pages without TLS have no `navigator.clipboard`, except on this machine. @param {HTMLElement} node */
export async function copyText(node) {
  try {
    await navigator.clipboard.writeText(node.textContent ?? "");
    return;
  } catch {
    // it is not there, or the browser does not let the page
  }
  const selection = document.getSelection();
  selection?.selectAllChildren(node);
  document.execCommand("copy");
}
