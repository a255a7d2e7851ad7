// The catalogue of models: search one, choose what it does, and place it.

import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { element, replaceChildren, setText } from "../widgets/dom.js";
import { removeRequest, spawnRequest } from "../wire/requests.js";
import { pickOnMap, PlaceFields, withLaneHeading } from "./placing.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {{name: string, kind: string, can_be_ego: boolean, length: number, width: number}} ModelInfo */
/** @typedef {import("../wire/requests.js").MapPlace} MapPlace */

/** So many rows of the list are shown at once. */
const LIST_ROWS = 6;

const KMH_IN_MPS = 1 / 3.6;

/** Models that have all words of a search in their name or kind. @param {ModelInfo[]} models @param {string} search */
export function searchModels(models, search) {
  const words = search.toLowerCase().split(/\s+/u).filter(Boolean);
  return models.filter(({ name, kind }) => words.every((word) => `${name} ${kind}`.toLowerCase().includes(word)));
}

/** @param {PanelContext} context @param {import("./undo.js").UndoList} undo @returns {HTMLElement} */
export function makeCatalogue(context, undo) {
  const { connection, actions, mapView, texts: { objects: texts } } = context;
  const notice = new Notice();
  /** @type {ModelInfo[]} */
  let models = [];
  const search = element("input", { type: "search", autocomplete: "off" });
  const list = element("select", { size: LIST_ROWS, className: "catalogue" });
  // Browsers drag no option out of a list, so the chosen model stands beside the button, too.
  const handle = element("span", { className: "drag-model", draggable: true, title: texts.dragHint, hidden: true });
  const behaviour = element("select", {}, ...Object.entries(texts.behaviours).map(([value, label]) => element("option", { value }, label)));
  const speed = element("input", { type: "number", value: "0", min: "-300", max: "300", step: "any" });
  const isEgo = element("input", { type: "checkbox" });
  const place = new PlaceFields(context);

  const chosen = () => models.find(({ name }) => name === list.value) ?? null;
  const showModels = () => {
    const { value } = list;
    const found = searchModels(models, search.value);
    replaceChildren(
      list,
      ...found.map(({ name, kind, length, width }) =>
        element("option", { value: name }, texts.model(name, texts.kinds[kind] ?? kind, length, width))),
    );
    list.value = found.some(({ name }) => name === value) ? value : (found[0]?.name ?? "");
    showChoice();
  };
  const showChoice = () => {
    const model = chosen();
    isEgo.disabled = !model?.can_be_ego;
    isEgo.checked &&= !isEgo.disabled;
    const reason = model ? "" : texts.noModel;
    setText(handle, `⠿ ${model?.name ?? ""}`);
    handle.hidden = !model || !mapView;
    spawnHere.setReason(reason);
    spawnPicked.setReason(reason || (mapView ? "" : texts.noMap));
  };

  /** @param {MapPlace} at */
  const spawn = async (at) => {
    const model = chosen();
    if (!model) {
      throw new Error(texts.noModel);
    }
    const metres = Number(speed.value) * KMH_IN_MPS;
    const isDriver = behaviour.value === "lane";
    const options = {
      behaviour: behaviour.value,
      speed: isDriver || behaviour.value === "straight" ? metres : 0,
      desiredSpeed: isDriver ? Math.max(0, metres) : 0,
      isEgo: isEgo.checked,
    };
    const title = texts.spawnTitle(model.name);
    const answer = await actions.run(title, spawnRequest(model.name, at, options));
    const ids = Array.from(/** @type {number[]} */ (answer.unique_ids));
    undo.add(title, () => actions.run(texts.undoTitle(title), removeRequest(ids)));
    notice.show(texts.spawned(model.name, ids.join(", ")));
  };
  const spawnHere = new ActionButton({ ...texts.spawnAt, notice, act: () => spawn(place.place) });
  const spawnPicked = new ActionButton({
    ...texts.spawnPick,
    className: "primary",
    notice,
    act: async () => {
      const at = await pickOnMap(context, texts.pickHint);
      if (at) {
        place.show(at);
        await spawn(at);
      }
    },
  });
  search.addEventListener("input", showModels);
  list.addEventListener("change", showChoice);
  listenForDrops(context, handle, (at) => spawn(at).catch((error) => notice.showError(error)));
  connection.onState((state) => {
    if (state === "open") {
      connection
        .call("/sim/catalogue")
        .then((answer) => {
          models = answer.models;
          showModels();
        })
        .catch((error) => notice.showError(error));
    }
  });
  showModels();
  return element(
    "div",
    { className: "form" },
    labelled(texts.search, search),
    labelled(texts.catalogue, list, mapView ? texts.dragHint : ""),
    element("div", { className: "button-row" }, labelled(texts.behaviour, behaviour), labelled(texts.speed, speed), labelled(texts.isEgo, isEgo)),
    element("div", { className: "button-row" }, spawnPicked.element, handle),
    element("details", {}, element("summary", {}, texts.byNumbers), place.element, spawnHere.element),
    notice.element,
  );
}

/**
 * Take the chosen model when it is dragged onto the map.
 * @param {PanelContext} context @param {HTMLElement} handle - that is dragged @param {(place: MapPlace) => void} take
 */
function listenForDrops({ mapView, ego }, handle, take) {
  if (mapView === null) {
    return;
  }
  const kind = "application/x-rosbridge-sim-model";
  handle.addEventListener("dragstart", (event) => {
    if (event.dataTransfer) {
      event.dataTransfer.setData(kind, "");
      event.dataTransfer.effectAllowed = "copy";
    }
  });
  mapView.onDrop(kind, (place) => take(withLaneHeading({ ...place, heading: null }, ego)));
}
