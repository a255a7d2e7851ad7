/** The scene as the server tells it: the map, the last state of all entities, and the selected one. */

import { loadMap } from "./map_loader.js";
import { stateOfView } from "./scene_view.js";
import { loadMesh } from "./mesh_loader.js";
import { Timeline } from "./timeline.js";
import { Takers } from "../wire/takers.js";

/** @typedef {import("../wire/connection.js").Connection} Connection */
/** @typedef {import("./map_types.js").SceneMap} SceneMap */

/**
 * The message SceneState: entry i of each column belongs to the same entity. Its definition has the units.
 * @typedef {{header: {stamp: {secs?: number, nsecs?: number, sec?: number, nanosec?: number}}, frame: number,
 *   map_digest: string, scenario: string, id: Uint32Array, kind: Uint8Array, x: Float64Array, y: Float64Array,
 *   z: Float32Array, roll: Float32Array, pitch: Float32Array, heading: Float32Array, speed: Float32Array,
 *   length: Float32Array, width: Float32Array, height: Float32Array, center_x: Float32Array, shape: Uint8Array, paint: Uint32Array, lamps: Uint8Array,
 *   flags: Uint8Array, light_state: Int16Array, light_time_left: Float32Array}} SceneState
 */

/** @typedef {{id: number, number: number, x: number, y: number, z: number, heading: number, speed: number, row: number}} SceneEgo */

/** Values of `kind`. */
export const KINDS = /** @type {const} */ (["ego", "vehicle", "pedestrian", "obstacle"]);

/**
 * Shortest time between two states [ms]: the page draws steps between them, so seven a second look smooth; with very many
 * entities, of which each is small on the screen, five do.
 */
const STATE_THROTTLE = 150;
const CROWD_THROTTLE = 200;
const CROWD = 400;
/** Wait before the page asks again for a map that did not come [ms]. */
const MAP_RETRY = 3000;
/** The same for the mesh, which a server may not offer [ms]. */
const MESH_RETRY = 60_000;

/** The scene. */
export class SceneStore {
  states = new Takers();
  maps = new Takers();
  selections = new Takers();
  lives = new Takers();
  /** Be told of each state that is shown: the last one, or one of the past. */
  onState = this.states.add;
  /** Be told of each state of the server, also while the past is shown. */
  onLive = this.lives.add;
  onSelect = this.selections.add;
  /** @type {SceneMap | null} */
  map = null;
  /** The state that is shown. @type {SceneState | null} */
  state = null;
  /** The last state of the server. @type {SceneState | null} */
  live = null;
  timeline = new Timeline();
  /** The moment that is shown in place of the last one. @type {import("./timeline.js").Moment | null} */
  past = null;
  /** Number of the selected entity; null without one. @type {number | null} */
  selectedId = null;
  /** The selected entity is an ego; an ego and an object may have the same number. */
  isEgoSelected = false;

  /** @param {Connection} connection */
  constructor(connection) {
    this.connection = connection;
    this.isLoading = false;
    /** Digest of the map whose mesh was asked for. */
    this.meshDigest = "";
    connection.onState((state) => state === "open" && this.takeState(null));
    this.throttle = STATE_THROTTLE;
    this.subscription = this.subscribe();
  }

  subscribe() {
    const options = /** @type {const} */ ({ encoding: "cbor", throttleMs: this.throttle });
    return this.connection.subscribe("/sim/scene/view", "rosbridge_sim_msgs/SceneView", (view) => this.takeView(view), options);
  }

  /** @param {import("./scene_view.js").SceneView} view */
  takeView(view) {
    const throttle = view.id.length > CROWD ? CROWD_THROTTLE : STATE_THROTTLE;
    if (throttle !== this.throttle) {
      this.throttle = throttle;
      const old = this.subscription;
      this.subscription = this.subscribe();
      old.close();
    }
    this.timeline.add(view, stampOf(view));
    this.takeState(stateOfView(view));
  }

  /** Return the egos of a state. @param {SceneState | null} [state] - left out: the one that is shown @returns {SceneEgo[]} */
  egos(state = this.state) {
    /** @type {SceneEgo[]} */
    const egos = [];
    for (let row = 0; state !== null && row < state.kind.length; row += 1) {
      if (state.kind[row] === 0) {
        const { x, y, z, heading, speed } = state;
        const number = state.id[row];
        egos.push({ id: number, number, x: x[row], y: y[row], z: z[row], heading: heading[row], speed: speed[row], row });
      }
    }
    return egos;
  }

