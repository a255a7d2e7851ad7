/**
 * The scene as the server tells it: the map, the state of all entities, and the entity that the user has chosen.
 */

/** @typedef {import("../wire/connection.js").Connection} Connection */

/**
 * Columns of `rosbridge_sim_msgs/SceneState`; entry i of each belongs to the same entity.
 * @typedef {{
 *   frame: number, map_digest: string, scenario: string, id: ArrayLike<number>, kind: ArrayLike<number>,
 *   x: ArrayLike<number>, y: ArrayLike<number>, z: ArrayLike<number>, heading: ArrayLike<number>,
 *   speed: ArrayLike<number>, lamps: ArrayLike<number>, flags: ArrayLike<number>,
 * }} SceneState
 */

/** @typedef {{id: number, number: number, x: number, y: number, z: number, heading: number, speed: number}} EgoRow */

/** States at most so often [ms]: as fast as an eye follows. */
const STATE_THROTTLE = 50;

/** Kind of an ego in the columns. */
const KIND_OF_EGO = 0;

export class SceneStore {
  /** @param {Connection} connection */
  constructor(connection) {
    this.connection = connection;
    /** @type {any} */
    this.map = null;
    /** @type {SceneState | null} */
    this.state = null;
    this.selectedId = -1;
    this.digest = "";
    /** @type {Set<() => void>} */
    this.stateTakers = new Set();
    /** @type {Set<() => void>} */
    this.mapTakers = new Set();
    /** @type {Set<() => void>} */
    this.selectTakers = new Set();
    const options = /** @type {const} */ ({ encoding: "cbor", throttleMs: STATE_THROTTLE, queueLength: 1 });
    connection.subscribe("/sim/scene/state", "rosbridge_sim_msgs/SceneState", (state) => this.takeState(state), options);
  }

  /** @param {SceneState} state */
  takeState(state) {
    this.state = state;
    if (state.map_digest !== this.digest) {
      this.digest = state.map_digest;
      void this.readMap();
    }
    if (this.selectedId >= 0 && this.indexOf(this.selectedId) < 0) {
      this.select(-1);
    }
    for (const take of this.stateTakers) {
      take();
    }
  }

  /** Read all pages of the map. */
  async readMap() {
    const { digest } = this;
    /** @type {any} */
    let map = null;
    try {
      for (let page = 0, pages = 1; page < pages; page += 1) {
        const answer = await this.connection.call("/sim/map", { page }, { timeoutMs: 60_000 });
        pages = answer.num_pages;
        if (map === null) {
          map = answer;
        } else {
          for (const list of ["lanes", "borders", "stop_lines", "crosswalks", "lights", "controllers"]) {
            map[list].push(...answer[list]);
          }
        }
      }
    } catch {
      this.digest = ""; // the next state asks again
      return;
    }
    if (digest === this.digest) {
      this.map = map;
      for (const take of this.mapTakers) {
        take();
      }
    }
  }

  /** @returns {EgoRow[]} */
  egos() {
    const { state } = this;
    /** @type {EgoRow[]} */
    const egos = [];
    for (let row = 0; state !== null && row < state.id.length; row += 1) {
      if (state.kind[row] === KIND_OF_EGO) {
        const [id, x, y, z, heading, speed] = [state.id, state.x, state.y, state.z, state.heading, state.speed].map((column) => Number(column[row]));
        egos.push({ id: Number(id), number: Number(id), x: Number(x), y: Number(y), z: Number(z), heading: Number(heading), speed: Number(speed) });
      }
    }
    return egos;
  }

  /**
   * Row of an entity, or -1.
   * @param {number} id
   */
  indexOf(id) {
    return this.state === null ? -1 : Array.prototype.indexOf.call(this.state.id, id);
  }

  /** @param {number} id -1 for none */
  select(id) {
    this.selectedId = id;
    for (const take of this.selectTakers) {
      take();
    }
  }

  /** @param {() => void} take */
  onSelect(take) {
    this.selectTakers.add(take);
    return () => void this.selectTakers.delete(take);
  }

  /** @param {() => void} take */
  onState(take) {
    this.stateTakers.add(take);
    return () => void this.stateTakers.delete(take);
  }

  /** @param {() => void} take */
  onMap(take) {
    this.mapTakers.add(take);
    return () => void this.mapTakers.delete(take);
  }
}
