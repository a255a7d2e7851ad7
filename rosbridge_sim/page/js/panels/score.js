// The score of the chosen ego. Scores cost a little and are part of the state hash, so the page asks before it starts
// them: it subscribes only after the button.

import { scoreRequest } from "../wire/requests.js";
import { ActionButton, Notice } from "../widgets/action_button.js";
import { element, setText } from "../widgets/dom.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** A score changes slowly; twice a second is easy to read [ms]. */
const SCORE_THROTTLE = 500;
/** Fields of EgoScore that are shown, with the digits behind the point and the unit. */
const SCORE_FIELDS = /** @type {const} */ ([
  ["distance", 1, "m"],
  ["collisions", 0, ""],
  ["red_lights", 0, ""],
  ["stop_lines", 0, ""],
  ["lane_invasions", 0, ""],
  ["off_road_time", 1, "s"],
  ["min_time_to_collision", 1, "s"],
  ["mean_lane_offset", 2, "m"],
  ["max_jerk", 1, "m/s³"],
  ["max_lateral_accel", 1, "m/s²"],
]);

/** @param {PanelContext} context @returns {{element: HTMLElement, title: string}} */
export function makeScorePanel({ connection, actions, ego, time, texts: { score: texts, time: { nextStep } } }) {
  const notice = new Notice();
  const values = new Map(SCORE_FIELDS.map(([name]) => [name, element("dd", {})]));
  const figures = SCORE_FIELDS.map(([name]) => element("div", {}, element("dt", {}, texts.fields[name]), values.get(name)));
  const list = element("dl", { className: "figures", hidden: true }, ...figures);
  const hint = element("p", { className: "hint" }, texts.hint);
  /** @type {{close: () => void} | null} */
  let subscription = null;
  let hasScore = false;
  const showHint = () => {
    setText(hint, subscription === null ? texts.hint : nextStep);
    hint.hidden = subscription !== null && (hasScore || !time.isStanding);
  };
  time.onChange(showHint);

  /** @param {{scores: Record<string, number>[]}} message */
  const show = ({ scores }) => {
    const score = scores.find(({ unique_id: id }) => id === ego.number);
    hasScore = score !== undefined;
    showHint();
    for (const [name, digits, unit] of SCORE_FIELDS) {
      const value = score?.[name];
      const isKnown = value !== undefined && !(name === "min_time_to_collision" && value < 0);
      setText(/** @type {HTMLElement} */ (values.get(name)), isKnown ? `${Number(value).toFixed(digits)} ${unit}`.trim() : texts.none);
    }
  };
  connection.onState(() => show({ scores: [] })); // another server counts anew
  const toggle = new ActionButton({
    ...texts.start,
    notice,
    act: () => {
      if (subscription) {
        subscription.close();
        subscription = null;
      } else {
        subscription = connection.subscribe("/sim/score", "rosbridge_sim_msgs/Scores", show, { throttleMs: SCORE_THROTTLE, queueLength: 1 });
      }
      const isOn = subscription !== null;
      list.hidden = reset.element.hidden = !isOn;
      showHint();
      toggle.setFace(isOn ? texts.stop : texts.start);
    },
  });
  const reset = new ActionButton({ ...texts.reset, notice, act: () => actions.run(texts.reset.label, scoreRequest(true)) });
  reset.element.hidden = true;
  return {
    element: element("div", {}, hint, element("div", { className: "button-row" }, toggle.element, reset.element), notice.element, list),
    title: texts.title,
  };
}
