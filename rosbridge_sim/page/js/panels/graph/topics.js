// Topics with their traffic, and the chosen one.

import { element } from "../../widgets/dom.js";
import { whileSeen } from "../../widgets/seen.js";
import { DataTable } from "../../widgets/table.js";
import { makeFaultsTable } from "./faults.js";
import { bytesText, rateText } from "./figures.js";
import { TopicView } from "./topic_view.js";

/** @typedef {import("../context.js").PanelContext} PanelContext */
/** @typedef {{name: string, type: string, rate: number, bytes_per_second: number, size: number, publishers: string[], subscribers: string[], dropped: number, is_latched: boolean}} TopicInfo */

/** @param {PanelContext} context @returns {HTMLElement} */
export function makeTopicsPart(context) {
  const { connection, texts: { graph: texts } } = context;
  const view = new TopicView(context, () => table.mark(""));
  /** @type {DataTable<TopicInfo>} */
  const table = new DataTable({
    label: texts.topics.title,
    search: texts.topics.search,
    empty: texts.topics.empty,
    more: texts.more,
    keyOf: (topic) => topic.name,
    choose: (topic) => {
      const isSame = table.chosen === topic.name;
      table.mark(isSame ? "" : topic.name);
      view.choose(isSame ? null : topic);
    },
    columns: [
      { key: "name", title: texts.topics.name, value: (topic) => topic.name, hint: (topic) => topic.type },
      { key: "rate", title: texts.topics.rate, value: (topic) => Number(topic.rate), text: (topic) => rateText(Number(topic.rate)) },
      {
        key: "size",
        title: texts.topics.size,
        value: (topic) => Number(topic.size),
        text: (topic) => (Number(topic.size) > 0 ? bytesText(Number(topic.size)) : "–"),
      },
      { key: "publishers", title: texts.topics.publishers, value: (topic) => topic.publishers.length },
      { key: "subscribers", title: texts.topics.subscribers, value: (topic) => topic.subscribers.length },
      { key: "dropped", title: texts.topics.dropped, value: (topic) => Number(topic.dropped), isMinor: true },
    ],
  });
  const faults = makeFaultsTable(context);
  const part = element("div", { className: "graph-part" }, faults.element, table.element, view.element);
  whileSeen(part, () => {
    let unwatch = () => {};
    let isMock = false;
    const taker = connection.subscribe("/sim/topics", "rosbridge_sim_msgs/Topics", (message) => {
      table.show(message.topics);
      view.update(message.topics.find((/** @type {TopicInfo} */ topic) => topic.name === table.chosen) ?? null);
      if (!isMock && message.topics.some((/** @type {TopicInfo} */ topic) => topic.name === "/mock/faults")) {
        isMock = true;
        unwatch = faults.watch();
      }
    });
    return () => {
      unwatch();
      taker.close();
    };
  });
  return part;
}
