/** The map on the page: canvas, cameras, gestures and tools. A picture is drawn only if something has changed. */

import { PoseTrack } from "../scene/interpolation.js";
import { LineBuffer } from "../scene/line_buffer.js";
import { Trails } from "../scene/trails.js";
import { element } from "../widgets/dom.js";
import { fillLines } from "./changing_lines.js";
import { ChaseCamera } from "./chase_camera.js";
import { LabelLayer } from "./labels.js";
import { listenToDrops, listenToPointers } from "./map_pointer.js";
import { MeasureTool, PlaceTool, toolLabels } from "./map_tools.js";
import { makePalette } from "./palette.js";
import { Renderer } from "./renderer.js";
import { makeSceneLabels } from "./scene_labels.js";
import { nearestPlaces, TopCamera } from "./top_camera.js";
import { Takers } from "../wire/takers.js";

/** @typedef {import("../scene/store.js").SceneStore} SceneStore */
/** @typedef {import("./gestures.js").Point} Point */
/** @typedef {"top" | import("./chase_camera.js").PerspectiveName} CameraName */

/** Sharper than this costs much and is not seen. */
const MOST_RATIO = 2;
/** Turn behind the car for each pixel of a drag [rad]. */
const ORBIT_STEP = 0.006;

/** The map. */
export class MapView {
  views = new Takers();
  /** Be told after each picture in which the view has changed, and of a change of the tools. */
  onView = this.views.addNow;
  /** @type {Takers<[string]>} */
  lights = new Takers();
  /** Be told of clicks on traffic lights. */
  onLight = this.lights.add;

  /**
   * @param {object} parts @param {SceneStore} parts.scene @param {import("../scene/contacts.js").ContactList} parts.contacts
   * @param {import("../scene/drawn_topics.js").DrawnTopics} parts.drawn @param {import("../layout.js").Texts} parts.texts
   * @param {WebGL2RenderingContext} parts.gl - of the canvas @param {HTMLCanvasElement} parts.canvas
   */
  constructor({ scene, contacts, drawn, texts, gl, canvas }) {
    this.scene = scene;
    this.contacts = contacts;
    this.drawn = drawn;
    this.texts = texts.mapView;
    this.gl = gl;
    this.canvas = canvas;
    this.labels = new LabelLayer();
    this.element = element("div", { className: "map-view" }, canvas, this.labels.element);
    this.renderer = new Renderer(gl);
    this.top = new TopCamera();
    this.chase = new ChaseCamera();
    /** @type {CameraName} */
    this.mode = "top";
    this.isFollowing = true;
    this.showsVelocities = false;
    this.showsMeetings = false;
    /** @type {{other: number, time: number}[]} */
    this.meetings = [];
    /** The scenario that the first picture was fitted to. */
    this.placedFor = "";
    this.poses = new PoseTrack();
    this.trails = new Trails();
    this.lines = new LineBuffer();
    /** @type {MeasureTool | PlaceTool | null} */
    this.tool = null;
    /** @type {Point | null} */
    this.pointer = null;
    this.lastTime = 0;
    this.isScheduled = false;
    this.hasNewLines = true;
    /** Hint for the user of the tool. */
    this.hint = "";
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.still = matchMedia("(prefers-reduced-motion: reduce)");
    this.palette = makePalette(this.dark.matches);
    this.listen();
  }

  /** A camera in perspective draws the picture. */
  get isChase() {
    return this.mode !== "top";
  }

  get camera() {
    return this.isChase ? this.chase : this.top;
  }

  // Interface for other modules

  /**
   * Let the user choose a place: a click is the place, a drag from it the heading.
   * @param {{hint?: string}} [options]
   * @returns {Promise<import("./map_tools.js").PickedPlace | null>} null if the user gave it up
   */
  pickPlace({ hint = "" } = {}) {
    this.scene.showPast(null);
    this.endTool();
    return new Promise((resolve) => {
      this.tool = new PlaceTool((place) => {
        this.tool = null;
        this.change();
        resolve(place);
      });
      this.hint = hint;
      this.change();
    });
  }

