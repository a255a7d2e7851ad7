// The panel "Driving": begins and ends a drive by keys, game pad or touch pads.

import { ActionButton, Notice } from "../widgets/action_button.js";
import { element, setText } from "../widgets/dom.js";
import { TouchPad } from "../widgets/touch_pad.js";
import { controlModeRequest, egoName, gearRequest, leaseRequest } from "../wire/requests.js";
import { inputOfGamepad, inputOfKeys, inputOfPads, isDrivingKey, NO_INPUT, USUAL_STEER_LIMIT } from "./driving_model.js";
import { COMMAND_INTERVAL, DrivingSession } from "./driving_session.js";
import { Takers } from "../wire/takers.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/** Numbers on the wire of the gears that driving uses. */
const REVERSE_GEAR = 2;
const DRIVE_GEAR = 4;
/** Control mode in which a program drives. */
const EXTERNAL_MODE = 3;
/** Slower than this the gear may change from D to R [m/s]. */
const STANDSTILL = 0.3;
/** The simulator lifts the pedals when so long no command has come [s]: 15 commands, more than a browser loses at once. */
const LEASE = 0.5;
/** A key that steps in synchronous mode of the page. */
const STEP_KEY = "Period";
/** Machines with the touch pads, as in page.css. */
const TOUCH = "(any-pointer: coarse)";
/** A key that changes between D and R. */
const GEAR_KEY = "KeyR";

/** The panel "Driving": the elements and the events of the page around a DrivingSession. */
export class Driving {
  /** @type {Takers<[boolean]>} */
  changes = new Takers();

  /** @param {PanelContext} context */
  constructor(context) {
    this.context = context;
    this.texts = context.texts.driving;
    this.title = this.texts.title;
    this.notice = new Notice();
    /** @type {Set<string>} */
    this.codes = new Set();
    this.pads = { steer: 0, pedal: 0 };
    this.steerLimit = USUAL_STEER_LIMIT;
    this.ego = 0;
    this.hasMode = false; // the server has confirmed that a program may drive
    this.isStepping = false;
    this.wantsStep = false;
    /** @type {any} */
    this.timer = undefined;
    this.session = new DrivingSession({
      send: (operation) => this.send(operation),
      callInSteps: (operation) => this.callInSteps(operation),
      now: () => performance.now(),
      car: () => ({ ego: this.ego, speed: context.ego.values?.speed ?? 0, steerLimit: this.steerLimit }),
      isInSteps: () => context.time.state.kind === "synchronous",
    });
    this.button = new ActionButton({ ...this.texts.begin, className: "primary", notice: this.notice, act: () => this.toggle() });
    this.stepButton = new ActionButton({ ...this.texts.step, className: "step", notice: this.notice, act: () => this.step() });
    this.state = element("p", { className: "driving-state", role: "status" });
    this.live = element("p", { className: "driving-live" });
    this.warning = element("p", { className: "notice", "data-kind": "warn", role: "alert", hidden: true });
    this.padRow = element(
      "div",
      { className: "pads", hidden: true },
      this.makePad(this.texts.steerPad, "pad-steer", ["◀", "▶"], (x) => ({ steer: 0 - x })),
      this.makePad(this.texts.pedalPad, "pad-pedal", ["▲", "▼"], (_x, y) => ({ pedal: y })),
    );
    this.element = element(
      "div",
      { className: "driving" },
      element("div", { className: "button-row" }, this.button.element, this.stepButton.element),
      this.state,
      this.live,
      this.warning,
      this.notice.element,
      this.padRow,
      this.makeHelp(),
    );
    this.listen();
    context.time.drivenCommand = (seconds) => this.session.commandForStep(seconds);
    this.show();
  }

  /**
   * @param {string} label @param {string} className @param {[string, string]} signs - at its ends
   * @param {(x: number, y: number) => Partial<{steer: number, pedal: number}>} take
   */
  makePad(label, className, signs, take) {
    const onMove = (/** @type {number} */ x, /** @type {number} */ y) => {
      Object.assign(this.pads, take(x, y));
      this.session.setInput("pads", inputOfPads(this.pads));
    };
    return new TouchPad({ label, className, signs, onMove }).element;
  }

  makeHelp() {
    const rows = this.texts.keys.map(([key, does]) => element("div", {}, element("dt", {}, element("kbd", {}, key)), element("dd", {}, does)));
    return element("details", {}, element("summary", {}, this.texts.keysTitle), element("dl", { className: "keys" }, ...rows));
  }

