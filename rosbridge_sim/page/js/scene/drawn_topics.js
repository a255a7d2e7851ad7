/**
 * Topics whose messages are drawn on the map: found on the server, switched on where a program publishes them, taken to the
 * map's frame, and bounded in number and bytes.
 */

import { DRAWN_TYPES, drawnType, IDENTITY, keepMarkers, matrixAt, matrixOf, Sketch } from "./drawn_messages.js";
import { packedColour } from "./materials.js";
import { stampOf } from "./store.js";
import { Takers } from "../wire/takers.js";

/** @typedef {import("./drawn_messages.js").Matrix} Matrix */

/** Wait between two looks at the list of topics [ms]. */
const LOOK_INTERVAL = 2000;
/** A topic that is silent for so long may have no publisher any more [ms]. */
const SILENCE = 5000;
/** The simulator's own publisher: its topics are drawn only if the user wants it. */
const SIMULATOR = "/morai_sim";
/** Topics that are known, and those that are drawn at once. */
const MOST_TOPICS = 60;
const MOST_ON = 16;
/** A topic that brings more is switched off [bytes/s]. */
const MOST_BYTES = 4e6;
/** Shortest time between two messages [ms]; markers come one by one, and none of them may be left out. */
const THROTTLE = 100;
const MARKER_QUEUE = 1000;
const MARKERS = ["visualization_msgs/Marker", "visualization_msgs/MarkerArray"];
/** The server sends a frame's pose again after so much motion [rad, m], and ends where nobody hears for this time [s]. */
const FRAME_ANGLE = 0.002;
const FRAME_WAY = 0.02;
const FRAME_RATE = 20;
/** Poses of a frame that are kept, so that a message is placed where its frame was at its time: half a second. */
const KEPT_POSES = 10;
const FRAME_TIMEOUT = 10;
/** Frames that are the map's: a program that names none means it, too. */
const MAP_FRAMES = ["", "map", "world"];
/** Colours of topics, in order. */
export const TOPIC_COLOURS = ["#0a7f3f", "#b1178f", "#1759c4", "#b45309", "#0e7490", "#a21c1c"];

/** One topic. */
export class DrawnTopic {
  /** @param {string} name @param {string} type @param {string} colour */
  constructor(name, type, colour) {
    this.name = name;
    this.type = type;
    this.colour = colour;
    /** Null: nobody has published it yet. @type {boolean | null} */
    this.isOn = null;
    /** Messages older than this are not drawn [s] of simulated time; 0: until the next one. */
    this.keep = 0;
    /** Simulated time of the last message [s]. */
    this.at = -Infinity;
    /** When the last message came, or the topic was switched on [ms]. */
    this.heardAt = 0;
    /** @type {"" | "refused" | "bytes" | "frame" | "cut"} */
    this.note = "";
    this.frame = "";
    /** Messages, each with the matrix of its frame; markers by their names. @type {Map<string, {message: any, matrix: Matrix | null, at: number}>} */
    this.kept = new Map();
    /** @type {Sketch | null} */
    this.sketch = null;
    /** @type {{close: () => void} | null} */
    this.taker = null;
  }

  clear() {
    this.kept.clear();
    this.sketch = null;
    this.at = -Infinity;
  }
}

/** All of them. */
export class DrawnTopics {
  changes = new Takers();
  /** Be told of each change: of the list, and of what is drawn. */
  onChange = this.changes.add;

  /** @param {import("../wire/connection.js").Connection} connection @param {import("./store.js").SceneStore} scene */
  constructor(connection, scene) {
    this.connection = connection;
    this.scene = scene;
    /** @type {Map<string, DrawnTopic>} */
    this.topics = new Map();
    /** The last matrices of frames, with their times [s], the oldest first. @type {Map<string, {at: number, matrix: Matrix}[]>} */
    this.frames = new Map();
    /** Frames that are asked for. @type {Set<string>} */
    this.wanted = new Set();
    /** @type {{close: () => void} | null} */
    this.frameTaker = null;
    this.frameTopic = "";
    /** @type {any} */
    this.timer = undefined;
    /** Number of changes. */
    this.version = 0;
    /** Simulated time [s]. */
    this.time = 0;
    connection.onState((state) => this.begin(state === "open"));
    connection.onStatus(({ id, level }) => {
      const topic = level === "error" ? this.topics.get(String(id).replace("page:sub:", "")) : undefined;
      if (topic?.taker) {
        this.switch(topic, false, "refused");
      }
    });
    scene.onLive(() => this.takeTime());
  }

