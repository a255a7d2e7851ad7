/** A form for a message, made from the definition of its type, with a second mode as JSON text. */

import { choicesOf, parseBaseValue } from "../wire/types.js";
import { labelled } from "./action_button.js";
import { element, replaceChildren, setText } from "./dom.js";

/** @typedef {import("../wire/types.js").TypeDefinition} TypeDefinition */
/** @typedef {import("../wire/types.js").TypeField} TypeField */
/** @typedef {import("../wire/types.js").TypeSpec} TypeSpec */

/** @typedef {typeof import("../texts.js").TEXTS.graph.form} FormTexts */

/** A part of the form: one field, with all in it. @typedef {{element: HTMLElement, read: () => any, fill: (value: any) => void}} FieldEditor */

/** Messages of an array that have fields of their own; longer ones are JSON text. */
const MAX_FORM_ITEMS = 30;
/** Longest JSON text; a server takes frames of a few MB. */
const MAX_JSON_TEXT = 1_000_000;

/** A value that a field does not take. Its message says which field, and what is expected. */
export class FormError extends Error {
  name = "FormError";
}

/** A form for one type. */
export class MessageForm {
  /** @param {TypeDefinition | null} definition - null: only JSON text @param {FormTexts} texts */
  constructor(definition, texts) {
    this.definition = definition;
    this.texts = texts;
    this.isJson = definition === null;
    this.fields = definition === null ? null : makeGroup(definition, definition.root, "", texts);
    this.area = element("textarea", { className: "json-area", rows: 8, spellcheck: false, value: "{}", maxLength: MAX_JSON_TEXT });
    this.modeButton = element("button", { type: "button", className: "small", hidden: definition === null });
    this.modeButton.addEventListener("click", () => this.changeMode());
    this.error = element("p", { className: "notice", role: "alert", hidden: true, dataset: { kind: "bad" } });
    this.place = element("div", {});
    this.element = element("div", { className: "message-form" }, this.modeButton, this.place, this.error);
    this.jsonField = labelled(texts.jsonLabel, this.area);
    this.draw();
  }

  /**
   * Return the message in the form.
   * @returns {Record<string, any>} @throws {FormError} a value is missing or wrong; the form says so, too
   */
  read() {
    this.showError("");
    try {
      return this.isJson || this.fields === null ? parseObject(this.area.value, this.texts) : this.fields.read();
    } catch (error) {
      this.showError(error instanceof Error ? error.message : String(error));
      throw error;
    }
  }

  /** @param {string} text - reason of a refusal; empty for none */
  showError(text) {
    this.error.hidden = text === "";
    setText(this.error, text);
  }

  /** Change between fields and JSON text, with the values that are there; wrong ones stay where they are. */
  changeMode() {
    let message;
    try {
      message = this.read();
      if (this.isJson) {
        this.fields?.fill(message);
      } else {
        this.area.value = JSON.stringify(message, null, 2);
      }
    } catch {
      return; // the form shows the reason
    }
    this.isJson = !this.isJson;
    this.draw();
  }

  draw() {
    setText(this.modeButton, this.isJson ? this.texts.fields : this.texts.json);
    replaceChildren(this.place, this.isJson ? this.jsonField : this.fields?.element);
  }
}

/** @param {string} text @param {FormTexts} texts @returns {Record<string, any>} */
function parseObject(text, texts) {
  let value;
  try {
    value = JSON.parse(text);
  } catch (error) {
    throw new FormError(`JSON: ${error instanceof Error ? error.message : error}`);
  }
  if (value === null || typeof value !== "object" || Array.isArray(value)) {
    throw new FormError(texts.notObject);
  }
  return value;
}

/**
 * @param {TypeDefinition} definition @param {TypeSpec} spec @param {string} path - of the message in the form
 * @param {FormTexts} texts @returns {FieldEditor}
 */
