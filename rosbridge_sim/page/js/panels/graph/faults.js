// Faults of a mock, which a click switches; hidden on a server that runs none.

import { element } from "../../widgets/dom.js";
import { DataTable } from "../../widgets/table.js";

/** @typedef {import("../context.js").PanelContext} PanelContext */
/** @typedef {{name: string, kind: string, active: boolean, patterns: string[], count: number | bigint}} MockFault */

/**
 * @param {PanelContext} context
 * @returns {{element: HTMLElement, watch: () => () => void}} watch: follow the faults until the returned function is called
 */
export function makeFaultsTable({ connection, actions, texts: { graph: { faults: texts, more } } }) {
  /** @type {MockFault[]} */
  let shown = [];
  /** @type {DataTable<MockFault>} */
  const table = new DataTable({
    label: texts.title,
    search: texts.search,
    empty: texts.empty,
    more,
    keyOf: (fault) => fault.name,
    choose: ({ name }) => {
      const active = !shown.find((fault) => fault.name === name)?.active;
      const request = { name, active, rule: "" };
      actions.call(texts.action(name, active), "/mock/set_fault", "rosbridge_sim_msgs/SetMockFault", request).catch(() => undefined);
    },
    columns: [
      { key: "name", title: texts.name, value: (fault) => fault.name, hint: (fault) => fault.patterns.join(" ") },
      { key: "kind", title: texts.kind, value: (fault) => fault.kind },
      { key: "now", title: texts.now, value: (fault) => (fault.active ? texts.on : texts.off) },
      { key: "count", title: texts.count, value: (fault) => Number(fault.count) },
    ],
  });
  const part = element("div", { className: "mock-faults" }, element("h3", {}, texts.title), table.element);
  part.hidden = true;
  const watch = () => {
    const taker = connection.subscribe("/mock/faults", "rosbridge_sim_msgs/MockFaults", (message) => {
      shown = message.faults;
      part.hidden = !shown.length;
      table.show(shown);
    });
    return () => taker.close();
  };
  return { element: part, watch };
}
