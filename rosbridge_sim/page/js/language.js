/** The language of the page: the one that its user chose, else the first of the browser's that the page has. */

import { TEXTS } from "./texts.js";

/** @typedef {keyof typeof LANGUAGE_NAMES} Language */

const LANGUAGE_KEY = "rosbridge-sim-language";
/** Each language, in its own words. */
const LANGUAGE_NAMES = { en: "English", ko: "한국어" };

/** @returns {Language} */
function findLanguage() {
  const wanted = [localStorage.getItem(LANGUAGE_KEY) ?? "", ...navigator.languages].map((tag) => tag.slice(0, 2).toLowerCase());
  return wanted.includes("ko") && !wanted.slice(0, wanted.indexOf("ko")).includes("en") ? "ko" : "en";
}

/** Put the texts into the user's language; call it before any part of the page is made. */
export async function translate() {
  if (findLanguage() === "ko") {
    const { KOREAN } = await import("./texts_ko.js");
    Object.assign(TEXTS, KOREAN);
    document.documentElement.lang = "ko";
  }
}

/** @returns {{language: Language, label: string}} the language that the switch of the page leads to */
export function otherLanguage() {
  const language = document.documentElement.lang === "ko" ? "en" : "ko";
  return { language, label: LANGUAGE_NAMES[language] };
}

/** Show the page in a language, now and from now on. @param {Language} language */
export function chooseLanguage(language) {
  localStorage.setItem(LANGUAGE_KEY, language);
  location.reload();
}
