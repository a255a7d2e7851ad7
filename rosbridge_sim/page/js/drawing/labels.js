/** Short texts over the map, as few elements that are used again and again. */

import { element, setText } from "../widgets/dom.js";

/** @typedef {{x: number, y: number, text: string, className: string}} Label */

/** More labels than this would hide the map, and cost time. */
const MOST_LABELS = 28;

/** The labels over the map; readers of the screen have the panels and the card in their place. */
export class LabelLayer {
  constructor() {
    this.element = element("div", { className: "map-labels", "aria-hidden": "true" });
    /** @type {HTMLElement[]} */
    this.nodes = [];
    this.shown = 0;
    /** @type {Label[]} */
    this.labels = [];
  }

  /** Show labels in place of the former ones. @param {Label[]} labels - points are in CSS pixels */
  show(labels) {
    const num = Math.min(labels.length, MOST_LABELS);
    for (let i = 0; i < num; i += 1) {
      const { x, y, text, className } = labels[i];
      let node = this.nodes[i];
      if (node === undefined) {
        node = element("span", {});
        this.nodes.push(node);
        this.element.append(node);
      }
      if (node.className !== className) {
        node.className = className;
      }
      setText(node, text);
      node.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
      if (i >= this.shown) {
        node.hidden = false;
      }
    }
    for (let i = num; i < this.shown; i += 1) {
      this.nodes[i].hidden = true;
    }
    this.shown = num;
    this.labels = labels.slice(0, num);
  }

  /** Paint the labels that are shown. @param {CanvasRenderingContext2D} pen - in CSS pixels */
  paint(pen) {
    pen.font = "600 12px sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    this.labels.forEach(({ x, y, text }, i) => {
      const { backgroundColor, color } = getComputedStyle(this.nodes[i]);
      const width = pen.measureText(text).width + 10;
      pen.fillStyle = backgroundColor;
      pen.fillRect(x - width / 2, y - 9, width, 18);
      pen.fillStyle = color;
      pen.fillText(text, x, y);
    });
  }
}
