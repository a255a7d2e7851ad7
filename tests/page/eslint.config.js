/** Rules for the page's JavaScript: the mistakes that types do not show, and the forms that the page's joiner wants. */

import js from "@eslint/js";

/** Names through which a text could become HTML, with the way around. */
const HTML = "innerHTML|outerHTML|insertAdjacentHTML|srcdoc|createContextualFragment|setHTML|setHTMLUnsafe|parseFromString|write|writeln";
const NO_HTML = "Everything enters the page as text: use element() of widgets/dom.js";

/** Globals of a browser that the page uses; another one is most likely a spelling mistake. */
const BROWSER = [
  "AbortController", "Blob", "CustomEvent", "DOMException", "DOMRect", "DecompressionStream", "Response", "Event", "EventTarget", "File", "FileReader",
  "HTMLButtonElement", "HTMLCanvasElement", "HTMLElement", "HTMLInputElement", "HTMLSelectElement",
  "HTMLTextAreaElement", "Element", "Image", "ImageBitmap", "ImageData", "IntersectionObserver", "KeyboardEvent", "MediaRecorder",
  "MouseEvent", "Node", "OffscreenCanvas", "Path2D", "PointerEvent", "ResizeObserver", "SVGElement", "TextDecoder",
  "TextEncoder", "URL", "URLSearchParams", "WebGL2RenderingContext", "WebSocket", "WheelEvent", "atob", "btoa",
  "cancelAnimationFrame", "clearInterval", "clearTimeout", "console", "createImageBitmap", "crypto", "devicePixelRatio",
  "document", "fetch", "getComputedStyle", "localStorage", "location", "matchMedia", "navigator", "performance",
  "queueMicrotask", "requestAnimationFrame", "sessionStorage", "setInterval", "setTimeout", "structuredClone", "window",
]; // prettier-ignore

const rules = {
  "array-callback-return": "error",
  "camelcase": ["error", { properties: "never", ignoreDestructuring: true }],
  "consistent-return": "error",
  "curly": "error",
  "eqeqeq": "error",
  "guard-for-in": "error",
  "max-lines": ["error", { max: 320, skipBlankLines: true, skipComments: true }],
  "no-console": "error",
  "no-eval": "error",
  "no-implied-eval": "error",
  "no-new-func": "error",
  "no-param-reassign": "error",
  "no-script-url": "error",
  "no-shadow": "error",
  "no-unused-vars": "error",
  "no-use-before-define": ["error", { functions: false, classes: false, variables: false }],
  "no-var": "error",
  "object-shorthand": "error",
  "prefer-const": "error",
  "no-restricted-syntax": [
    "error",
    { selector: `MemberExpression[property.name=/^(${HTML})$/]`, message: NO_HTML },
    { selector: `MemberExpression[computed=true][property.value=/^(${HTML})$/]`, message: NO_HTML },
    { selector: "ImportExpression[source.type!=Literal], ImportNamespaceSpecifier, ExportDefaultDeclaration, ExportAllDeclaration",
      message: "The page's modules are joined into one file: import { a } from \"./x.js\" and export declarations" },
  ],
};

export default [
  js.configs.recommended,
  {
    files: ["rosbridge_sim/page/js/**/*.js"],
    languageOptions: {
      ecmaVersion: "latest", // for `import ... with`; tsc holds the rest to ES2022
      sourceType: "module",
      globals: Object.fromEntries(BROWSER.map((name) => [name, "readonly"])),
    },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules,
  },
  {
    files: ["rosbridge_sim/page/js/texts.js", "rosbridge_sim/page/js/texts_ko.js"],
    rules: { "max-lines": "off" }, // all texts of a language are in one file, for translators
  },
  {
    files: ["rosbridge_sim/page/report/*.js"], // a script of its own, within the file of a report
    languageOptions: {
      ecmaVersion: "latest",
      sourceType: "script",
      globals: Object.fromEntries(
        [
          ...BROWSER, "HTMLDetailsElement", "HTMLFormElement", "HTMLParagraphElement", "HTMLScriptElement",
          "HTMLSpanElement", "HTMLTableElement", "Option",
        ].map((name) => [name, "readonly"]),
      ),
    },
    rules: { ...rules, "max-lines": "off" },
  },
  {
    files: ["tests/page/js/**/*.js"],
    languageOptions: {
      ecmaVersion: "latest",
      sourceType: "module",
      globals: Object.fromEntries([...BROWSER, "globalThis", "Buffer", "process"].map((name) => [name, "readonly"])),
    },
    rules: { ...rules, "max-lines": "off" },
  },
];
