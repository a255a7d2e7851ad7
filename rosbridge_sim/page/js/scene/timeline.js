/** The last two minutes of the drive: states as they came, and what happened, bounded in time and in bytes. */

/** @typedef {import("./scene_view.js").SceneView} SceneView */
/** @typedef {{time: number, frame: number, view: SceneView, bytes: number}} Moment time of the frame [s] */
/** @typedef {"collision" | "red" | "lane" | "refusal" | "story"} MarkKind */
/** @typedef {{time: number, kind: MarkKind, text: string}} Mark */

/** So much is kept [s], [bytes]; a crowd of a thousand fills 15 MB in this time. */
export const TIMELINE_SPAN = 120;
export const TIMELINE_BYTES = 32e6;
/** Marks that are kept; more would hide one another. */
const MOST_MARKS = 60;
/** Bytes of a state beside its columns, about. */
const STATE_BYTES = 1000;

export class Timeline {
  /** @type {Moment[]} the oldest first */
  moments = [];
  /** @type {Mark[]} the oldest first */
  marks = [];
  bytes = 0;
  /** The oldest moments were dropped because of their bytes. */
  isFull = false;

  /** Time of the last moment [s]. */
  get end() {
    return this.moments.at(-1)?.time ?? 0;
  }

  /** Time of the first moment [s]. */
  get start() {
    return this.moments[0]?.time ?? 0;
  }

  /** Add a state; what is of another scene, or later than it, has not happened. @param {SceneView} view @param {number} time - [s] */
  add(view, time) {
    const last = this.moments.at(-1)?.view;
    if (last && (last.map_digest !== view.map_digest || last.scenario !== view.scenario)) {
      this.clear();
    } else if (last && last.frame >= view.frame) {
      this.dropFrom(view.frame, time);
    }
    let bytes = STATE_BYTES;
    for (const column of Object.values(view)) {
      bytes += ArrayBuffer.isView(column) ? column.byteLength : 0;
    }
    this.moments.push({ time, frame: view.frame, view, bytes });
    this.bytes += bytes;
    let num = 0;
    for (let left = this.bytes; num < this.moments.length - 1; num += 1) {
      const isOld = this.moments[num].time < time - TIMELINE_SPAN;
      if (!isOld && left <= TIMELINE_BYTES) {
        break;
      }
      this.isFull = !isOld;
      left -= this.moments[num].bytes;
    }
    this.remove(0, num);
    while (this.marks.length > MOST_MARKS || (this.marks.length > 0 && this.marks[0].time < this.start)) {
      this.marks.shift();
    }
  }

  /** @param {number} from @param {number} num */
  remove(from, num) {
    for (const { bytes } of num > 0 ? this.moments.splice(from, num) : []) {
      this.bytes -= bytes;
    }
  }

  /** @param {number} frame - first one that has not happened @param {number} time - of it [s] */
  dropFrom(frame, time) {
    const from = this.moments.findIndex((moment) => moment.frame >= frame);
    this.remove(from < 0 ? this.moments.length : from, this.moments.length);
    this.marks = this.marks.filter((mark) => mark.time < time);
  }

  clear() {
    this.moments = [];
    this.marks = [];
    this.bytes = 0;
    this.isFull = false;
  }

  /** @param {MarkKind} kind @param {string} text @param {number} [time] - [s]; now, if it is left out */
  mark(kind, text, time = this.end) {
    this.marks.push({ kind, text, time });
    this.marks.sort((a, b) => a.time - b.time);
  }

  /** The last moment at a time or before it, or the first one. @param {number} time - [s] @returns {Moment | undefined} */
  at(time) {
    let low = 0;
    let high = this.moments.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.moments[middle].time <= time + 1e-6) {
        low = middle;
      } else {
        high = middle;
      }
    }
    return this.moments[low];
  }
}

/**
 * Return the kind of an ego's move from one lane to another.
 * @param {{link: string, successors: string[], left_link: string, right_link: string}} before
 * @param {{link: string, light: string}} after @param {boolean} isRed - the light of the lane behind the change is red
 * @returns {MarkKind | null} null: it goes on along its road
 */
export function kindOfWay(before, after, isRed) {
  if (before.successors.includes(after.link)) {
    return isRed && after.light !== "" ? "red" : null;
  }
  return [before.left_link, before.right_link].includes(after.link) ? "lane" : null;
}