  /** @param {boolean} isOpen - a new connection knows nothing of the last one's topics */
  begin(isOpen) {
    clearTimeout(this.timer);
    this.frameTaker?.close();
    this.frameTaker = null;
    this.wanted.clear();
    this.frames.clear();
    for (const topic of this.topics.values()) {
      topic.taker?.close();
    }
    this.topics.clear();
    this.change();
    if (isOpen) {
      void this.look();
    }
  }

  /** Look for topics again and again, until the server does not let the page. */
  async look() {
    const { connection } = this;
    try {
      if (!connection.isHidden) {
        const { topics, types } = await connection.call("/rosapi/topics");
        await this.takeList(topics, types);
      }
      clearTimeout(this.timer);
      this.timer = connection.state === "open" && setTimeout(() => void this.look(), LOOK_INTERVAL);
    } catch {
      // the reason is in the log
    }
  }

  /** @param {string[]} names @param {string[]} types */
  async takeList(names, types) {
    for (const [i, name] of names.entries()) {
      const type = drawnType(types[i] ?? "");
      if (DRAWN_TYPES.has(type) && !this.topics.has(name) && this.topics.size < MOST_TOPICS) {
        this.add(name, type);
      }
    }
    for (const topic of this.topics.values()) {
      if (!names.includes(topic.name)) {
        topic.taker?.close();
        this.topics.delete(topic.name);
        this.change();
      } else if (topic.isOn === null || (topic.isOn && performance.now() > topic.heardAt + SILENCE)) {
        const { publishers } = await this.connection.call("/rosapi/publishers", { topic: topic.name });
        if (publishers.length === 0 && topic.isOn) {
          this.switch(topic, null); // its program has ended, and takes its plans with it
        } else if (publishers.length > 0 && topic.isOn === null) {
          this.switch(topic, publishers.some((/** @type {string} */ one) => one !== SIMULATOR));
        }
      }
    }
    if (this.wanted.size > 0 && !names.includes(this.frameTopic)) {
      await this.wantFrames(); // it ends where nobody hears, such as a hidden page
    }
  }

  /** @param {DrawnTopic} topic @param {boolean | null} isOn @param {DrawnTopic["note"]} [note] - why */
  switch(topic, isOn, note = "") {
    const numOn = [...this.topics.values()].filter((one) => one !== topic && one.isOn).length;
    topic.isOn = isOn && numOn < MOST_ON;
    topic.heardAt = performance.now();
    topic.note = note;
    topic.taker?.close();
    topic.taker = null;
    topic.clear();
    if (topic.isOn) {
      const options = MARKERS.includes(topic.type) ? { throttleMs: 0, queueLength: MARKER_QUEUE } : { throttleMs: THROTTLE, queueLength: 1 };
      const traffic = { bytes: -1, at: performance.now() };
      const take = (/** @type {any} */ message) => {
        const bytes = this.connection.topics.get(topic.name)?.bytes ?? 0;
        const seconds = (performance.now() - traffic.at) / 1000;
        if (traffic.bytes >= 0 && bytes - traffic.bytes > MOST_BYTES * Math.max(seconds, 1)) {
          this.switch(topic, false, "bytes");
          return;
        }
        if (traffic.bytes < 0 || seconds > 1) {
          Object.assign(traffic, { bytes, at: performance.now() });
        }
        this.takeMessage(topic, message);
      };
      topic.taker = this.connection.subscribe(topic.name, "", take, { ...options, encoding: "cbor" });
    }
    this.change();
  }

  /** @param {DrawnTopic} topic @param {string} colour - such as `#0a7f3f` */
  setColour(topic, colour) {
    topic.colour = colour;
    topic.sketch = null;
    this.change();
  }

  /** @param {DrawnTopic} topic @param {number} keep - [s] */
  setKeep(topic, keep) {
    topic.keep = keep;
    topic.sketch = null;
    this.change();
  }

