/** Functions that want to be told of something. */

/** Calls all that were added. @template {any[]} [Values=[]] */
export class Takers {
  /** @type {Set<{take: (...values: Values) => void}>} */
  all = new Set();

  /** Be told from now on. @param {(...values: Values) => void} take @returns {() => void} ends it */
  add = (take) => {
    const taker = { take };
    this.all.add(taker);
    return () => void this.all.delete(taker);
  };

  /** Be told from now on, and at once. @param {(...values: Values | []) => void} take @returns {() => void} ends it */
  addNow = (take) => {
    take();
    return this.add(take);
  };

  /** Tell all; one may end itself meanwhile. @param {Values} values */
  tell = (...values) => {
    for (const { take } of [...this.all]) {
      take(...values);
    }
  };
}
