// Topics of programs that the map draws, each with a switch and a colour.

import { element, replaceChildren, setText } from "../widgets/dom.js";
import { whileSeen } from "../widgets/seen.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {import("../scene/drawn_topics.js").DrawnTopic} DrawnTopic */

/** Time between two updates of the ages [ms]. */
const AGE_INTERVAL = 500;

/** @param {PanelContext} context @returns {{element: HTMLElement, title: string}} */
export function makeDrawnPanel({ drawn, mapView, texts: { drawn: texts } }) {
  const empty = element("p", { className: "empty" }, mapView === null ? texts.noMap : texts.empty);
  const list = element("ul", { className: "drawn-topics" });
  const panel = element("div", {}, element("p", { className: "hint" }, texts.hint), empty, list);
  /** @type {Map<DrawnTopic, ReturnType<typeof makeRow>>} */
  const rows = new Map();
  const show = () => {
    const topics = [...drawn.topics.values()];
    if (topics.length !== rows.size || topics.some((topic) => !rows.has(topic))) {
      const old = new Map(rows);
      rows.clear();
      topics.forEach((topic) => rows.set(topic, old.get(topic) ?? makeRow(drawn, topic, texts)));
      replaceChildren(list, ...[...rows.values()].map((row) => row.element));
      empty.hidden = topics.length > 0;
    }
    rows.forEach((row) => row.update());
  };
  whileSeen(panel, () => {
    show();
    const timer = setInterval(show, AGE_INTERVAL);
    return () => clearInterval(timer);
  });
  return { title: texts.title, element: panel };
}

/**
 * @param {import("../scene/drawn_topics.js").DrawnTopics} drawn @param {DrawnTopic} topic
 * @param {PanelContext["texts"]["drawn"]} texts
 */
function makeRow(drawn, topic, texts) {
  const box = element("input", { type: "checkbox" });
  const colour = element("input", { type: "color", value: topic.colour, "aria-label": texts.colour(topic.name) });
  const keep = element(
    "select",
    { "aria-label": texts.keep(topic.name) },
    ...Object.entries(texts.keeps).map(([value, text]) => element("option", { value }, text)),
  );
  const state = element("span", { className: "hint" });
  const note = element("p", { className: "notice", dataset: { kind: "warn" }, hidden: true });
  box.onchange = () => drawn.switch(topic, box.checked);
  colour.oninput = () => drawn.setColour(topic, colour.value);
  keep.onchange = () => drawn.setKeep(topic, Number(keep.value));
  const update = () => {
    box.checked = topic.isOn === true;
    const text = topic.kept.size > 0 ? texts.age(Math.max(drawn.time - topic.at, 0).toFixed(1)) : texts.waiting;
    setText(state, `${topic.type}${topic.isOn ? `, ${text}` : ""}`);
    const why = topic.note === "frame" ? texts.notes.frame(topic.frame) : topic.note && texts.notes[topic.note];
    setText(note, why);
    note.hidden = why === "";
  };
  const row = element("li", {}, element("label", {}, box, element("span", {}, topic.name)), colour, keep, state, note);
  return { element: row, update };
}
