// The panel "Log": log lines, statuses of the server, and refused requests of all clients.

import { labelled } from "../widgets/action_button.js";
import { element, replaceChildren, setText } from "../widgets/dom.js";
import { whileSeen } from "../widgets/seen.js";
import { cutText } from "../widgets/tree_rows.js";
import { stampSeconds } from "./ego_values.js";
import { LOG_LEVELS, LogStore, RefusalReader, rosoutLevel } from "./log_store.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {import("./log_store.js").LogLevel} LogLevel */
/** @typedef {import("./log_store.js").LogLine} LogLine */

/** Shortest time between two drawings [ms]. */
const LOG_INTERVAL = 250;
/** Lines on the screen; more are found by a search. */
const SHOWN_LINES = 200;
/** Log lines that may wait on the server, so that a burst is not lost. */
const ROSOUT_QUEUE = 100;
/** A mistake is told over the map for so long [ms], and so many at once; the badge counts all. */
const TOAST_SHOWN = 8000;
const MOST_TOASTS = 3;
/** Characters of a mistake over the map. */
const TOAST_LENGTH = 240;

/**
 * @param {PanelContext} context @param {import("../layout.js").Layout} layout @returns {{element: HTMLElement, title: string}}
 */
export function makeLogPanel({ connection, scene, showTab, texts: { log: texts } }, layout) {
  const store = new LogStore();
  const list = element("ol", { className: "log-lines", "aria-label": texts.title, tabIndex: 0 });
  const note = element("p", { className: "hint" });
  const level = element("select", {}, ...LOG_LEVELS.map((name) => element("option", { value: name, selected: name === "info" }, texts.levels[name])));
  const search = element("input", { type: "search" });
  const hold = element("button", { type: "button", "aria-pressed": "false", title: texts.holdTitle }, texts.hold);
  const clear = element("button", { type: "button" }, texts.clear);
  let isHeld = false;
  let isSeen = false;
  /** @type {any} */
  let timer = null;

  const draw = () => {
    timer = null;
    if (isSeen && !isHeld) {
      const lines = store.find(/** @type {LogLevel} */ (level.value), search.value, SHOWN_LINES);
      replaceChildren(list, ...lines.map((line) => makeLine(line, texts.levels)));
      setText(note, lines.length === 0 ? texts.empty : "");
    }
  };
  const drawSoon = () => {
    timer ??= setTimeout(draw, LOG_INTERVAL);
  };
  store.onChange = () => void (isSeen && drawSoon());
  level.addEventListener("change", draw);
  search.addEventListener("input", drawSoon);
  clear.addEventListener("click", () => store.clear());
  hold.addEventListener("click", () => {
    isHeld = !isHeld;
    hold.setAttribute("aria-pressed", String(isHeld));
    setText(hold, isHeld ? texts.go : texts.hold);
    draw();
  });
  const refusals = new RefusalReader(store, texts.statusSource);
  /** Mistakes since the panel was seen. */
  let unseen = 0;
  const showBadge = () => layout.tabs.setBadge("log", unseen, texts.unseen(unseen));
  const toasts = element("div", { className: "toasts", role: "status" });
  layout.stage.append(toasts);
  let isFirst = true; // what was before this connection is counted, and not told
  connection.onState((state) => {
    if (state === "open") {
      refusals.forget();
      isFirst = true;
    }
  });
  refusals.onNew = (text) => {
    if (!isFirst) {
      scene.timeline.mark("refusal", cutText(text, TOAST_LENGTH));
    }
    if (isSeen) {
      return;
    }
    unseen += 1;
    if (!isFirst && toasts.childElementCount < MOST_TOASTS) {
      const toast = element("button", { type: "button", className: "toast", title: texts.openLog }, cutText(text, TOAST_LENGTH));
      toast.onclick = () => showTab("log");
      toasts.append(toast);
      setTimeout(() => toast.remove(), TOAST_SHOWN);
    }
  };
  connection.subscribe("/sim/refusals", "rosbridge_sim_msgs/Refusals", (message) => {
    refusals.take(message);
    isFirst = false;
    showBadge();
  });
  connection.onStatus(({ level: given, msg }) => {
    const known = LOG_LEVELS.find((name) => name === given) ?? (given === "none" ? "debug" : "info");
    refusals.takeStatus(known, msg, Date.now() / 1000);
  });

  const panel = element(
    "div",
    { className: "log-panel" },
    element("p", { className: "hint" }, texts.hint),
    element("div", { className: "button-row" }, labelled(texts.level, level), labelled(texts.search, search), hold, clear),
    note,
    list,
  );
  whileSeen(panel, () => {
    isSeen = true;
    unseen = 0;
    showBadge();
    replaceChildren(toasts);
    draw();
    const lines = connection.subscribe("/rosout", "", (message) => refusals.takeLine(...rosoutLine(message)), { queueLength: ROSOUT_QUEUE });
    return () => {
      isSeen = false;
      lines.close();
    };
  });
  return { title: texts.title, element: panel };
}

/** @param {any} message - of `/rosout`, of either ROS generation @returns {[LogLevel, string, string, number]} */
function rosoutLine(message) {
  const isRos2 = message.stamp !== undefined;
  const time = stampSeconds(isRos2 ? message.stamp : message.header?.stamp);
  return [rosoutLevel(Number(message.level), isRos2), String(message.name), String(message.msg), time];
}

/** @param {LogLine} line @param {Record<LogLevel, string>} levels */
function makeLine(line, levels) {
  return element(
    "li",
    { className: "log-line", dataset: { level: line.level } },
    element("time", {}, new Date(line.time * 1000).toLocaleTimeString([], { hour12: false })),
    element("span", { className: "log-level" }, levels[line.level]),
    element("span", { className: "log-source" }, line.source),
    element("span", { className: "log-text" }, line.text + (line.count > 1 ? ` ×${line.count}` : "")),
  );
}
