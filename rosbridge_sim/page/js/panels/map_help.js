/** The dialog with the keys of the map and the meaning of its colours. */

import { makePalette } from "../drawing/palette.js";
import { MATERIALS } from "../scene/materials.js";
import { KINDS } from "../scene/store.js";
import { closeButton, element } from "../widgets/dom.js";

/** Materials in the legend, by the names of TEXTS.mapHelp.legend. */
const LEGEND = /** @type {const} */ ([
  ["lane", "lane"],
  ["inside", "inside"],
  ["deadEnd", "deadEnd"],
  ["stop", "stop"],
  ["red", "lightRed"],
  ["yellow", "lightYellow"],
  ["green", "lightGreen"],
  ["dark", "lightDark"],
  ["contact", "contact"],
]);

/** Show the dialog. @param {import("../layout.js").Texts} texts */
export function showMapHelp({ mapHelp: texts }) {
  const palette = makePalette(matchMedia("(prefers-color-scheme: dark)").matches);
  /** @type {HTMLDialogElement} */
  const dialog = element(
    "dialog",
    { className: "dialog map-help", "aria-labelledby": "map-help-title" },
    closeButton(texts.close, () => dialog.close()),
    element("h2", { id: "map-help-title" }, texts.title),
    element("h3", {}, texts.keys),
    element("table", {}, element("tbody", {}, ...texts.rows.map(([key, what]) =>
      element("tr", {}, element("th", { scope: "row" }, ...key.split("  ").map((one) => element("kbd", {}, one))), element("td", {}, what)))),
    ),
    element("h3", {}, texts.colours),
    element(
      "ul",
      { className: "legend" },
      ...KINDS.map((kind, at) => legendEntry(texts.legend[kind], palette.kinds.subarray(3 * at, 3 * at + 3))),
      ...LEGEND.map(([name, material]) => {
        const at = 3 * MATERIALS[material];
        return legendEntry(texts.legend[name], palette.materials.subarray(at, at + 3));
      }),
    ),
    element("p", {}, element("a", { href: "docs/guides/page", target: "_blank", rel: "noopener" }, texts.documentation)),
  );
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

/** @param {string} text @param {ArrayLike<number>} colour */
function legendEntry(text, colour) {
  const backgroundColor = `rgb(${Array.from(colour, (part) => Math.round(255 * part)).join(" ")})`;
  return element("li", {}, element("span", { className: "swatch", style: { backgroundColor } }), text);
}
