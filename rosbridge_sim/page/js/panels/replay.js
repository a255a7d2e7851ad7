// Replays: play a recording of the server, with a slider for the place in it.

import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { element } from "../widgets/dom.js";
import { REPLAY_COMMANDS } from "../wire/requests.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/**
 * @param {PanelContext} context
 * @returns {HTMLElement}
 */
export function makeReplayControls({ time, timeControls: controls, texts: { time: texts } }) {
  const notice = new Notice();
  const file = element("input", { type: "text", autocomplete: "off" });
  const speed = element("select", {}, ...[1, 2, 4, 10].map((factor) => element("option", { value: String(factor) }, `${factor} ×`)));
  const play = new ActionButton({
    ...texts.replay.play,
    notice,
    act: () => controls.replay(texts.replay.play.label, REPLAY_COMMANDS.play, time.state.isReplay ? {} : { file: file.value.trim(), startMs: 0, speed: Number(speed.value) }),
  });
  const pause = new ActionButton({ ...texts.replay.pause, notice, act: () => controls.replay(texts.replay.pause.label, REPLAY_COMMANDS.pause) });
  const stop = new ActionButton({ ...texts.replay.stop, notice, act: () => controls.replay(texts.replay.stop.label, REPLAY_COMMANDS.stop) });
  time.onChange(() => {
    play.setReason(time.reasons.replay);
    const reason = time.reasons.replay || (time.state.isReplay ? "" : texts.replay.none);
    pause.setReason(reason);
    stop.setReason(reason);
  });
  return element(
    "div",
    {},
    element("div", { className: "button-row" }, labelled(texts.replay.file, file), labelled(texts.replay.speed, speed)),
    element("div", { className: "button-row" }, play.element, pause.element, stop.element),
    notice.element,
  );
}
