// The list of snapshots: take one, go back to one, remove one.

import { snapshotsRequest } from "../wire/requests.js";
import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { element, replaceRows } from "../widgets/dom.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** @param {PanelContext} context @returns {HTMLElement} */
export function makeSnapshotList({ connection, time, timeControls: controls, texts: { time: texts } }) {
  const notice = new Notice();
  const name = element("input", { type: "text", maxLength: 100, placeholder: texts.snapshots.nameHint });
  const list = element("ul", { className: "rows" });
  /** @type {ActionButton[]} */
  let goBack = [];

  const refresh = async () => {
    const { name: service, values } = snapshotsRequest();
    showList((await connection.call(service, values)).snapshots);
  };
  const take = new ActionButton({
    ...texts.buttons.snapshot,
    notice,
    act: async () => {
      const answer = await controls.snapshot(name.value.trim());
      name.value = "";
      notice.show(texts.snapshots.taken(answer.id, Number(answer.frame)));
      await refresh();
    },
  });

  /** @param {{id: string, frame: number, size: number}[]} snapshots */
  const showList = (snapshots) => {
    goBack = [];
    const rows = [...snapshots].reverse().map(({ id, frame, size }) => {
      const restore = new ActionButton({
        ...texts.buttons.restore,
        name: texts.snapshots.restoreName(id),
        notice,
        act: async () => {
          const answer = await controls.restore(id);
          notice.show(texts.snapshots.restored(id, Number(answer.frame)));
        },
      });
      const remove = new ActionButton({
        ...texts.buttons.removeSnapshot,
        name: texts.snapshots.removeName(id),
        notice,
        act: async () => {
          await controls.removeSnapshot(id);
          await refresh();
        },
      });
      goBack.push(restore);
      const about = texts.snapshots.about(Number(frame), Number(size));
      return element(
        "li",
        {},
        element("span", { className: "row-name" }, id, " ", element("small", {}, about)),
        restore.element,
        remove.element,
      );
    });
    replaceRows(list, take.element, ...(rows.length ? rows : [element("li", { className: "empty" }, texts.snapshots.empty)]));
    showReasons();
  };
  const showReasons = () => {
    take.setReason(time.reasons.snapshot);
    for (const button of goBack) {
      button.setReason(time.reasons.restore);
    }
  };
  time.onChange(showReasons);
  connection.onState((state) => {
    if (state === "open") {
      refresh().catch((error) => notice.showError(error));
    }
  });
  const reload = new ActionButton({ ...texts.buttons.refresh, name: texts.snapshots.refreshName, notice, act: refresh });
  return element(
    "div",
    {},
    element("div", { className: "button-row" }, labelled(texts.snapshots.name, name), take.element, reload.element),
    notice.element,
    list,
  );
}
