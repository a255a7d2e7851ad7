// Modal dialogs of the page: a question, a text, a confirmation. They use the browser's own <dialog> element, which
// keeps the focus inside, closes by Escape and gives the focus back.

import { element } from "./dom.js";

/**
 * Show a dialog until it is closed.
 * @param {{title: string, confirm: string, cancel: string, content?: (Node | string)[], isDangerous?: boolean}} options
 * @returns {Promise<boolean>} whether the user confirmed it
 */
export function askUser({ title, confirm, cancel, content = [], isDangerous = false }) {
  const heading = element("h2", { id: "dialog-title" }, title);
  const confirmButton = element("button", { type: "submit", value: "yes", className: isDangerous ? "danger" : "primary" }, confirm);
  const cancelButton = element("button", { type: "button" }, cancel);
  const form = element(
    "form",
    { method: "dialog" },
    heading,
    ...content,
    element("div", { className: "dialog-buttons" }, cancelButton, confirmButton),
  );
  const dialog = /** @type {HTMLDialogElement} */ (
    element("dialog", { className: "dialog", "aria-labelledby": "dialog-title" }, form)
  );
  cancelButton.addEventListener("click", () => dialog.close(""));
  // form-action 'none' of the page's policy covers method="dialog" in some browsers: close it here.
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    dialog.close("yes");
  });
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    });
  });
}
