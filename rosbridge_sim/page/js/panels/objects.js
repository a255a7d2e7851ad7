// The panel "Objects": place objects, move and remove them, set lights, and take changes back.

import { ActionButton, Notice } from "../widgets/action_button.js";
import { element, setText } from "../widgets/dom.js";
import { moveRequest, removeRequest } from "../wire/requests.js";
import { makeCatalogue } from "./catalogue.js";
import { makeLightControls } from "./lights.js";
import { pickOnMap, PlaceFields } from "./placing.js";
import { UndoList } from "./undo.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {import("../wire/requests.js").MapPlace} MapPlace */

/** Number of `kind` in the state of the scene. */
const EGO_KIND = 0;

/** @param {PanelContext} context @returns {{element: HTMLElement, title: string}} */
export function makeObjectsPanel(context) {
  const { scene, texts: { objects: texts } } = context;
  const undo = new UndoList();
  const notice = new Notice();
  const back = new ActionButton({ ...texts.undo, notice, act: () => undo.undo() });
  undo.onChange(() => {
    const last = undo.steps.at(-1);
    back.setReason(last ? "" : texts.nothingToUndo);
    back.element.setAttribute("aria-label", last ? texts.undoTitle(last.title) : texts.undo.label);
  });
  scene.onMap(() => undo.clear());
  const part = (/** @type {string} */ title, /** @type {HTMLElement} */ content) =>
    element("section", { className: "subsection", "aria-label": title }, element("h3", {}, title), content);
  return {
    title: texts.title,
    element: element(
      "div",
      { className: "objects-panel" },
      element("div", { className: "button-row" }, back.element),
      notice.element,
      part(texts.placeTitle, makeCatalogue(context, undo)),
      part(texts.selectedTitle, makeSelected(context, undo)),
      part(texts.lightsTitle, makeLightControls(context, undo)),
    ),
  };
}

/** The object that is moved or removed: the selected one, or the ego of the panels. @param {PanelContext} context */
function targetOf({ scene, ego, texts: { objects: texts } }) {
  const row = scene.selectedRow();
  const isSelected = row >= 0 && scene.state !== null;
  const id = isSelected && scene.state ? Number(scene.state.id[row]) : ego.number;
  const kind = isSelected && scene.state ? Number(scene.state.kind[row]) : EGO_KIND;
  const isEgo = kind === EGO_KIND;
  return { id, isEgo, isFirstEgo: isEgo && id === 0, isSelected, name: texts.objectName(texts.kindNames[kind] ?? "", id) };
}

/** @param {PanelContext} context @param {UndoList} undo */
function makeSelected(context, undo) {
  const { scene, actions, mapView, ego, texts: { objects: texts } } = context;
  const notice = new Notice();
  const name = element("p", {});
  const fields = new PlaceFields(context);

  /** @param {number} id @param {boolean} isEgo @returns {MapPlace | null} */
  const placeOf = (id, isEgo) => {
    const row = scene.indexOf(id, isEgo);
    const { state } = scene;
    return row < 0 || !state ? null : { x: Number(state.x[row]), y: Number(state.y[row]), heading: Number(state.heading[row]) };
  };
  /** @param {MapPlace} place */
  const move = async (place) => {
    scene.showPast(null); // what moves is where it is now
    const target = targetOf(context);
    const before = placeOf(target.id, target.isEgo);
    const title = texts.moveTitle(target.name);
    await actions.run(title, moveRequest(target.id, place));
    if (before) {
      undo.add(title, () => actions.run(texts.undoTitle(title), moveRequest(target.id, before)));
    }
    notice.show(texts.moved(target.name));
  };
  const movePicked = new ActionButton({
    ...texts.movePick,
    notice,
    act: async () => {
      const place = await pickOnMap(context, texts.moveHint);
      if (place) {
        fields.show(place);
        await move(place);
      }
    },
  });
  movePicked.setReason(mapView ? "" : texts.noMap);
  const moveHere = new ActionButton({ ...texts.moveAt, notice, act: () => move(fields.place) });
  const remove = new ActionButton({
    ...texts.remove,
    className: "danger",
    notice,
    act: async () => {
      const target = targetOf(context);
      await actions.run(texts.removeTitle(target.name), removeRequest([target.id]));
      notice.show(texts.removed(target.name));
    },
  });
  const show = () => {
    const target = targetOf(context);
    setText(name, target.isSelected ? target.name : texts.noneSelected(target.name));
    remove.setReason(!target.isSelected ? texts.selectFirst : target.isFirstEgo ? texts.firstEgo : "");
  };
  scene.onSelect(show);
  scene.onState(show);
  ego.onChoice(show);
  show();
  return element(
    "div",
    { className: "form" },
    name,
    element("div", { className: "button-row" }, movePicked.element, remove.element),
    element("details", {}, element("summary", {}, texts.byNumbers), fields.element, moveHere.element),
    notice.element,
  );
}
