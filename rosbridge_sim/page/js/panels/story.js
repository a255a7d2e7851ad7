// The story of the scenario, from `/sim/story`: acts, events and conditions as they change, here and on the timeline.

import { stampOf } from "../scene/store.js";
import { goesOn, storyChanges } from "../scene/story_changes.js";
import { element, replaceChildren, setText } from "../widgets/dom.js";

/** @typedef {import("../scene/story_changes.js").StoryMessage} StoryMessage */

/** Time between two messages [ms]. */
const STORY_THROTTLE = 200;
/** Rows of each table; larger stories are for programs. */
const MOST_ROWS = 100;
/** Conditions that are marked on the timeline in a run; many hold again and again. */
const MOST_MARKED = 20;

/** @param {import("./context.js").PanelContext} context @returns {HTMLElement} */
export function makeStory({ connection, scene, texts: { story: texts } }) {
  const clock = element("span", {}); // it changes all the time, so screen readers should not read it
  const words = element("span", { role: "status" });
  const parts = element("tbody", {});
  const conditions = element("tbody", {});
  const node = element(
    "section",
    { className: "subsection story", "aria-label": texts.title, hidden: true },
    element("h3", {}, texts.title),
    element("p", { className: "story-line" }, clock, words),
    element("table", { "aria-label": texts.parts }, parts),
    element("h4", {}, texts.conditions),
    element("table", { "aria-label": texts.conditions }, conditions),
  );
  /** @type {StoryMessage | null} */
  let last = null;
  /** Conditions of this run that are marked. @type {Set<string>} */
  let marked = new Set();

  /** @param {StoryMessage & {header: any}} message */
  const take = (message) => {
    if (!goesOn(last, message)) {
      marked = new Set();
    }
    const changes = storyChanges(last, message).filter(({ what, name }) => {
      const isNew = what !== "holds" || (!marked.has(name) && marked.size < MOST_MARKED);
      if (what === "holds") {
        marked.add(name);
      }
      return isNew;
    });
    if (changes.length > 0) {
      scene.timeline.mark("story", changes.map(({ what, name }) => texts.changes[what](name)).join(", "), stampOf(message));
    }
    last = message;
    show(message);
  };
  /** @param {StoryMessage} message */
  const show = ({ time, is_over: isOver, verdict, elements, conditions: all }) => {
    node.hidden = false;
    const { result, group, time: at, reason } = verdict;
    setText(clock, texts.time(time.toFixed(1)));
    const judged = result && texts.verdicts[/** @type {keyof typeof texts.verdicts} */ (result)](at.toFixed(1));
    setText(words, `${isOver ? ` ${texts.over}` : ""}${judged && ` ${judged}`}${group && ` ${group}: ${reason}`}`);
    const told = elements.filter(({ kind }) => kind === "Act" || kind === "Event");
    fill(parts, told.map(({ kind, name, state, executions }) => ({
      state,
      isInner: kind === "Event",
      cells: [name, kind, `${texts.states[/** @type {keyof typeof texts.states} */ (state)]}${executions > 1 ? ` (${executions})` : ""}`],
    })));
    fill(conditions, all.map(({ name, kind, is_looked_at: isKnown, holds, value }) => ({
      state: isKnown && holds ? "running" : "standby",
      isInner: false,
      cells: [name, kind, isKnown ? `${Number(value.toPrecision(4))} ${holds ? "✓" : "–"}` : texts.notYet],
    })));
  };
  connection.onState(() => {
    last = null;
    node.hidden = true;
  });
  scene.onLive(() => {
    if (last !== null && scene.live && scene.live.scenario !== last.name) {
      last = null;
      node.hidden = true;
    }
  });
  connection.subscribe("/sim/story", "rosbridge_sim_msgs/StoryState", take, { throttleMs: STORY_THROTTLE, queueLength: 1 });
  return node;
}

/**
 * Show rows in a table; those that are there are kept, and get other texts.
 * @param {HTMLTableSectionElement} body @param {{state: string, isInner: boolean, cells: string[]}[]} rows
 */
function fill(body, rows) {
  const shown = rows.slice(0, MOST_ROWS);
  if (body.rows.length !== shown.length) {
    replaceChildren(body, ...shown.map(({ cells: [, ...others] }) => element("tr", {}, element("th", { scope: "row" }), ...others.map(() => element("td", {})))));
  }
  shown.forEach(({ state, isInner, cells }, i) => {
    const row = body.rows[i];
    row.dataset.state = state;
    row.className = isInner ? "inner" : "";
    cells.forEach((cell, k) => setText(row.cells[k], cell));
  });
}
