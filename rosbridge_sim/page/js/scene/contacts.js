/** The latest collisions, for the list over the map and for the marks on it. */

/** @typedef {{frame: number, id: number[], kind: number[], name: string[], x: number, y: number, z: number,
 *   relative_speed: number}} ContactMessage */
/** @typedef {ContactMessage & {at: number}} Contact */

/** So many collisions are listed: more would hide the map. */
const LISTED = 5;
/** A collision is marked on the map for so long [ms]. */
export const CONTACT_SHOWN = 2500;

/** The latest collisions, the newest first. */
export class ContactList {
  /** @type {Contact[]} */
  contacts = [];
  /** All that came since the page was opened or the list was cleared. */
  total = 0;

  /** @param {ContactMessage} message @param {number} now - time of its arrival [ms] */
  add(message, now) {
    // Arrays of bytes come as base64 in JSON.
    const kind = typeof message.kind === "string" ? [...atob(message.kind)].map((byte) => byte.charCodeAt(0)) : [...message.kind];
    this.contacts = [{ ...message, kind, at: now }, ...this.contacts].slice(0, LISTED);
    this.total += 1;
  }

  /**
   * Forget what has not happened: contacts of later frames than the world is in, after a reset or a snapshot.
   * @param {number} frame - of the world @returns {boolean} there were such
   */
  dropAfter(frame) {
    const before = this.contacts.length;
    this.contacts = this.contacts.filter((contact) => contact.frame <= frame);
    return this.contacts.length !== before;
  }

  clear() {
    this.contacts = [];
    this.total = 0;
  }

  /**
   * @param {number} now - [ms] @param {number} [frame] - of the past that is shown
   * @returns {Contact[]} those that are marked on the map
   */
  fresh(now, frame) {
    return this.contacts.filter((contact) => (frame === undefined ? now < contact.at + CONTACT_SHOWN : contact.frame <= frame && frame < contact.frame + CONTACT_SHOWN / 20));
  }
}
