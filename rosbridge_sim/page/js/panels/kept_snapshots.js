// Snapshots that the page has the server keep while the user wants it: one every ten seconds of the last two minutes.

import { snapshotRequest, snapshotsRequest } from "../wire/requests.js";
import { Takers } from "../wire/takers.js";

/** @typedef {{id: string, frame: number, time: number}} KeptSnapshot time of the frame [s] */

/** Simulated time between two [s], and so many at most: those of the time that the timeline has. */
const SNAPSHOT_EVERY = 10;
const MOST_KEPT = 12;
/** A full town is saved in well under a second [ms]. */
const SNAPSHOT_TIMEOUT = 20_000;

export class KeptSnapshots {
  changes = new Takers();
  onChange = this.changes.addNow;
  isOn = false;
  isBusy = false;
  /** Why it has ended by itself. */
  problem = "";
  number = 0;
  /** @type {KeptSnapshot[]} the oldest first */
  kept = [];

  /** @param {import("../wire/connection.js").Connection} connection @param {import("../scene/store.js").SceneStore} scene @param {string} userId */
  constructor(connection, scene, userId) {
    this.connection = connection;
    this.scene = scene;
    this.userId = userId;
    scene.onLive(() => void this.look());
    window.addEventListener("pagehide", () => void this.switch(false));
    connection.onState((state) => {
      if (state === "open" && this.isOn) {
        this.kept = []; // another server, perhaps
      }
    });
  }

  /** Begin or end; at the end the server forgets them. @param {boolean} isOn */
  async switch(isOn) {
    if (isOn === this.isOn) {
      return;
    }
    this.isOn = isOn;
    this.problem = "";
    if (isOn) {
      await this.look();
    } else {
      const ids = Array.from({ length: Math.min(this.number, MOST_KEPT) }, (_, number) => this.idOf(number));
      this.number = 0;
      for (const id of ids) { // one by one: a service refuses all where one is not there
        await this.connection.call("/sim/snapshots", snapshotsRequest([id]).values).catch(() => undefined);
      }
      this.kept = [];
      this.changes.tell();
    }
  }

  /** @param {number} number */
  idOf(number) {
    return `${this.userId}-${number % MOST_KEPT}`;
  }

  /** Save the state if it is time for it. */
  async look() {
    const { timeline, live } = this.scene;
    const before = this.kept.length;
    this.kept = this.kept.filter(({ frame, time }) => live !== null && frame <= live.frame && time >= timeline.start - SNAPSHOT_EVERY);
    const last = this.kept.at(-1);
    if (this.isOn && !this.isBusy && live !== null && (last === undefined || timeline.end - last.time >= SNAPSHOT_EVERY)) {
      this.isBusy = true;
      try {
        const { name, values } = snapshotRequest(this.idOf(this.number));
        const { id, result, message, frame } = await this.connection.call(name, values, { timeoutMs: SNAPSHOT_TIMEOUT });
        if (!result) {
          throw new Error(message);
        }
        this.number += 1;
        this.kept = [...this.kept, { id, frame: Number(frame), time: timeline.end }].slice(-MOST_KEPT);
      } catch (error) {
        this.isOn = false;
        this.problem = error instanceof Error ? error.message : String(error);
      }
      this.isBusy = false;
      this.changes.tell();
    } else if (this.kept.length !== before) {
      this.changes.tell();
    }
  }

  /** The last one at a frame or before it, else the first one. @param {number} frame */
  nearest(frame) {
    return this.kept.filter((one) => one.frame <= frame).at(-1) ?? this.kept[0];
  }
}
