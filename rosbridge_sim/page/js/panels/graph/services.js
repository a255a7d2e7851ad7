// Services and actions, and a form that calls a service.

import { ActionButton, Notice } from "../../widgets/action_button.js";
import { element, replaceChildren, setText } from "../../widgets/dom.js";
import { whileSeen } from "../../widgets/seen.js";
import { DataTable } from "../../widgets/table.js";
import { MessageTree } from "../../widgets/tree.js";
import { refusalOf } from "../actions.js";
import { makeFormOf } from "./definitions.js";

/** @typedef {import("../context.js").PanelContext} PanelContext */
/** @typedef {{name: string, kind: "service" | "action"}} ServiceRow */

/** Time between two readings of the lists [ms]; services come and go seldom. */
const LIST_INTERVAL = 3000;
/** Longest wait for an answer [ms]: a load of a large scenario takes several seconds. */
const CALL_TIMEOUT = 60_000;

/** @param {PanelContext} context @returns {HTMLElement} */
export function makeServicesPart(context) {
  const { connection, texts: { graph: texts } } = context;
  const view = makeServiceView(context);
  const note = new Notice();
  /** @type {DataTable<ServiceRow>} */
  const table = new DataTable({
    label: texts.services.title,
    search: texts.services.search,
    empty: texts.services.empty,
    more: texts.more,
    keyOf: (row) => row.name,
    choose: (row) => {
      const isSame = table.chosen === row.name;
      table.mark(isSame ? "" : row.name);
      void view.choose(isSame ? null : row);
    },
    columns: [
      { key: "name", title: texts.services.name, value: (row) => row.name },
      { key: "kind", title: texts.services.kind, value: (row) => texts.services.kinds[row.kind] },
    ],
  });
  const part = element("div", { className: "graph-part" }, table.element, note.element, view.element);
  const read = async () => {
    if (connection.state !== "open" || document.hidden) {
      return;
    }
    try {
      const [{ services }, { action_servers: servers }] = await Promise.all([
        connection.call("/rosapi/services"),
        connection.call("/rosapi/action_servers"),
      ]);
      const row = (/** @type {"service" | "action"} */ kind) => (/** @type {string} */ name) => ({ name, kind });
      table.show([...services.map(row("service")), ...servers.map(row("action"))]);
      note.show("");
    } catch (error) {
      note.showError(error);
    }
  };
  whileSeen(part, () => {
    const timer = setInterval(() => void read(), LIST_INTERVAL);
    const end = connection.onState(() => void read());
    return () => {
      clearInterval(timer);
      end();
    };
  });
  return part;
}

/** @param {PanelContext} context */
function makeServiceView(context) {
  const { connection, actions, texts: { graph: texts } } = context;
  const title = element("h3", { tabIndex: -1 });
  const about = element("p", { className: "hint" });
  const notice = new Notice();
  const place = element("div", {});
  const answer = new MessageTree({ ...texts.tree, label: texts.services.answer });
  const answerBox = element("div", { hidden: true }, element("h4", {}, texts.services.answer), answer.element);
  /** @type {ServiceRow | null} */
  let chosen = null;
  /** @type {import("../../widgets/form.js").MessageForm | null} */
  let form = null;
  let type = "";

  const call = async () => {
    if (chosen === null || form === null) {
      return;
    }
    const [row, request] = [chosen, form.read()];
    answerBox.hidden = true;
    const action = actions.record(texts.services.action(row.name), { kind: "call", name: row.name, type, values: request });
    let values;
    try {
      values = await connection.call(row.name, request, { timeoutMs: CALL_TIMEOUT });
    } catch (error) {
      actions.finish(action, "failed", error instanceof Error ? error.message : String(error));
      throw error;
    }
    const refusal = refusalOf(values);
    actions.finish(action, refusal === null ? "done" : "failed", refusal ?? "");
    if (chosen === row) {
      answer.choices.clear();
      answer.show(values);
      answerBox.hidden = false;
      const isEmpty = Object.keys(values ?? {}).length === 0;
      notice.show(refusal ?? (isEmpty ? texts.services.emptyAnswer : ""), refusal === null ? "info" : "bad");
      answerBox.scrollIntoView({ block: "nearest" });
    }
  };
  const button = new ActionButton({ label: texts.services.call, className: "primary", notice, act: call });
  const buttonRow = element("div", { className: "button-row", hidden: true }, button.element); // until there is a form to send
  const content = element("div", { className: "form" }, place, buttonRow, notice.element, answerBox);
  const view = element("section", { className: "subsection topic-view", hidden: true, "aria-label": texts.services.label }, title, about, content);

  /** @param {ServiceRow | null} row */
  const choose = async (row) => {
    chosen = row;
    form = null;
    type = "";
    notice.show("");
    replaceChildren(place);
    buttonRow.hidden = true;
    answerBox.hidden = true;
    view.hidden = row === null;
    content.hidden = row?.kind === "action";
    if (row === null) {
      return;
    }
    setText(title, row.name);
    setText(about, "");
    title.focus({ preventScroll: true });
    view.scrollIntoView({ block: "nearest" });
    try {
      const answered = await (row.kind === "action"
        ? connection.call("/rosapi/action_type", { action: row.name })
        : connection.call("/rosapi/service_type", { service: row.name }));
      if (chosen !== row) {
        return;
      }
      type = answered.type;
      setText(about, row.kind === "action" ? texts.services.aboutAction(type) : type);
      if (row.kind === "service") {
        const made = await makeFormOf(context, type, "request");
        if (chosen === row) {
          form = made;
          replaceChildren(place, form.element);
          buttonRow.hidden = false;
        }
      }
    } catch (error) {
      notice.showError(error);
    }
  };
  return { element: view, choose };
}
