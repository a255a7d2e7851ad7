// The menu "View": cameras, marks of motion, a picture, a clip, and a link to what is seen.

import { TAB_IDS } from "../layout.js";
import { ActionButton, Notice } from "../widgets/action_button.js";
import { askUser } from "../widgets/dialog.js";
import { element, saveFile, setText } from "../widgets/dom.js";
import { copyText } from "./code.js";
import { CAMERAS, linkTo, parseLink } from "./page_link.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** Longest clip [ms], [bytes]. */
const CLIP_TIME = 60_000;
const CLIP_BYTES = 100e6;
const CLIP_RATE = 30;
const CLIP_BITS = 8e6;

/** @param {PanelContext} context @param {import("../layout.js").Layout} layout @returns {HTMLElement} the button with its menu */
export function makeViewMenu(context, layout) {
  const { scene, mapView, texts: { view: texts } } = context;
  const notice = new Notice();
  const radios = CAMERAS.map((name) => {
    const input = element("input", { type: "radio", name: "camera", value: name, disabled: mapView === null });
    input.onchange = () => mapView?.setCamera(name);
    return { name, input, label: element("label", {}, input, texts.cameras[name]) };
  });
  const marks = /** @type {const} */ (["showsVelocities", "showsMeetings"]).map((name) => {
    const input = element("input", { type: "checkbox", disabled: mapView === null });
    input.onchange = () => {
      if (mapView) {
        mapView[name] = input.checked;
        mapView.change();
      }
    };
    return element("label", { title: texts.hints[name] }, input, texts.marks[name]);
  });
  const address = element("output", { className: "view-link", hidden: true });
  const copy = new ActionButton({
    ...texts.copy,
    notice,
    act: async () => {
      const row = scene.selectedRow();
      const follow = row < 0 ? null : { id: Number(scene.selectedId), isEgo: scene.isEgoSelected };
      setText(address, linkTo(location.href, { scenario: scene.live?.scenario || null, camera: mapView?.mode ?? null, follow, panel: layout.tabs.shown }));
      address.hidden = false;
      await copyText(address);
      notice.show(texts.copied);
    },
  });
  const save = new ActionButton({
    ...texts.save,
    notice,
    act: () => mapView && pictureOf(mapView).toBlob((blob) => blob && saveFile(`${scene.state?.scenario ?? "map"}_${scene.state?.frame ?? 0}.png`, blob)),
  });
  const clip = makeClipButton(context, notice);
  [save, clip].forEach((button) => button.setReason(mapView ? "" : texts.noMap));
  const menu = element(
    "section",
    { className: "view-menu", id: "view-menu", "aria-label": texts.title, hidden: true },
    element("fieldset", {}, element("legend", {}, texts.camera), ...radios.map(({ label }) => label)),
    element("fieldset", {}, element("legend", {}, texts.motion), ...marks),
    element("div", { className: "button-row" }, save.element, clip.element, copy.element),
    notice.element,
    address,
  );
  const toggle = element("button", { type: "button", className: "small", "aria-expanded": "false", "aria-controls": "view-menu" }, texts.title);
  const open = (/** @type {boolean} */ isOpen) => {
    menu.hidden = !isOpen;
    toggle.setAttribute("aria-expanded", String(isOpen));
  };
  toggle.onclick = () => open(menu.hidden !== false);
  menu.onkeydown = (event) => {
    if (event.key === "Escape") {
      event.stopPropagation();
      open(false);
      toggle.focus();
    }
  };
  mapView?.onView(() => radios.forEach(({ name, input }) => void (input.checked = name === mapView.mode)));
  followLink(context, notice, () => open(true));
  return element("div", { className: "view" }, toggle, menu);
}

