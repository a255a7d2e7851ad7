// Traffic lights: choose one, and set its lamps.

import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { element, replaceChildren } from "../widgets/dom.js";
import { lightMessage } from "../wire/requests.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {{name: string, lamps: number}} MapLight */

/** States that a light can be set to, as the wire's sum of lamps; -1 gives it back to its schedule. */
const LIGHT_STATES = /** @type {const} */ ([
  ["red", 1],
  ["yellow", 4],
  ["green", 16],
  ["left", 32],
  ["greenLeft", 48],
  ["schedule", -1],
]);

/** @param {PanelContext} context @param {import("./undo.js").UndoList} undo @returns {HTMLElement} */
export function makeLightControls({ actions, scene, mapView, showTab, texts: { objects: texts } }, undo) {
  const notice = new Notice();
  const choice = element("select", {});
  const empty = element("p", { className: "empty" }, texts.noLights);
  const buttons = LIGHT_STATES.map(([name, status]) => {
    const label = texts.lightStates[name];
    const act = () => {
      const title = texts.lightTitle(choice.value, label);
      const light = choice.value;
      actions.send(title, lightMessage(light, status));
      if (status >= 0) {
        undo.add(title, () => actions.send(texts.undoTitle(title), lightMessage(light, -1)));
      }
      notice.show(title);
    };
    return { status, button: new ActionButton({ label, className: `light light-${name}`, notice, act }) };
  });
  const group = element("div", { className: "button-group", role: "group", "aria-label": texts.lightGroup }, ...buttons.map(({ button }) => button.element));
  const form = element("div", { className: "form" }, labelled(texts.light, choice), group, notice.element);

  const lights = () => /** @type {MapLight[]} */ (scene.map?.lights ?? []);
  const showChoice = () => {
    const lamps = lights().find(({ name }) => name === choice.value)?.lamps ?? 0;
    for (const { status, button } of buttons) {
      button.element.hidden = status >= 0 && (lamps & status) !== status;
    }
  };
  /** @param {string} name */
  const choose = (name) => {
    choice.value = name;
    showChoice();
    buttons.find(({ button }) => !button.element.hidden)?.button.element.focus();
  };
  scene.onMap(() => {
    replaceChildren(choice, ...lights().map(({ name }) => element("option", { value: name }, name)));
    form.hidden = lights().length === 0;
    empty.hidden = !form.hidden;
    showChoice();
  });
  choice.addEventListener("change", showChoice);
  mapView?.onLight((name) => {
    showTab("objects");
    choose(name);
  });
  return element("div", {}, empty, form);
}