  /** Take things that are dropped on the map. @param {string} kind - of `DataTransfer` @param {(place: Point) => void} take */
  onDrop(kind, take) {
    listenToDrops(this, kind, take);
  }

  // Commands of buttons and keys

  toggleCamera() {
    this.setCamera(this.isChase ? "top" : "chase");
  }

  /** @param {CameraName} name */
  setCamera(name) {
    this.endTool();
    this.mode = name;
    if (name !== "top") {
      this.chase.mode = name;
    }
    const target = this.target();
    if (target !== null) {
      this.chase.follow(target, 0);
      this.isFollowing = this.isFollowing || this.isChase;
    }
    this.change();
  }

  toggleFollow() {
    this.isFollowing = !this.isFollowing;
    this.change();
  }

  /** @param {number} factor */
  zoomBy(factor) {
    this.zoom(0.5 * this.top.width, 0.5 * this.top.height, factor);
  }

  /** @param {number} angle - counter-clockwise [rad] */
  turnBy(angle) {
    if (this.isChase) {
      this.chase.orbitBy(angle, 0);
    } else {
      this.top.rotateAt(0.5 * this.top.width, 0.5 * this.top.height, angle);
    }
    this.change();
  }

  northUp() {
    if (this.isChase) {
      this.chase.look.turn = 0;
    }
    this.top.rotateAt(0.5 * this.top.width, 0.5 * this.top.height, -this.top.rotation);
    this.change();
  }

  showAll() {
    if (this.scene.map !== null) {
      this.mode = "top";
      this.isFollowing = false;
      this.top.fit(this.scene.map);
      this.change();
    }
  }

  /** Move the picture. @param {number} dx - [pixels] @param {number} dy - [pixels] */
  panBy(dx, dy) {
    if (this.isChase) {
      this.chase.orbitBy(-ORBIT_STEP * dx, ORBIT_STEP * dy);
    } else {
      this.isFollowing = false;
      this.top.panBy(dx, dy);
    }
    this.change();
  }

  /** Show a place in the middle. @param {Point} place */
  goTo(place) {
    this.mode = "top";
    this.isFollowing = false;
    Object.assign(this.top, { x: place.x, y: place.y });
    this.change();
  }

  toggleMeasure() {
    const isOn = this.tool instanceof MeasureTool;
    this.endTool();
    if (!isOn) {
      this.tool = new MeasureTool();
      this.hint = this.texts.measureHint;
    }
    this.change();
  }

  /** End the tool that takes the clicks. @returns {boolean} there was one */
  endTool() {
    const { tool } = this;
    this.tool = null;
    if (tool instanceof PlaceTool) {
      tool.cancel();
    }
    this.change();
    return tool !== null;
  }

  // Pictures

  /** Draw a picture soon, because something has changed. */
  change() {
    this.hasNewLines = true;
    this.schedule();
  }

  schedule() {
    if (!this.isScheduled) {
      this.isScheduled = true;
      requestAnimationFrame((now) => this.drawFrame(now));
    }
  }

  /** @param {number} now - [ms] */
  drawFrame(now) {
    this.isScheduled = false;
    if (this.gl.isContextLost()) {
      return;
    }
    const seconds = Math.min((now - this.lastTime) / 1000, 0.1);
    this.lastTime = now;
    // The time of a frame is that of its beginning; a state may have come after it.
    this.poses.update(now);
    const isTurning = this.moveCameras(seconds);
    const fresh = this.contacts.fresh(performance.now(), this.scene.past?.frame);
    if (this.isChase) {
      void this.scene.wantMesh((parts) => {
        this.renderer.setMesh(parts);
        this.canvas.dataset.mesh = this.scene.meshDigest; // scripts that take pictures wait for it
        this.change();
      });
    }
    fillLines(this, fresh);
    const { scene, poses, palette, camera, drawn } = this;
    const isLive = scene.past === null;
    this.renderer.draw({ camera, palette, state: poses.last, poses, drawn: isLive ? drawn : null, hidden: this.hiddenRow() });
    const marks = { leading: this.isChase ? this.targetRow() : -1, contacts: fresh, meetings: this.meetings, texts: isLive ? drawn.texts : [] };
    this.labels.show([...makeSceneLabels({ scene, poses, camera, ...marks }, this.texts), ...toolLabels(this)]);
    this.views.tell();
    if (isTurning || fresh.length > 0 || this.poses.isMoving(now)) {
      this.schedule();
    }
  }