/** The view as a picture, with its labels. @param {import("../drawing/map_view.js").MapView} view */
function pictureOf(view) {
  view.drawFrame(performance.now()); // the graphics card keeps no picture beyond its frame
  const { width, height } = view.canvas;
  const copy = element("canvas", { width, height });
  const pen = /** @type {CanvasRenderingContext2D} */ (copy.getContext("2d"));
  pen.drawImage(view.canvas, 0, 0);
  pen.scale(width / view.top.width, width / view.top.width);
  view.labels.paint(pen);
  return copy;
}

/** A button that records the map. @param {PanelContext} context @param {Notice} notice */
function makeClipButton({ mapView, texts: { view: texts } }, notice) {
  /** @type {MediaRecorder | null} */
  let recorder = null;
  const button = new ActionButton({
    ...texts.record,
    notice,
    act: () => {
      if (recorder) {
        recorder.stop();
        return;
      }
      if (!mapView || typeof MediaRecorder === "undefined") {
        throw new Error(texts.noRecorder);
      }
      const stream = mapView.canvas.captureStream(CLIP_RATE);
      const made = new MediaRecorder(stream, { mimeType: "video/webm", videoBitsPerSecond: CLIP_BITS });
      /** @type {Blob[]} */
      const parts = [];
      const timer = setTimeout(() => made.stop(), CLIP_TIME);
      made.ondataavailable = ({ data }) => {
        parts.push(data);
        if (made.state === "recording" && parts.reduce((sum, part) => sum + part.size, 0) > CLIP_BYTES) {
          made.stop();
        }
      };
      made.onstop = () => {
        clearTimeout(timer);
        stream.getTracks().forEach((track) => track.stop());
        recorder = null;
        button.setFace(texts.record);
        const file = new Blob(parts, { type: "video/webm" });
        if (file.size > 0) {
          saveFile("clip.webm", file);
        } else {
          notice.show(texts.emptyClip, "bad");
        }
      };
      made.start(1000);
      recorder = made;
      button.setFace(texts.stop);
      mapView.change(); // a picture at least, also of a world that stands
    },
  });
  return button;
}

/**
 * Do what the page's address asks for, once the scene is there; a scenario is loaded only if the user wants it.
 * @param {PanelContext} context @param {Notice} notice @param {() => void} open shows the notice
 */
function followLink({ scene, time, timeControls: controls, mapView, showTab, texts }, notice, open) {
  const { view: { link: linkTexts }, time: { cancel } } = texts;
  const { link, problems } = parseLink(location.search, TAB_IDS);
  if (problems.length > 0) {
    notice.show(problems.map(({ name, value, expected }) => linkTexts.problem(name, value, expected)).join(" "), "bad");
    open();
  }
  if (link.panel) {
    showTab(/** @type {import("../layout.js").TabId} */ (link.panel));
  }
  const show = () => {
    mapView?.setCamera(link.camera ?? mapView.mode);
    if (link.follow && !(link.follow.isEgo && link.follow.id === 0)) { // the first ego is followed by itself
      scene.select(link.follow.id, link.follow.isEgo);
      if (scene.selectedRow() < 0) {
        notice.show(linkTexts.noEntity(link.follow.id), "bad");
        open();
      }
    }
  };
  const load = async () => {
    const { scenario } = link;
    if (scenario && scenario !== scene.live?.scenario && (await askUser({ title: linkTexts.title(scenario), confirm: linkTexts.confirm, cancel, content: [element("p", {}, linkTexts.body)] }))) {
      try {
        if (time.reasons.load) {
          throw new Error(time.reasons.load);
        }
        await controls.load(scenario);
        const end = scene.onLive(() => {
          if (scene.live?.scenario === scenario) {
            end();
            show();
          }
        });
        return;
      } catch (error) {
        notice.showError(error);
        open();
      }
    }
    show();
  };
  // A world that stands sends one state, which may come before the time is known.
  let hasBegun = false;
  const begin = () => {
    if (!hasBegun && scene.live !== null && time.state.kind !== "unknown") {
      hasBegun = true;
      void load();
    }
  };
  scene.onLive(begin);
  time.onChange(begin);
}
