// One topic: its figures, its messages as a tree, charts and an image, and a form that publishes.

import { element, replaceChildren, setText } from "../../widgets/dom.js";
import { Charts } from "../../widgets/charts.js";
import { whileSeen } from "../../widgets/seen.js";
import { MessageTree } from "../../widgets/tree.js";
import { pathText, valueAtPath } from "../../widgets/tree_rows.js";
import { bytesText } from "./figures.js";
import { ImageView } from "./image_view.js";
import { makePublishForm } from "./publish_form.js";

/** @typedef {import("../context.js").PanelContext} PanelContext */
/** @typedef {import("./topics.js").TopicInfo} TopicInfo */

/** Shortest time between two updates of the tree: more often nobody reads it [ms]. */
const TREE_INTERVAL = 200;
/** The same for charts, whose lines shall be smooth [ms]. */
const CHART_INTERVAL = 50;

export class TopicView {
  /** @param {PanelContext} context @param {() => void} onClose */
  constructor(context, onClose) {
    this.context = context;
    this.texts = context.texts.graph;
    this.onClose = onClose;
    /** @type {TopicInfo | null} */
    this.topic = null;
    /** @type {{close: () => void} | null} */
    this.taker = null;
    this.isSeen = false;
    this.isHeld = false;
    /** The last message, in a list of its own. @type {any[]} */
    this.last = [];
    this.drawnAt = -Infinity;
    /** The timer of the next drawing. @type {ReturnType<typeof setTimeout> | null} */
    this.drawing = null;
    this.numMessages = 0;
    this.title = element("h3", { tabIndex: -1 });
    this.type = element("p", { className: "hint" });
    this.figures = element("dl", { className: "figures" });
    this.state = element("p", { className: "hint" });
    this.note = element("p", { className: "notice", role: "status", hidden: true, dataset: { kind: "warn" } });
    this.charts = new Charts(context.texts.charts);
    this.charts.onChange = () => void this.subscribe();
    this.tree = new MessageTree(this.texts.tree, (path) => this.chart(path));
    this.image = new ImageView(this.texts.image);
    this.form = makePublishForm(context);
    this.hold = element("button", { type: "button", className: "small", title: this.texts.topic.holdTitle }, this.texts.topic.hold);
    this.hold.addEventListener("click", () => this.setHeld(!this.isHeld));
    const close = element("button", { type: "button", className: "small" }, this.texts.topic.close);
    close.addEventListener("click", () => {
      this.choose(null);
      this.onClose();
    });
    this.messages = element("div", {}, this.image.element, this.charts.element, this.tree.element);
    this.element = element(
      "section",
      { className: "subsection topic-view", hidden: true, "aria-label": this.texts.topic.label },
      element("div", { className: "view-head" }, this.title, this.hold, close),
      this.type,
      this.figures,
      this.state,
      this.note,
      this.messages,
      this.form.element,
    );
    whileSeen(this.element, () => {
      this.isSeen = true;
      this.subscribe();
      return () => {
        this.isSeen = false;
        this.subscribe();
      };
    });
  }

  /** @param {TopicInfo | null} topic - null closes the view */
  choose(topic) {
    this.topic = topic;
    this.last = [];
    this.numMessages = 0;
    this.charts.clear();
    this.image.clear();
    this.tree.choices.clear();
    this.tree.show(null);
    setText(this.note, "");
    this.note.hidden = true;
    this.element.hidden = topic === null;
    this.setHeld(false);
    this.form.choose(topic);
    this.subscribe();
    if (topic !== null) {
      setText(this.title, topic.name);
      this.update(topic);
      this.title.focus({ preventScroll: true });
      this.element.scrollIntoView({ block: "nearest" });
    }
  }

  /** @param {TopicInfo | null} info - new figures of the topic; null: it is gone */
  update(info) {
    if (this.topic === null) {
      return;
    }
    if (info === null) {
      this.note.hidden = false;
      setText(this.note, this.texts.topic.gone);
      return;
    }
    this.note.hidden = true;
    const { topic: texts } = this.texts;
    if (this.last.length === 0) {
      setText(this.state, this.context.time.isStanding ? texts.noneStanding : texts.none);
    }
    setText(this.type, info.type);
    const names = (/** @type {string[]} */ list) => list.slice(0, 20).join(", ") || texts.nobody;
    const parts = [
      [texts.bytes, `${bytesText(Math.round(Number(info.bytes_per_second)))}/s`],
      [texts.dropped, String(info.dropped)],
      [texts.latched, info.is_latched ? texts.yes : texts.no],
      [texts.publishers, names(info.publishers)],
      [texts.subscribers, names(info.subscribers)],
    ];
    const values = [...this.figures.querySelectorAll("dd")];
    if (values.length === parts.length) {
      parts.forEach(([, text], index) => setText(/** @type {Node} */ (values[index]), text ?? ""));
    } else {
      replaceChildren(this.figures, ...parts.map(([label, text]) => element("div", {}, element("dt", {}, label), element("dd", {}, text))));
    }
  }

  /** Subscribe as fast as it is needed now; not at all while nobody sees it. */
  subscribe() {
    const old = this.taker;
    this.taker = null;
    if (this.topic !== null && this.isSeen && !this.isHeld) {
      const throttleMs = this.charts.charts.size > 0 ? CHART_INTERVAL : TREE_INTERVAL;
      const options = { throttleMs, queueLength: 1, encoding: /** @type {const} */ ("cbor") };
      this.taker = this.context.connection.subscribe(this.topic.name, "", (message) => this.take(message), options);
    }
    old?.close(); // after the new one, so that the wire has no gap
  }

  /** @param {any} message */
  take(message) {
    this.last = [message];
    this.numMessages += 1;
    const now = performance.now();
    this.charts.push(now / 1000, (path) => valueAtPath(message, path));
    if (this.drawing === null) {
      const wait = this.drawnAt + TREE_INTERVAL - CHART_INTERVAL / 2 - now;
      if (wait <= 0) {
        this.draw();
      } else {
        this.drawing = setTimeout(() => this.draw(), wait); // the last message of a flood must be seen
      }
    }
  }

  /** Draw the last message now. */
  draw() {
    clearTimeout(this.drawing ?? undefined);
    this.drawing = null;
    this.drawnAt = performance.now();
    const [message] = this.last;
    if (message !== undefined && this.topic !== null) {
      this.tree.show(message);
      this.image.show(this.topic.type, message);
      setText(this.state, this.isHeld ? this.texts.topic.held : this.texts.topic.live);
    }
  }

  /** @param {boolean} isHeld */
  setHeld(isHeld) {
    if (isHeld !== this.isHeld) {
      this.isHeld = isHeld;
      setText(this.hold, isHeld ? this.texts.topic.go : this.texts.topic.hold);
      this.hold.setAttribute("aria-pressed", String(isHeld));
      this.subscribe();
      this.draw();
    }
  }

  /** @param {string} path - of a number in the message */
  chart(path) {
    const isDone = this.charts.toggle(path, pathText(path));
    this.note.hidden = isDone;
    setText(this.note, isDone ? "" : this.context.texts.charts.full);
  }
}