  listen() {
    const { context } = this;
    window.addEventListener("keydown", (event) => this.press(event));
    window.addEventListener("keyup", (event) => this.release(event));
    window.addEventListener("blur", () => this.letGo());
    window.addEventListener("pagehide", () => this.end());
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) {
        this.end(this.texts.endedHidden);
      }
    });
    context.connection.onState((state) => {
      if (state !== "open") {
        this.end(this.texts.endedLost);
      }
    });
    context.time.onChange(() => this.judge());
    context.drivers.onChange(() => this.judge());
    context.ego.onChoice(() => this.end());
  }

  /** End the drive if it is not possible any more, and show who else drives. */
  judge() {
    const reason = this.context.time.reasons.drive;
    if (this.session.isOn) {
      const mode = this.context.drivers.ofEgo(this.ego)?.ctrl_mode ?? 0;
      const wasTaken = this.hasMode && mode !== EXTERNAL_MODE;
      this.hasMode ||= mode === EXTERNAL_MODE;
      const isLost = this.context.connection.state !== "open";
      const ended = isLost ? this.texts.endedLost : reason || (wasTaken ? this.texts.endedMode(this.context.texts.ego.modes[mode] ?? String(mode)) : "");
      if (ended) {
        this.end(ended);
      }
    }
    this.button.setReason(reason);
    this.show();
  }

  /** @param {(isOn: boolean) => void} take called now, and when a drive begins or ends */
  onChange(take) {
    take(this.session.isOn);
    this.changes.add(take);
  }

  async toggle() {
    if (this.session.isOn) {
      this.end();
      return;
    }
    const { context, texts } = this;
    this.ego = context.ego.number;
    const driver = context.drivers.ofEgo(this.ego);
    if (driver && driver.ctrl_mode !== EXTERNAL_MODE) {
      await context.actions.run(texts.takeMode, controlModeRequest(this.ego, EXTERNAL_MODE));
    }
    if (driver && driver.gear !== DRIVE_GEAR && driver.gear !== REVERSE_GEAR) {
      await context.actions.run(texts.gearDrive, gearRequest(this.ego, DRIVE_GEAR));
    }
    await this.askSteerLimit();
    await this.askLease(LEASE * Math.max(1, context.drivers.message?.real_time_factor ?? 1));
    const reason = this.reasonNotToBegin();
    if (reason) {
      await this.askLease(0);
      throw new Error(reason);
    }
    this.hasMode = driver?.ctrl_mode === EXTERNAL_MODE; // else messages of before the begin may still come
    this.session.begin();
    this.timer = setInterval(() => this.update(), COMMAND_INTERVAL);
    this.show();
  }

  /** Return why a drive that was asked for may not begin after all: the answers of the server took a while. */
  reasonNotToBegin() {
    const { texts, context } = this;
    if (document.hidden) {
      return texts.endedHidden;
    }
    return this.ego === context.ego.number ? context.time.reasons.drive : texts.otherEgo;
  }

  /** Ask for the steering limit of the ego; without an answer the usual one holds. */
  async askSteerLimit() {
    try {
      const request = { request: { unique_id: this.ego } };
      const answer = await this.context.connection.call("/Service_MoraiVehicleSpec", request);
      const degrees = Number(answer.response.max_steering);
      this.steerLimit = degrees > 0 ? (degrees * Math.PI) / 180 : USUAL_STEER_LIMIT;
    } catch {
      this.steerLimit = USUAL_STEER_LIMIT; // a server may have turned the service off
    }
  }

  /** Have the simulator lift the pedals when this page is lost. @param {number} seconds simulated; 0 ends that */
  async askLease(seconds) {
    const { name, values } = leaseRequest(this.ego, seconds);
    const answer = await this.context.connection.call(name, values);
    this.context.drivers.ownAddress = answer.client;
  }

  /** @param {import("../wire/requests.js").Operation} operation */
  send(operation) {
    this.context.actions.send(this.texts.action, operation);
  }

  /** @param {import("../wire/requests.js").Operation} operation */
  callInSteps(operation) {
    if (this.context.time.state.isOwn) { // the frames of another master are its own
      this.context.actions.run(this.texts.action, operation).catch((error) => this.notice.showError(error));
    }
  }

  update() {
    const pad = navigator.getGamepads?.().find((one) => one?.mapping === "standard");
    this.session.setInput("gamepad", pad ? inputOfGamepad(pad) : NO_INPUT);
    this.session.update();
    const { accel, brake, steering } = this.session.controls.command();
    const isLeft = Math.sign(Math.round((steering * 1800) / Math.PI));
    const angle = this.context.texts.ego.wheelAngle(Math.abs((steering * 180) / Math.PI).toFixed(1), isLeft);
    setText(this.live, this.texts.live(Math.round(accel * 100), Math.round(brake * 100), angle));
  }

  /** @param {string} [reason] for the user */
  end(reason = "") {
    this.codes.clear();
    if (!this.session.isOn) {
      return;
    }
    this.session.end();
    clearInterval(this.timer);
    this.context.connection.unadvertise(egoName(this.ego, "/ctrl_cmd"));
    if (!this.session.port.isInSteps()) { // otherwise it lifts the pedals when time runs again, if nobody else drives
      this.askLease(0).catch(() => {}); // without a connection the server has lifted the pedals by now
    }
    this.notice.show(reason, "bad");
    this.show();
  }

  /** Lift the pedals: the user cannot hold them, for the window has lost the keyboard. */
  letGo() {
    this.codes.clear();
    this.session.lift();
  }

  show() {
    const { texts, session, context } = this;
    const isOn = session.isOn;
    this.button.setFace(isOn ? texts.end : texts.begin);
    this.button.element.setAttribute("aria-pressed", String(isOn));
    this.padRow.hidden = !isOn;
    document.body.classList.toggle("is-driving", isOn);
    const isInSteps = session.port.isInSteps();
    const isTouch = matchMedia(TOUCH).matches;
    const words = isInSteps ? (isTouch ? texts.onInStepsTouch : texts.onInSteps) : isTouch ? texts.onTouch : texts.on;
    setText(this.state, isOn ? words : "");
    this.stepButton.element.hidden = !(isOn && isInSteps);
    this.stepButton.setReason(context.time.reasons.step);
    this.state.hidden = this.live.hidden = !isOn;
    const others = context.drivers.otherPublishers(isOn ? this.ego : context.ego.number);
    this.warning.hidden = others.length === 0;
    setText(this.warning, others.length ? texts.otherPublishers(others.map((one) => context.drivers.nameOf(one)).join(", ")) : "");
    this.changes.tell(isOn);
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    if (!this.session.isOn || event.ctrlKey || event.altKey || event.metaKey || isTyping(event.target)) {
      return;
    }
    if (isDrivingKey(event.code)) {
      event.preventDefault(); // no scrolling, and no click of the focused button by Space
      this.codes.add(event.code);
      this.session.setInput("keys", inputOfKeys(this.codes));
    } else if (event.code === STEP_KEY) {
      event.preventDefault();
      void this.step();
    } else if (event.code === GEAR_KEY && !event.repeat) {
      event.preventDefault();
      void this.changeGear();
    } else if (event.code === "Escape") {
      event.preventDefault();
      this.end();
    }
  }

  /** @param {KeyboardEvent} event */
  release(event) {
    if (this.codes.delete(event.code)) {
      event.preventDefault();
      this.session.setInput("keys", inputOfKeys(this.codes));
    }
  }

  /**
   * Step once in synchronous mode, with the pedals as they are held; if nobody is the master, the page becomes it. While a step is under way one more is
   * kept, not all: a held key repeats faster than a slow world steps.
   */
  async step() {
    const { time, timeControls } = this.context;
    this.wantsStep = true;
    if (this.isStepping) {
      return;
    }
    this.isStepping = true;
    try {
      while (this.wantsStep && time.state.kind === "synchronous" && !time.reasons.step) {
        this.wantsStep = false;
        await timeControls.step(1, time.ownTimeStep);
      }
    } catch (error) {
      this.notice.showError(error);
    } finally {
      this.isStepping = this.wantsStep = false;
    }
  }

  /** Change between D and R. */
  async changeGear() {
    const { ego, drivers, actions } = this.context;
    const isForward = drivers.ofEgo(this.ego)?.gear !== REVERSE_GEAR;
    try {
      if (Math.abs(ego.values?.speed ?? 0) > STANDSTILL) {
        throw new Error(this.texts.stopFirst);
      }
      const gear = isForward ? REVERSE_GEAR : DRIVE_GEAR;
      await actions.run(isForward ? this.texts.gearReverse : this.texts.gearDrive, gearRequest(this.ego, gear));
    } catch (error) {
      this.notice.showError(error);
    }
  }
}

/** @param {EventTarget | null} target whether keys belong to a field there */
function isTyping(target) {
  return target instanceof HTMLElement && (target.isContentEditable || target.matches("input, textarea, select"));
}
