// Replays: play a recording of the server, with a slider for the place in it.

import { ActionButton, labelled, Notice } from "../widgets/action_button.js";
import { chooseNumber, element, replaceChildren } from "../widgets/dom.js";
import { Scrubber } from "../widgets/scrubber.js";
import { REPLAY_COMMANDS } from "../wire/requests.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {{state: string, name: string, duration: number, position: number, speed: number}} ReplayMessage */

/** Positions of the slider: a tenth of a second [s]. */
const SLIDER_STEP = 0.1;
/** Speeds that the simulator has, of 1 to 10. */
const SPEEDS = [1, 2, 4, 10];
/** @type {Readonly<ReplayMessage>} */
const NO_REPLAY = Object.freeze({ state: "none", name: "", duration: 0, position: 0, speed: 1 });

/** @param {PanelContext} context @returns {HTMLElement} */
export function makeReplayControls({ connection, files, time, timeControls: controls, texts: { time: texts } }) {
  const notice = new Notice();
  const file = element("select", {});
  const speed = element("select", {}, ...SPEEDS.map((factor) => element("option", { value: String(factor) }, texts.factorName(factor))));
  /** @type {Readonly<ReplayMessage>} */
  let replay = NO_REPLAY;

  const isOn = () => replay.state !== "none";
  const play = new ActionButton({
    ...texts.replay.play,
    notice,
    act: () => {
      const isNew = !isOn() || file.value !== replay.name;
      const options = { speed: Number(speed.value), ...(isNew ? { file: file.value, startMs: 0 } : {}) };
      return controls.replay(texts.replay.playTitle(file.value), REPLAY_COMMANDS.play, options);
    },
  });
  const pause = new ActionButton({ ...texts.replay.pause, notice, act: () => controls.replay(texts.replay.pause.title, REPLAY_COMMANDS.pause) });
  const stop = new ActionButton({ ...texts.replay.stop, notice, act: () => controls.replay(texts.replay.stop.title, REPLAY_COMMANDS.stop) });
  /** @param {number} seconds */
  const seek = async (seconds) => {
    const command = replay.state === "playing" ? REPLAY_COMMANDS.play : REPLAY_COMMANDS.pause;
    try {
      await controls.replay(texts.replay.seekTitle(seconds.toFixed(1)), command, { startMs: seconds * 1000 });
    } catch (error) {
      notice.showError(error);
    }
  };
  const scrubber = new Scrubber({
    label: texts.replay.position,
    step: SLIDER_STEP,
    clock: (seconds) => (isOn() ? texts.replay.clock(seconds.toFixed(1), replay.duration.toFixed(1)) : ""),
    onChange: (seconds) => void seek(seconds),
  });
  const show = () => {
    const none = files.recordings.length || isOn() ? "" : texts.replay.noFiles;
    play.setReason(time.reasons.replay || none || (replay.state === "playing" && file.value === replay.name ? texts.replay.plays : ""));
    pause.setReason(time.reasons.replay || (replay.state === "playing" ? "" : texts.replay.none));
    stop.setReason(time.reasons.replay || (isOn() ? "" : texts.replay.none));
    scrubber.show({ from: 0, to: replay.duration, time: replay.position, isDisabled: !isOn() || time.reasons.replay !== "" });
  };
  const showFiles = () => {
    const { value } = file;
    const names = files.recordings.map(({ name }) => name);
    if (replay.name && !names.includes(replay.name)) {
      names.push(replay.name);
    }
    replaceChildren(file, ...names.map((name) => element("option", { value: name }, name)));
    file.value = names.includes(value) ? value : (names[0] ?? "");
    show();
  };
  /** @param {ReplayMessage} message */
  const take = (message) => {
    const isOther = message.name !== replay.name;
    if (message.state !== "none" && message.speed !== replay.speed) { // another client may have set it
      chooseNumber(speed, message.speed, texts.factorName);
    }
    replay = message;
    if (isOther) {
      showFiles();
      file.value = message.name || file.value;
    }
    show();
  };
  connection.subscribe("/sim/replay", "rosbridge_sim_msgs/Replay", take, { throttleMs: 200, queueLength: 1 });
  connection.onState((state) => state !== "open" && take(NO_REPLAY));
  file.addEventListener("change", show);
  files.onChange(showFiles);
  time.onChange(show);
  return element(
    "div",
    {},
    element("div", { className: "button-row" }, labelled(texts.replay.file, file), labelled(texts.replay.speed, speed)),
    element("div", { className: "button-row" }, play.element, pause.element, stop.element),
    scrubber.element,
    notice.element,
  );
}
