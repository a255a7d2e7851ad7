// The form that publishes on a topic.

import { ActionButton, Notice } from "../../widgets/action_button.js";
import { element, replaceChildren } from "../../widgets/dom.js";
import { makeFormOf } from "./definitions.js";

/** @typedef {import("../context.js").PanelContext} PanelContext */

/** A service that each server has. It answers after all that was sent before has been read. */
const BARRIER_SERVICE = "/rosapi/get_time";

/**
 * @param {PanelContext} context @returns {{element: HTMLElement, choose: (topic: {name: string, type: string} | null) => void}}
 */
export function makePublishForm(context) {
  const { connection, actions, texts: { graph: texts } } = context;
  const notice = new Notice();
  const place = element("div", {});
  /** @type {{name: string, type: string} | null} */
  let topic = null;
  /** @type {import("../../widgets/form.js").MessageForm | null} */
  let form = null;
  let hasPublished = false;

  /** Publish the message of the form, and wait for what the server says to it. */
  const publish = async () => {
    if (topic === null || form === null) {
      return;
    }
    const [{ name, type }, used] = [topic, form];
    const message = used.read();
    if (connection.state !== "open") {
      throw new Error(context.texts.connection.notConnected);
    }
    /** @type {string[]} */
    const refusals = [];
    const end = connection.onStatus((status) => {
      if (status.level === "error" || status.level === "warning") {
        refusals.push(status.msg);
      }
    });
    try {
      hasPublished = true;
      actions.publish(texts.publish.action(name), name, type, message);
      await connection.call(BARRIER_SERVICE);
    } finally {
      end();
    }
    if (refusals.length > 0) {
      connection.unadvertise(name); // a refused advertisement is made again at the next attempt
      throw new Error(refusals.slice(0, 3).join("\n"));
    }
    notice.show(texts.publish.done);
  };
  const button = new ActionButton({ label: texts.publish.label, title: texts.publish.hint, className: "primary", notice, act: publish });
  const row = element("div", { className: "button-row", hidden: true }, button.element); // until there is a form to publish
  const content = element("div", { className: "form" }, place, row, notice.element);
  const box = element("details", { className: "publish" }, element("summary", {}, texts.publish.title), content);
  const load = async () => {
    if (topic !== null && box.open && form === null) {
      const asked = topic;
      const made = await makeFormOf(context, asked.type, "message");
      if (topic === asked) {
        form = made;
        replaceChildren(place, made.element);
        row.hidden = false;
      }
    }
  };
  box.addEventListener("toggle", () => void load());
  return {
    element: box,
    choose: (chosen) => {
      if (topic !== null && hasPublished) {
        connection.unadvertise(topic.name);
      }
      topic = chosen;
      form = null;
      hasPublished = false;
      row.hidden = true;
      notice.show("");
      replaceChildren(place);
      void load();
    },
  };
}
