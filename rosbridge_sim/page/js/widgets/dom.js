/** Elements of the page. Texts become text nodes, so a text from the wire is never read as HTML. */

/** Properties of an element: DOM properties by name; names with a dash, and `role`, are attributes. */
/** @typedef {Record<string, any>} Properties */
/** @typedef {Node | string | number | null | undefined} Child */

const HTML_PROPERTIES = new Set(["innerHTML", "outerHTML", "srcdoc"]);
const ATTRIBUTES = new Set(["role", "for", "list", "form", "viewBox"]);
const SVG = "http://www.w3.org/2000/svg";

/**
 * Make an HTML element.
 * @template {keyof HTMLElementTagNameMap} Tag @param {Tag} tag - name of the element
 * @param {Properties} [properties] - such as `{className: "row", "aria-label": "Speed", onclick: stop}`; `style` and `dataset`
 * are objects
 * @param {...Child} children - nodes, and texts that become text nodes; null and undefined are left out
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function element(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    setProperty(node, name, value);
  }
  appendAll(node, children);
  return node;
}

/**
 * Make an SVG element; all properties are attributes.
 * @param {string} tag - name of the element @param {Record<string, string | number>} [attributes] - attributes by name
 * @param {...Child} children - as for `element` @returns {SVGElement}
 */
export function svgElement(tag, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) {
    node.setAttribute(name, String(value));
  }
  appendAll(node, children);
  return node;
}

/**
 * Put children in place of the ones that a node has.
 * @param {Element} node - the parent @param {...Child} children - as for `element`
 */
export function replaceChildren(node, ...children) {
  node.replaceChildren();
  appendAll(node, children);
}

/**
 * Replace the rows of a list. If the keyboard is at a button of the list, it stays at the button of the same number.
 * @param {Element} list @param {HTMLElement} otherwise - gets the keyboard if the new rows have no button
 * @param {...Child} rows - as for `element`
 */
export function replaceRows(list, otherwise, ...rows) {
  const place = [...list.querySelectorAll("button")].findIndex((button) => button === document.activeElement);
  replaceChildren(list, ...rows);
  if (place >= 0) {
    const buttons = list.querySelectorAll("button");
    (buttons[Math.min(place, buttons.length - 1)] ?? otherwise).focus();
  }
}

/**
 * Set the text of a node, if it is another one. An equal text would still cost a layout and a screen reader's words.
 * @param {Node} node - the node @param {string} text - its text
 */
export function setText(node, text) {
  if (node.textContent !== text) {
    node.textContent = text;
  }
}

/** A cross that closes something. @param {string} title @param {() => unknown} onclick */
export function closeButton(title, onclick) {
  return element("button", { type: "button", className: "close", title, "aria-label": title, onclick }, "×");
}

/** Select a number in a list; add it to the list if it is missing. @param {HTMLSelectElement} select @param {number} value @param {(value: number) => string} name */
export function chooseNumber(select, value, name) {
  if (![...select.options].some((option) => option.value === String(value))) {
    select.append(element("option", { value: String(value) }, name(value)));
  }
  select.value = String(value);
}

/** Have the browser save a file. @param {string} name @param {Blob} blob */
export function saveFile(name, blob) {
  const url = URL.createObjectURL(blob);
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000); // the browser reads it meanwhile
}

/** @param {Element} node @param {string} name @param {any} value */
function setProperty(node, name, value) {
  if (HTML_PROPERTIES.has(name)) {
    throw new TypeError(`element: expected text as a child; got the property ${name}`);
  }
  if (value === undefined || value === null) {
    return;
  }
  if (name === "style" || name === "dataset") {
    Object.assign(/** @type {any} */ (node)[name], value);
  } else if (name.includes("-") || ATTRIBUTES.has(name)) {
    node.setAttribute(name, String(value));
  } else {
    /** @type {any} */ (node)[name] = value;
  }
}

/** @param {Element} node @param {Child[]} children */
function appendAll(node, children) {
  for (const child of children) {
    if (child !== null && child !== undefined) {
      node.append(child instanceof Node ? child : String(child));
    }
  }
}