  /**
   * Return the row of an entity; with a number of an ego and of an object, the ego's.
   * @param {number | null} id @param {boolean} [isEgo] - only an ego, or only another entity @returns {number} -1: there is none
   */
  indexOf(id, isEgo) {
    const { state } = this;
    if (state === null || id === null || id < 0) {
      return -1;
    }
    let found = -1;
    for (let row = state.id.indexOf(id); row >= 0; row = state.id.indexOf(id, row + 1)) {
      const isThisEgo = state.kind[row] === 0;
      if (isThisEgo === (isEgo ?? true)) {
        return row;
      }
      found = isEgo === undefined ? row : found;
    }
    return found;
  }

  /** @returns {number} row of the selected entity; -1: there is none */
  selectedRow() {
    return this.indexOf(this.selectedId, this.selectedId === null ? undefined : this.isEgoSelected);
  }

  /** Select an entity. @param {number | null} id - null selects nothing @param {boolean} [isEgo] */
  select(id, isEgo) {
    const row = this.indexOf(id, isEgo);
    const isNowEgo = row >= 0 && this.state?.kind[row] === 0;
    const chosen = row >= 0 ? id : null;
    if (chosen !== this.selectedId || isNowEgo !== this.isEgoSelected) {
      this.selectedId = chosen;
      this.isEgoSelected = isNowEgo;
      this.selections.tell();
    }
  }

  /** @param {number} step - 1 for the next entity, -1 for the one before */
  selectNext(step) {
    const { state } = this;
    const num = state?.id.length ?? 0;
    if (state !== null && num > 0) {
      const row = this.selectedRow();
      const next = row < 0 ? (step > 0 ? 0 : num - 1) : (row + step + num) % num;
      this.select(state.id[next], state.kind[next] === 0);
    }
  }

  /** Be told of each map; at once if one is there. @param {() => void} take @returns {() => void} ends it */
  onMap(take) {
    return this.map === null ? this.maps.add(take) : this.maps.addNow(take);
  }

  /** @param {SceneState | null} state - null: this connection has told none yet */
  takeState(state) {
    const { past, timeline } = this;
    const isGone = past !== null && (past.view.scenario !== state?.scenario || (past.time > timeline.start && !timeline.moments.includes(past)));
    if (state === null) {
      timeline.clear();
    }
    this.live = state;
    if (past === null || isGone) {
      this.past = null;
      this.show(state);
    }
    this.lives.tell();
  }

  /** Show the last moment at a time, or what is live. @param {number | null} time - [s]; null: live */
  showPast(time) {
    const moment = time === null ? undefined : this.timeline.at(time);
    if (moment !== undefined) {
      this.past = moment;
      this.show(stateOfView(moment.view));
    } else if (this.past !== null) {
      this.past = null;
      this.show(this.live);
    }
  }

  /** @param {SceneState | null} state */
  show(state) {
    this.state = state;
    if (this.selectedId !== null && this.selectedRow() < 0) {
      this.select(null);
    }
    if (state !== null && this.map?.digest !== state.map_digest) {
      void this.loadMap();
    }
    this.states.tell();
  }

  /**
   * Load what stands still of the map, once for each map; without it the flat map is drawn.
   * @param {(parts: import("./mesh_loader.js").MeshPart[]) => void} take
   */
  async wantMesh(take) {
    const digest = this.map?.digest ?? "";
    if (digest === this.meshDigest) {
      return;
    }
    this.meshDigest = digest;
    try {
      const parts = await loadMesh(this.connection, digest);
      if (this.map?.digest === digest) {
        take(parts);
      }
    } catch {
      setTimeout(() => void (this.meshDigest = ""), MESH_RETRY); // the reason is in the log
    }
  }

  /** Load the map of the last state; where that fails, again after a while, because a world that stands sends no state. */
  async loadMap() {
    if (this.isLoading) {
      return;
    }
    this.isLoading = true;
    while (this.state !== null && this.map?.digest !== this.state.map_digest) {
      try {
        const map = await loadMap(this.connection);
        if (map.digest !== this.map?.digest) {
          this.map = map;
          this.maps.tell();
        }
      } catch {
        // the reason is in the server's log, and the next attempt may succeed
      }
      if (this.state !== null && this.map?.digest !== this.state.map_digest) {
        await new Promise((resolve) => setTimeout(resolve, MAP_RETRY));
      }
    }
    this.isLoading = false;
  }
}

/** The time of a message, in either form of ROS [s]. @param {{header: {stamp: any}}} message */
export function stampOf({ header: { stamp } }) {
  return (stamp.secs ?? stamp.sec ?? 0) + 1e-9 * (stamp.nsecs ?? stamp.nanosec ?? 0);
}