function makeGroup(definition, spec, path, texts) {
  const editors = spec.fields.map((field) => {
    const name = path ? `${path}.${field.name}` : field.name;
    return { name: field.name, editor: makeEditor(definition, spec, field, name, texts) };
  });
  return {
    element: element(
      "div",
      { className: "form-group" },
      editors.length === 0 ? element("p", { className: "hint" }, texts.noFields) : null,
      ...editors.map(({ editor }) => editor.element),
    ),
    read: () => Object.fromEntries(editors.map(({ name, editor }) => [name, editor.read()])),
    fill: (value) => {
      for (const { name, editor } of editors) {
        if (value !== null && typeof value === "object" && Object.hasOwn(value, name)) {
          editor.fill(value[name]);
        }
      }
    },
  };
}

/**
 * @param {TypeDefinition} definition @param {TypeSpec} spec - type of the message around the field @param {TypeField} field
 * @param {string} path @param {FormTexts} texts @returns {FieldEditor}
 */
function makeEditor(definition, spec, field, path, texts) {
  const nested = definition.nested(field);
  if (nested === null) {
    return field.isArray ? makeListText(definition, field, path, texts) : makeBase(definition, spec, field, path, texts);
  }
  if (!field.isArray) {
    const group = makeGroup(definition, nested, path, texts);
    return { ...group, element: fold(field, group.element, isOpenAtFirst(nested)) };
  }
  const isLong = field.length > MAX_FORM_ITEMS;
  return isLong ? makeListText(definition, field, path, texts) : makeItems(definition, nested, field, path, texts);
}

/** A header or a time is rarely filled in, so it begins folded. @param {TypeSpec} spec */
function isOpenAtFirst(spec) {
  return !["std_msgs/Header", "time", "duration", "builtin_interfaces/Time", "builtin_interfaces/Duration"].includes(spec.name);
}

/** @param {TypeField} field @param {HTMLElement} content @param {boolean} isOpen */
function fold(field, content, isOpen) {
  return element(
    "details",
    { className: "form-fold", open: isOpen },
    element("summary", {}, field.name, " ", element("small", {}, field.comment || field.type)),
    content,
  );
}

/**
 * @param {TypeDefinition} definition @param {TypeSpec} nested - type of the items @param {TypeField} field @param {string} path
 * @param {FormTexts} texts @returns {FieldEditor}
 */
function makeItems(definition, nested, field, path, texts) {
  /** @type {{editor: FieldEditor, box: HTMLElement}[]} */
  let items = [];
  const most = Math.min(field.max, MAX_FORM_ITEMS);
  const list = element("div", {});
  const add = element("button", { type: "button", className: "small", "aria-label": `${texts.add}: ${path}` }, texts.add);
  const isFixed = field.length >= 0;
  const update = () => {
    add.hidden = isFixed || items.length >= most;
    replaceChildren(list, ...items.map((item) => item.box));
  };
  const append = (/** @type {any} */ value) => {
    const editor = makeGroup(definition, nested, `${path}[${items.length}]`, texts);
    const remove = element("button", { type: "button", className: "small", hidden: isFixed, "aria-label": `${texts.remove}: ${path}` }, texts.remove);
    const item = { editor, box: element("div", { className: "form-item" }, editor.element, remove) };
    remove.addEventListener("click", () => {
      items = items.filter((other) => other !== item);
      update();
      add.focus();
    });
    editor.fill(value);
    items.push(item);
  };
  const fill = (/** @type {any} */ value) => {
    if (!Array.isArray(value) || value.length > most || (isFixed && value.length !== field.length)) {
      throw new FormError(texts.expected(path, isFixed ? texts.listOf(field.length) : texts.items(most)));
    }
    items = [];
    value.forEach(append);
    update();
  };
  add.addEventListener("click", () => {
    append({});
    update();
  });
  fill(definition.defaultOf(field));
  return { element: fold(field, element("div", {}, list, add), true), read: () => items.map((item) => item.editor.read()), fill };
}

/**
 * A list of values as JSON text.
 * @param {TypeDefinition} definition @param {TypeField} field @param {string} path @param {FormTexts} texts
 * @returns {FieldEditor}
 */
