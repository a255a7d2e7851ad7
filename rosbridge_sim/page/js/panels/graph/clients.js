// Clients with their traffic and queues.

import { element } from "../../widgets/dom.js";
import { whileSeen } from "../../widgets/seen.js";
import { DataTable } from "../../widgets/table.js";
import { stampSeconds } from "../ego_values.js";
import { bytesText, durationText } from "./figures.js";

/** @typedef {import("../context.js").PanelContext} PanelContext */
/** @typedef {{address: string, connection_time: any, frames_received: number, frames_refused: number, messages_sent: number, bytes_sent: number, bytes_waiting: number, bytes_held: number, dropped_topics: string[], dropped_counts: ArrayLike<number | bigint>}} ClientInfo */
/** @typedef {{url: string, age: number}} BridgeStatus */

/** Topics with lost messages that are named; a client may have hundreds. */
const MAX_NAMED = 5;

/** @param {PanelContext} context @returns {HTMLElement} */
export function makeClientsPart({ connection, drivers, texts: { graph: { clients: texts, more } } }) {
  let now = 0;
  const age = (/** @type {ClientInfo} */ client) => now - stampSeconds(client.connection_time);
  /** @type {DataTable<ClientInfo>} */
  const table = new DataTable({
    label: texts.title,
    search: texts.search,
    empty: texts.empty,
    more,
    keyOf: (client) => client.address,
    columns: [
      {
        key: "address",
        title: texts.address,
        value: (client) => client.address,
        text: ({ address }) => {
          const name = drivers.nameOf(address); // the address itself stays, because it is in the log, too
          return name.includes(address) ? name : `${address} (${name})`;
        },
        hint: (client) => lostText(client, texts.lost),
      },
      { key: "time", title: texts.time, value: age, text: (client) => durationText(age(client)), isMinor: true },
      { key: "received", title: texts.received, value: (client) => Number(client.frames_received) },
      { key: "refused", title: texts.refused, value: (client) => Number(client.frames_refused) },
      { key: "sent", title: texts.sent, value: (client) => Number(client.bytes_sent), text: (client) => bytesText(Number(client.bytes_sent)) },
      { key: "waiting", title: texts.waiting, value: (client) => Number(client.bytes_waiting), text: (client) => bytesText(Number(client.bytes_waiting)) },
      { key: "held", title: texts.held, value: (client) => Number(client.bytes_held), text: (client) => bytesText(Number(client.bytes_held)), isMinor: true },
    ],
  });
  const bridges = element("ul", { className: "bridges", ariaLabel: texts.bridges });
  bridges.hidden = true;
  const showBridges = (/** @type {BridgeStatus[]} */ found) => {
    bridges.hidden = !found.length;
    bridges.replaceChildren(...found.map(({ url, age: seconds }) => element("li", {}, texts.bridge(url, seconds))));
  };
  const part = element("div", { className: "graph-part" }, element("p", { className: "hint" }, texts.hint), bridges, table.element);
  whileSeen(part, () => {
    const taker = connection.subscribe("/sim/clients", "rosbridge_sim_msgs/Clients", (message) => {
      now = stampSeconds(message.header.stamp);
      table.show(message.clients);
      showBridges(message.bridges);
    });
    return () => taker.close();
  });
  return part;
}

/** @param {ClientInfo} client @param {(topic: string, count: number) => string} lost */
function lostText(client, lost) {
  const named = client.dropped_topics.slice(0, MAX_NAMED).map((topic, index) => lost(topic, Number(client.dropped_counts[index] ?? 0)));
  return named.join(", ") + (client.dropped_topics.length > MAX_NAMED ? ", …" : "");
}
