// The card over the map until somebody commands the ego: what this is, and three ways to begin.

import { ActionButton, Notice } from "../widgets/action_button.js";
import { closeButton, element, setText } from "../widgets/dom.js";
import { firstProgram } from "../wire/code.js";
import { controlModeRequest } from "../wire/requests.js";
import { copyText } from "./code.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** Control mode in which the ego drives itself. */
const SELF_DRIVING = 6;

/** @param {PanelContext} context @param {import("./driving.js").Driving} driving @returns {HTMLElement} */
export function makeStartCard(context, driving) {
  const { connection, scene, time, timeControls, drivers, ego, actions, mapView, showTab, texts: { start: texts } } = context;
  const title = element("h2", {});
  const about = element("p", {});
  const notice = new Notice();
  const program = element("code", {});
  const listing = element("pre", { className: "code", tabIndex: 0, "aria-label": texts.program, hidden: true }, program);
  const letDrive = new ActionButton({
    ...texts.letDrive,
    className: "primary",
    notice,
    act: async () => {
      mapView?.setCamera("chase");
      await actions.run(texts.letDrive.label, controlModeRequest(ego.number, SELF_DRIVING));
      await timeControls.letRun();
    },
  });
  const drive = new ActionButton({
    ...texts.drive,
    className: "primary",
    notice,
    act: () => {
      mapView?.setCamera("chase");
      showTab("ego");
      return driving.session.isOn ? undefined : driving.toggle();
    },
  });
  const copy = new ActionButton({
    ...texts.copy,
    className: "primary",
    notice,
    act: async () => {
      const isInSteps = time.state.kind === "synchronous";
      setText(program, firstProgram({ address: connection.url, hasToken: connection.hasToken, isInSteps }));
      listing.hidden = false;
      await copyText(program);
      notice.show(texts.copied);
    },
  });
  const buttons = [letDrive, drive, copy].map((button) => button.element);
  const card = element(
    "section",
    { className: "start-card", "aria-label": texts.label, hidden: true },
    closeButton(texts.close, () => {
      isDone = true;
      show();
    }),
    title,
    about,
    element("div", { className: "start-buttons" }, ...buttons),
    notice.element,
    listing,
  );

  /** The scenario and connection for which the card is done: the ego was commanded, or the user has closed it. */
  let isDone = false;
  let shown = "";
  const show = () => {
    const { state } = scene;
    const scenario = state?.scenario ?? "";
    if (scenario !== shown) {
      shown = scenario;
      isDone = false;
      listing.hidden = true;
      notice.show("");
    }
    const driver = drivers.ofEgo(ego.number)?.driver ?? "";
    isDone ||= driver !== "" && driver !== "nobody";
    card.hidden = isDone || driver === "" || scenario === "" || driving.session.isOn || time.state.isReplay;
    if (!card.hidden && state !== null) {
      setText(title, scenario);
      const count = (/** @type {number} */ kind) => state.kind.reduce((sum, one) => sum + (one === kind ? 1 : 0), 0);
      setText(about, texts.about[scenario] ?? texts.counts(count(1), count(2)));
      letDrive.setReason(time.reasons.drive);
      drive.setReason(time.reasons.drive);
    }
  };
  scene.onState(() => scene.state?.scenario === shown || show());
  drivers.onChange(show);
  time.onChange(show);
  driving.onChange((isOn) => {
    isDone ||= isOn;
    show();
  });
  return card;
}