function makeListText(definition, field, path, texts) {
  const input = element("input", { type: "text", spellcheck: false, autocomplete: "off", className: "mono" });
  const fill = (/** @type {any} */ value) => {
    input.value = JSON.stringify(value);
  };
  const read = () => {
    let value;
    try {
      value = JSON.parse(input.value.trim() || "[]");
    } catch {
      value = null;
    }
    // Bytes are base64 text as well, as they are on the wire.
    const isBytes = typeof value === "string" && ["uint8", "char"].includes(field.type);
    const isList = Array.isArray(value) && value.length <= field.max && (field.length < 0 || value.length === field.length);
    return check(input, isBytes || isList, value, texts.expected(path, field.length < 0 ? texts.list : texts.listOf(field.length)));
  };
  fill(definition.defaultOf(field));
  const mark = field.length < 0 ? "[]" : `[${field.length}]`;
  return { element: labelled(labelOf(field), input, hintOf(field, mark)), read, fill };
}

/**
 * @param {TypeDefinition} definition @param {TypeSpec} spec - type of the message around the field @param {TypeField} field
 * @param {string} path @param {FormTexts} texts @returns {FieldEditor}
 */
function makeBase(definition, spec, field, path, texts) {
  if (field.type === "bool") {
    const box = element("input", { type: "checkbox", checked: definition.defaultOf(field) });
    return {
      element: labelled(labelOf(field), box, hintOf(field)),
      read: () => box.checked,
      fill: (value) => {
        box.checked = value === true;
      },
    };
  }
  const isText = field.type === "string" || field.type === "wstring";
  const input = element("input", { type: "text", spellcheck: false, autocomplete: "off", inputMode: isText ? "text" : "decimal" });
  input.value = String(definition.defaultOf(field));
  const choices = choicesOf(spec, field);
  const select = choices.length === 0 ? null : makeChoices(choices, input, texts);
  const read = () => {
    try {
      return check(input, true, parseBaseValue(field.type, input.value), "");
    } catch (error) {
      const what = error instanceof Error ? error.message : String(error);
      return check(input, false, null, texts.expected(path, what));
    }
  };
  const fill = (/** @type {any} */ value) => {
    input.value = value === null ? "" : typeof value === "object" ? JSON.stringify(value) : String(value);
    select?.update();
  };
  const box = labelled(labelOf(field), select?.element ?? input, hintOf(field));
  if (select) {
    input.setAttribute("aria-label", `${field.name}: ${texts.other}`);
    box.append(input);
  }
  return { element: box, read, fill };
}

/**
 * A choice between constants, or another value.
 * @param {import("../wire/types.js").TypeConstant[]} choices @param {HTMLInputElement} input - has the value
 * @param {FormTexts} texts
 */
function makeChoices(choices, input, texts) {
  const select = element(
    "select",
    {},
    ...choices.map((choice) => element("option", { value: choice.value, title: choice.comment }, `${choice.name} (${choice.value})`)),
    element("option", { value: "" }, texts.other),
  );
  const update = () => {
    const index = choices.findIndex((choice) => choice.value === input.value);
    select.selectedIndex = index < 0 ? choices.length : index;
    input.hidden = index >= 0;
  };
  select.addEventListener("change", () => {
    const choice = choices[select.selectedIndex];
    input.hidden = choice !== undefined;
    if (choice) {
      input.value = choice.value;
    }
  });
  update();
  return { element: select, update };
}

/** @param {HTMLInputElement} input @param {boolean} isRight @param {any} value @param {string} reason @returns {any} the value */
function check(input, isRight, value, reason) {
  if (!isRight) {
    input.setAttribute("aria-invalid", "true");
    input.closest("details")?.setAttribute("open", "");
    input.focus();
    throw new FormError(reason);
  }
  input.removeAttribute("aria-invalid");
  return value;
}

/** @param {TypeField} field */
function labelOf(field) {
  return field.unit ? `${field.name} [${field.unit}]` : field.name;
}

/** @param {TypeField} field @param {string} [mark] - of an array */
function hintOf(field, mark = "") {
  const comment = field.unit ? field.comment.slice(0, field.comment.lastIndexOf("[")).trim() : field.comment;
  return [`${field.type}${mark}`, comment].filter(Boolean).join(": ");
}