  /** @param {number} seconds - since the last picture @returns {boolean} the camera still turns */
  moveCameras(seconds) {
    const target = this.target();
    if (target === null) {
      return false;
    }
    const { state } = this.scene;
    if (state !== null && (this.placedFor !== state.map_digest + state.scenario || this.top.hasLost(state, this.targetRow()))) {
      this.placedFor = state.map_digest + state.scenario;
      this.chase.follow(target, 0);
      this.top.fitAround(target, nearestPlaces(state, this.targetRow()));
    }
    if (!this.isFollowing && !this.isChase) {
      return false;
    }
    Object.assign(this.top, { x: target.x, y: target.y });
    return this.chase.follow(target, this.isChase && !this.still.matches ? seconds : 0) && this.isChase;
  }

  /** Row of the entity that the camera is in; -1: there is none. */
  hiddenRow() {
    return this.mode === "seat" ? this.targetRow() : -1;
  }

  /** Row of the entity that the cameras follow; -1: there is none. */
  targetRow() {
    const selected = this.scene.selectedRow();
    return selected >= 0 ? selected : (this.scene.egos()[0]?.row ?? -1);
  }

  target() {
    const { poses } = this;
    const row = this.targetRow();
    if (row < 0 || row >= poses.x.length) {
      return null;
    }
    const place = { x: poses.x[row], y: poses.y[row], z: poses.z[row], heading: poses.heading[row] };
    const { last } = poses;
    return last === null ? place : { ...place, pitch: last.pitch[row], length: last.length[row], width: last.width[row], height: last.height[row], center: last.center_x[row] };
  }

  // Events

  listen() {
    const { scene, canvas } = this;
    scene.onMap(() => this.takeMap());
    scene.onState(() => this.takeState());
    scene.onSelect(() => this.change());
    this.drawn.onChange(() => this.schedule());
    this.dark.addEventListener("change", () => {
      this.palette = makePalette(this.dark.matches);
      this.change();
    });
    new ResizeObserver(() => this.resize()).observe(this.element);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.renderer = new Renderer(this.gl);
      this.scene.meshDigest = "";
      this.takeMap();
    });
    listenToPointers(this);
  }

  takeMap() {
    if (this.scene.map !== null) {
      this.renderer.setMap(this.scene.map);
      if (this.target() === null) {
        this.top.fit(this.scene.map);
      }
      this.change();
    }
  }

  takeState() {
    const { state } = this.scene;
    if (state === null) { // another connection: nothing of the last one is shown
      this.poses = new PoseTrack();
      this.trails = new Trails();
    } else {
      this.poses.take(state, performance.now());
      this.poses.update(-Infinity); // rows of the new state, for whoever asks before the next picture
      if (this.scene.past === null) {
        this.trails.take(state, this.scene.selectedRow());
      }
    }
    this.change();
  }

  resize() {
    const { clientWidth, clientHeight } = this.element;
    const ratio = Math.min(devicePixelRatio || 1, MOST_RATIO);
    this.canvas.width = Math.max(1, Math.round(clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(clientHeight * ratio));
    this.top.resize(clientWidth, clientHeight);
    this.chase.resize(clientWidth, clientHeight);
    this.change();
  }

  /** @param {number} x @param {number} y @param {number} factor */
  zoom(x, y, factor) {
    if (this.isChase) {
      this.chase.zoomBy(factor);
    } else if (this.isFollowing) {
      this.top.zoomAt(0.5 * this.top.width, 0.5 * this.top.height, factor); // what it follows stays in the middle
    } else {
      this.top.zoomAt(x, y, factor);
    }
    this.change();
  }

  /** @param {number} x @param {number} y @param {number} angle */
  twist(x, y, angle) {
    if (!this.isChase) {
      this.top.rotateAt(x, y, angle);
      this.change();
    }
  }

  /** Show what is under the pointer. */
  hover() {
    if (this.tool !== null) {
      this.change();
    } else {
      this.views.tell();
    }
  }
}
