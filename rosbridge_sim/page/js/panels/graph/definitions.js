// Forms for types that the server tells.

import { MessageForm } from "../../widgets/form.js";
import { TypeDefinition } from "../../wire/types.js";

/** @typedef {import("../context.js").PanelContext} PanelContext */

/**
 * Make the form for a type. If the server does not tell its definition, it takes JSON text, and says why.
 * @param {PanelContext} context @param {string} type @param {"message" | "request"} part @returns {Promise<MessageForm>}
 */
export async function makeFormOf({ connection, texts: { graph: texts } }, type, part) {
  try {
    const { text } = await connection.call("/rosapi/definition", { type, part });
    return new MessageForm(new TypeDefinition(type, text), texts.form);
  } catch (error) {
    const form = new MessageForm(null, texts.form);
    form.showError(texts.noDefinition(type, error instanceof Error ? error.message : String(error)));
    return form;
  }
}
