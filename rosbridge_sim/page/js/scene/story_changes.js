/** What has changed in a story from one message of `/sim/story` to the next. */

/** @typedef {{kind: string, name: string, state: string, executions: number, parent: number}} StoryElement */
/** @typedef {{name: string, kind: string, is_looked_at: boolean, holds: boolean, value: number}} StoryCondition */
/** @typedef {{result: string, group: string, time: number, reason: string}} StoryVerdict */
/**
 * @typedef {{name: string, time: number, is_over: boolean, verdict: StoryVerdict, elements: StoryElement[],
 *   conditions: StoryCondition[]}} StoryMessage
 */
/** @typedef {{what: "begins" | "ends" | "holds" | "verdict", name: string}} StoryChange */

/** A story that is first seen so soon after its start is seen from its start on [s]. */
const FROM_START = 1;
/** Elements whose changes are told. */
const TOLD = ["Act", "Event"];

/** @param {StoryMessage | null} before @param {StoryMessage} after - whether it is a later message of the same run of a story */
export function goesOn(before, after) {
  return (
    before !== null &&
    before.name === after.name &&
    before.time <= after.time &&
    before.elements.length === after.elements.length &&
    before.conditions.length === after.conditions.length
  );
}

/**
 * Return what has changed: acts and events that began or ended, conditions that began to hold, and the verdict.
 * @param {StoryMessage | null} before - null for none @param {StoryMessage} after @returns {StoryChange[]}
 */
export function storyChanges(before, after) {
  const old = goesOn(before, after) ? before : null;
  if (old === null && after.time > FROM_START) {
    return []; // nothing tells what has changed since then
  }
  /** @type {StoryChange[]} */
  const changes = [];
  after.elements.forEach(({ kind, name, state, executions }, i) => {
    const begins = executions > (old?.elements[i].executions ?? 0);
    const wasRunning = old?.elements[i].state === "running";
    if (TOLD.includes(kind)) {
      changes.push(...(begins ? [{ what: /** @type {const} */ ("begins"), name }] : []));
      changes.push(...(state !== "running" && (wasRunning || begins) ? [{ what: /** @type {const} */ ("ends"), name }] : []));
    }
  });
  after.conditions.forEach(({ name, holds }, i) => {
    if (holds && !old?.conditions[i].holds) {
      changes.push({ what: "holds", name });
    }
  });
  const { result } = after.verdict;
  if (["success", "failure"].includes(result) && old?.verdict.result !== result) {
    changes.push({ what: "verdict", name: result });
  }
  return changes;
}
