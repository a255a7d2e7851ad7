// The panel "Graph": topics, services and clients of the server.

import { element } from "../../widgets/dom.js";
import { Tabs } from "../../widgets/tabs.js";
import { makeClientsPart } from "./clients.js";
import { makeServicesPart } from "./services.js";
import { makeTopicsPart } from "./topics.js";

/** @typedef {import("../context.js").PanelContext} PanelContext */

/** @param {PanelContext} context @returns {{element: HTMLElement, title: string}} */
export function makeGraphPanel(context) {
  const { graph: texts } = context.texts;
  const tabs = new Tabs(texts.title, [
    { id: "topics", title: texts.topics.title },
    { id: "services", title: texts.services.title },
    { id: "clients", title: texts.clients.title },
  ]);
  tabs.panelOf("topics").append(makeTopicsPart(context));
  tabs.panelOf("services").append(makeServicesPart(context));
  tabs.panelOf("clients").append(makeClientsPart(context));
  return { title: texts.title, element: element("div", { className: "graph-panel" }, tabs.list, tabs.panels) };
}
