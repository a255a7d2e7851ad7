// Scroll back: the last two minutes of the live drive under the map, and the way into another future.

import { ActionButton, Notice } from "../widgets/action_button.js";
import { askUser } from "../widgets/dialog.js";
import { element, setText } from "../widgets/dom.js";
import { Scrubber } from "../widgets/scrubber.js";
import { KeptSnapshots } from "./kept_snapshots.js";
import { FRAME_S } from "./time_watch.js";

/** Nearer to the last moment than this, what is live is shown [s]. */
const LIVE_WITHIN = 0.25;
/** A mark leads so far before what it marks, so that its cause is seen [s]. */
const BEFORE_MARK = 2;
/** Time step of synchronous mode after a branch [ms]. */
const BRANCH_STEP = 20;

/**
 * @param {import("./context.js").PanelContext} context @param {import("./driving.js").Driving} driving
 * @param {HTMLElement} menu at the right end @returns {HTMLElement}
 */
export function makeTimelineBar({ connection, scene, time, timeControls: controls, texts: { timeline: texts, time: { cancel } } }, driving, menu) {
  const { timeline } = scene;
  const snapshots = new KeptSnapshots(connection, scene, time.userId);
  const notice = new Notice();
  const ago = (/** @type {number} */ at) => Math.max(0, timeline.end - at);
  let isPlaying = false;
  let cursor = 0;

  /** @param {number} at [s] */
  const goTo = (at) => {
    cursor = at;
    scene.showPast(ago(at) < LIVE_WITHIN ? null : at);
    show();
  };
  const goLive = () => {
    setPlaying(false);
    scene.showPast(null);
    show();
  };
  const scrubber = new Scrubber({
    label: texts.position,
    step: 0.1,
    clock: (at) => (scene.past !== null ? texts.ago(ago(at).toFixed(1)) : connection.isLive ? texts.live : texts.last),
    onInput: goTo,
  });
  const play = new ActionButton({ ...texts.play, name: texts.play.title, className: "small", notice, act: () => setPlaying(!isPlaying) });
  const keep = element("input", { type: "checkbox" });
  const keepText = element("span", {});
  keep.onchange = () => void snapshots.switch(keep.checked);

  let playedAt = 0;
  /** @param {number} now [ms] */
  const playOn = (now) => {
    if (isPlaying && scene.past !== null) {
      goTo(cursor + Math.min(now - playedAt, 200) / 1000);
      playedAt = now;
      requestAnimationFrame(playOn);
    } else {
      setPlaying(false);
    }
  };
  /** @param {boolean} isOn */
  const setPlaying = (isOn) => {
    if (isOn && !isPlaying) {
      playedAt = performance.now();
      requestAnimationFrame(playOn);
    }
    isPlaying = isOn;
    play.setFace(isOn ? texts.hold : texts.play);
  };

  const branch = new ActionButton({
    ...texts.branch,
    className: "small",
    notice,
    act: async () => {
      const { past } = scene;
      const snapshot = past && snapshots.nearest(past.frame);
      if (!past || !snapshot) {
        return;
      }
      const { title, body, confirm } = texts.branchDialog;
      const seconds = ((snapshot.frame - past.frame) * FRAME_S).toFixed(1);
      if (await askUser({ title, confirm, cancel, isDangerous: true, content: [element("p", {}, body(snapshot.frame, seconds))] })) {
        if (!time.state.isOwn) {
          await controls.take(BRANCH_STEP);
        }
        const answer = await controls.restore(snapshot.id);
        goLive();
        notice.show(texts.branched(Number(answer.frame)));
      }
    },
  });

  const banner = element("div", { className: "past-banner", hidden: true });
  const bannerTime = element("strong", {});
  const back = element("button", { type: "button", className: "primary", title: texts.backToLive.title }, texts.backToLive.label);
  back.onclick = goLive;
  banner.append(bannerTime, element("span", {}, texts.worldGoesOn), back);

  const show = () => {
    const { past } = scene;
    const at = past === null ? timeline.end : cursor;
    document.documentElement.dataset.past = String(past !== null);
    banner.hidden = past === null;
    setText(bannerTime, past === null ? "" : texts.banner(ago(past.time).toFixed(1), past.frame));
    scrubber.show({ from: timeline.start, to: timeline.end, time: at, isDisabled: timeline.moments.length < 2 || driving.session.isOn });
    scrubber.showMarks(
      timeline.marks.map((mark) => ({ at: mark.time, kind: mark.kind, title: texts.mark(texts.marks[mark.kind], mark.text, ago(mark.time).toFixed(0)) })),
      (mark) => goTo(Math.max(timeline.start, mark.at - BEFORE_MARK)),
    );
    const notBack = past === null ? texts.scrollFirst : "";
    play.setReason(notBack);
    branch.setReason(notBack || (snapshots.kept.length === 0 ? texts.noSnapshot : time.reasons.restore));
    keep.checked = snapshots.isOn;
    setText(keepText, texts.keep(snapshots.kept.length));
  };
  scene.onLive(() => {
    if (scene.past === null) {
      setPlaying(false);
    }
    show();
  });
  time.onChange(show);
  connection.onSilence(show);
  snapshots.onChange(() => {
    if (snapshots.problem) {
      notice.show(texts.keepFailed(snapshots.problem), "bad");
    }
    show();
  });
  driving.onChange((isOn) => (isOn ? goLive() : show()));
  const buttons = element("div", { className: "timeline-buttons" }, branch.element, element("label", { title: texts.keepHint }, keep, keepText));
  const bar = element("section", { className: "timeline", "aria-label": texts.title }, play.element, scrubber.element, buttons, menu, notice.element);
  return element("div", { className: "timeline-layer" }, banner, bar);
}
