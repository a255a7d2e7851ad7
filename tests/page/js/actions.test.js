import assert from "node:assert/strict";
import { test } from "node:test";

import { Actions, refusalOf } from "../../../rosbridge_sim/page/js/panels/actions.js";
import { UndoList } from "../../../rosbridge_sim/page/js/panels/undo.js";
import { pauseRequest } from "../../../rosbridge_sim/page/js/wire/requests.js";

/**
 * Actions with a connection that answers what it is told.
 * @param {any} answer
 * @param {string} [warning] that comes before the answer
 */
function actionsWith(answer, warning = "") {
  /** @type {(status: {level: string, msg: string}) => void} */
  let tell = () => {};
  /** @type {any[]} */
  const published = [];
  const connection = {
    onStatus: (/** @type {typeof tell} */ take) => (tell = take),
    call: async () => {
      if (warning) {
        tell({ level: "warning", msg: warning });
      }
      if (answer instanceof Error) {
        throw answer;
      }
      return answer;
    },
    publish: (/** @type {any[]} */ ...all) => published.push(all),
  };
  return { actions: new Actions(/** @type {any} */ (connection), { refused: "refused" }), published };
}

test("a refusal in an answer is an error with its reason", async () => {
  const { actions } = actionsWith({ result: false, message: "no such object" });
  await assert.rejects(actions.run("Remove", pauseRequest(true)), /no such object/u);
  assert.deepEqual([actions.recent[0]?.outcome, actions.recent[0]?.reason], ["failed", "no such object"]);
});

test("the reason of a refusal without one is the status that came before it", async () => {
  const { actions } = actionsWith({ response: { result: false } }, "there is no scenario x");
  await assert.rejects(actions.run("Load", pauseRequest(true)), /there is no scenario x/u);
  const silent = actionsWith({ response: { tick_status: false } }).actions;
  await assert.rejects(silent.run("Tick", pauseRequest(true)), /refused/u);
});

test("a failed call is kept with its reason, and an answer without a result is no refusal", async () => {
  const { actions } = actionsWith(new Error("not allowed"));
  await assert.rejects(actions.call("Pause", "/s", "a/B", {}), /not allowed/u);
  assert.equal(actions.recent[0]?.reason, "not allowed");
  assert.equal(refusalOf({ frame: 0 }), null);
  assert.equal(refusalOf(null), null);
});

test("equal messages in a row are one action with a count", () => {
  const { actions, published } = actionsWith({});
  for (let index = 0; index < 100; index += 1) {
    actions.publish("Drive", "/ctrl_cmd", "morai_msgs/CtrlCmd", { accel: index });
  }
  assert.equal(published.length, 100);
  assert.equal(actions.recent.length, 1);
  assert.deepEqual([actions.recent[0]?.count, actions.recent[0]?.operation.values.accel], [100, 99]);
});

test("the list of actions has a bound, the latest first", async () => {
  const { actions } = actionsWith({});
  for (let index = 0; index < 70; index += 1) {
    await actions.run(String(index), pauseRequest(true));
  }
  assert.deepEqual([actions.recent.length, actions.recent[0]?.title], [50, "69"]);
});

test("changes are taken back from the latest on, also if one cannot be", async () => {
  const undo = new UndoList();
  /** @type {string[]} */
  const done = [];
  undo.add("a", () => void done.push("a"));
  undo.add("b", () => Promise.reject(new Error("gone")));
  await assert.rejects(undo.undo(), /gone/u);
  await undo.undo();
  await undo.undo();
  assert.deepEqual(done, ["a"]);
});