  /** @param {DrawnTopic} topic @param {any} message */
  takeMessage(topic, message) {
    const { time } = this;
    topic.at = time;
    topic.heardAt = performance.now();
    topic.note = "";
    const prepare = (/** @type {any} */ one) => {
      topic.frame = one.header.frame_id.replace(/^\//, "").slice(0, 100);
      const matrix = this.matrixOf(topic.frame, stampOf(one));
      return { message: one, frame: topic.frame, matrix, at: time };
    };
    if (MARKERS.includes(topic.type)) {
      keepMarkers(topic.kept, message, prepare);
    } else {
      topic.kept.set("", prepare(message));
    }
    topic.sketch = null;
    this.change();
  }

  /** @param {string} frame @param {number} at - time [s]; 0: the last one @returns {Matrix | null} null: it is not known yet */
  matrixOf(frame, at) {
    if (MAP_FRAMES.includes(frame)) {
      return IDENTITY;
    }
    if (!this.wanted.has(frame) && this.wanted.size < MOST_TOPICS) {
      this.wanted.add(frame);
      void this.wantFrames();
    }
    const kept = this.frames.get(frame);
    return kept ? matrixAt(kept, at) : null;
  }

  /** Ask the server for the poses of all frames that are used. */
  async wantFrames() {
    const request = {
      source_frames: [...this.wanted],
      target_frame: "map",
      angular_thres: FRAME_ANGLE,
      trans_thres: FRAME_WAY,
      rate: FRAME_RATE,
      timeout: { secs: FRAME_TIMEOUT, nsecs: 0 },
    };
    try {
      const { topic_name: name } = await this.connection.call("/republish_tfs", request);
      const old = this.frameTaker;
      this.frameTopic = name;
      this.frameTaker = this.connection.subscribe(name, "tf2_web_republisher/TFArray", ({ transforms }) => this.takeFrames(transforms));
      old?.close();
    } catch {
      // the reason is in the log, and the panel says that the frame is not known
    }
  }

  /** @param {{header: any, child_frame_id: string, transform: {translation: any, rotation: any}}[]} transforms */
  takeFrames(transforms) {
    for (const { header, child_frame_id: frame, transform } of transforms) {
      const name = frame.replace(/^\//, "");
      const matrix = matrixOf(transform.translation, transform.rotation);
      const kept = this.frames.get(name) ?? [];
      const isNew = kept.length === 0;
      const at = stampOf({ header });
      this.frames.set(name, [...kept.filter((one) => one.at < at), { at, matrix }].slice(-KEPT_POSES));
      for (const topic of isNew ? this.topics.values() : []) {
        for (const one of topic.kept.values()) {
          if (one.matrix === null && one.message.header.frame_id.replace(/^\//, "") === name) {
            one.matrix = matrix;
            topic.sketch = null;
            this.change();
          }
        }
      }
    }
  }

  /** Forget what is older than wanted, and what is of a time before a reset. */
  takeTime() {
    const { live } = this.scene;
    if (live === null) {
      return;
    }
    const before = this.time;
    this.time = stampOf(live);
    for (const topic of this.topics.values()) {
      if (this.time < before - 0.01) {
        topic.clear();
        this.change();
      }
      for (const [key, { message, at }] of topic.kept) {
        const lifetime = message.lifetime ? (message.lifetime.secs ?? message.lifetime.sec ?? 0) + 1e-9 * (message.lifetime.nsecs ?? message.lifetime.nanosec ?? 0) : 0;
        const ends = [topic.keep, lifetime].filter((value) => value > 0).map((value) => at + value);
        if (ends.length > 0 && this.time > Math.min(...ends)) {
          topic.kept.delete(key);
          topic.sketch = null;
          this.change();
        }
      }
    }
  }

  /** Draw a topic that the simulator publishes. @param {string} name @param {string} type @returns {() => void} ends it */
  want(name, type) {
    const topic = this.topics.get(name) ?? this.add(name, type);
    this.switch(topic, true);
    return () => this.topics.get(name) === topic && this.switch(topic, false);
  }

  /** @param {string} name @param {string} type */
  add(name, type) {
    const topic = new DrawnTopic(name, type, TOPIC_COLOURS[this.topics.size % TOPIC_COLOURS.length] ?? "");
    this.topics.set(name, topic);
    this.change();
    return topic;
  }

  /** Texts of all topics, as drawn. */
  get texts() {
    return [...this.topics.values()].flatMap(({ sketch }) => sketch?.texts ?? []);
  }

  change() {
    this.version += 1;
    this.changes.tell();
  }

  /**
   * Return what all topics draw now; sketches are made here, so at most once for each picture.
   * @param {{x: number, y: number, z: number}} origin @returns {Sketch[]}
   */
  sketches(origin) {
    const sketches = [];
    for (const topic of this.topics.values()) {
      if (topic.kept.size > 0 && (topic.sketch === null || topic.sketch.origin !== origin)) {
        topic.sketch = this.draw(topic, origin);
      }
      if (topic.sketch !== null) {
        sketches.push(topic.sketch);
      }
    }
    return sketches;
  }

  /** @param {DrawnTopic} topic @param {{x: number, y: number, z: number}} origin */
  draw(topic, origin) {
    const value = Number.parseInt(topic.colour.slice(1), 16);
    const sketch = new Sketch(origin, packedColour((value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255, 1));
    const make = DRAWN_TYPES.get(topic.type);
    let isPlaced = true;
    for (const { message, matrix } of topic.kept.values()) {
      if (matrix === null) {
        isPlaced = false;
      } else {
        sketch.matrix = matrix;
        make?.(sketch, message);
      }
    }
    topic.note = !isPlaced ? "frame" : sketch.isCut ? "cut" : "";
    return sketch;
  }
}
