// Cameras and lidars of the chosen ego: pictures with the boxes of what they show, and points on the map. The server reads
// a sensor only while somebody listens, so the page listens only while this is shown.

import { egoName } from "../wire/requests.js";
import { ActionButton, Notice } from "../widgets/action_button.js";
import { element, setText } from "../widgets/dom.js";
import { whileSeen } from "../widgets/seen.js";
import { ImageView } from "./graph/image_view.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */
/** @typedef {{kind: string, frame_id: string, topics: string[], settings: string}} SensorInfo */

/** Pictures at most so often [ms]; cameras that share a topic have no such bound. */
const PICTURE_THROTTLE = 100;

/** @param {PanelContext} context @returns {{element: HTMLElement, title: string}} */
export function makeSensorsPanel(context) {
  const { connection, drawn, ego, time } = context;
  const texts = context.texts.sensors;
  const notice = new Notice();
  const cards = element("div", { className: "sensor-cards" });
  let isOn = false;
  /** @type {(() => void)[]} */
  let ends = [];

  const stop = () => {
    ends.forEach((end) => end());
    ends = [];
    cards.replaceChildren();
  };
  const start = async () => {
    stop();
    notice.show("");
    if (!isOn || connection.state !== "open") {
      return;
    }
    const { number } = ego;
    const answer = await connection.call("/sim/sensors", { ego: number });
    if (!isOn || number !== ego.number || ends.length) {
      return; // another list is on its way, or there
    }
    const sensors = /** @type {SensorInfo[]} */ (answer.sensors ?? []);
    const cameras = sensors.filter(({ topics }) => topics.some((topic) => topic.endsWith("/camera_info")));
    const lidars = sensors.filter(({ kind }) => kind === "lidar3d");
    notice.show(answer.message || (cameras.length + lidars.length ? "" : texts.none));
    cameras.forEach((camera) => {
      const { card, end } = makeCard(context, camera, cameras, cards);
      cards.append(card);
      ends.push(end);
    });
    lidars.forEach((lidar) => {
      const topic = lidar.topics[0] ?? egoName(number, "/lidar3D");
      const state = element("p", { className: "hint" });
      const show = () => setText(state, drawn.topics.get(topic)?.kept.size ? texts.lidar(lidar.frame_id) : `${lidar.frame_id}: ${waitingText(context)}`);
      ends.push(drawn.want(topic, "sensor_msgs/PointCloud2"), time.changes.add(show));
      cards.append(state);
      show();
    });
    ends.push(() => {}); // there may be none, and this list is shown
  };
  const restart = () => void start().catch((error) => notice.showError(error));
  ego.onChoice(restart);
  connection.onState(restart);
  const toggle = new ActionButton({
    ...texts.start,
    notice,
    act: () => {
      isOn = !isOn;
      toggle.setFace(isOn ? texts.stop : texts.start);
      return start();
    },
  });
  const hint = element("p", { className: "hint" }, texts.hint);
  return { element: element("div", {}, hint, element("div", { className: "button-row" }, toggle.element), notice.element, cards), title: texts.title };
}

/** Text until the first picture arrives. @param {PanelContext} context */
function waitingText({ time, texts }) {
  return time.isStanding ? texts.time.nextStep : texts.sensors.drawing;
}

/**
 * @param {PanelContext} context @param {SensorInfo} camera @param {SensorInfo[]} cameras - of the ego, which may share a topic
 * @param {HTMLElement} place - of the card
 */
function makeCard(context, camera, cameras, place) {
  const { connection, time, texts } = context;
  const view = new ImageView({ ...texts.graph.image, label: camera.frame_id });
  const { picture, encoding, width, height } = JSON.parse(camera.settings);
  const canvas = element("canvas", { className: "sensor-boxes", width, height });
  const waiting = element("p", { className: "sensor-waiting" });
  const endWaiting = time.onChange(() => setText(waiting, waitingText(context)));
  const large = element("button", { type: "button", className: "small", "aria-pressed": "false", title: texts.sensors.largeHint }, texts.sensors.large);
  const caption = element("figcaption", { dataset: { live: texts.sensors.live } }, camera.frame_id);
  const card = element("figure", { className: "sensor-card" }, element("div", { className: "sensor-picture" }, waiting, view.element, canvas), element("div", { className: "strip-label" }, caption, large));
  card.style.setProperty("--aspect", String(width / height));
  large.onclick = () => {
    const isLarge = card.classList.toggle("is-large");
    large.setAttribute("aria-pressed", String(isLarge));
    (isLarge ? document.getElementById("map") : place)?.append(card);
  };
  const [topic, , boxesTopic] = camera.topics;
  const type = picture === "rgb" && encoding === "jpeg" ? "sensor_msgs/CompressedImage" : "sensor_msgs/Image";
  const throttleMs = cameras.some((other) => other !== camera && other.topics[0] === topic) ? 0 : PICTURE_THROTTLE;
  const options = /** @type {const} */ ({ throttleMs, queueLength: cameras.length, encoding: "cbor" });
  /** @param {{header: {frame_id: string}}} message */
  const isOwn = ({ header }) => header.frame_id.split("/").at(-1) === camera.frame_id;
  /** @param {any} message */
  const show = (message) => {
    waiting.hidden = true;
    view.show(type, message);
  };
  whileSeen(card, () => {
    const subscriptions = [
      connection.subscribe(topic, type, (message) => isOwn(message) && show(message), options),
      connection.subscribe(boxesTopic, "rosbridge_sim_msgs/BoundingBoxes", (message) => isOwn(message) && drawBoxes(canvas, message.boxes), { ...options, encoding: "json" }),
    ];
    return () => subscriptions.forEach((subscription) => subscription.close());
  });
  const end = () => {
    endWaiting();
    card.remove(); // it may be over the map
  };
  return { card, end };
}

/**
 * @param {HTMLCanvasElement} canvas - as large as the picture
 * @param {{unique_id: number, left: number, top: number, right: number, bottom: number}[]} boxes
 */
function drawBoxes(canvas, boxes) {
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.strokeStyle = pen.fillStyle = "#ffd400";
  pen.lineWidth = canvas.width / 320;
  pen.font = `${Math.round(canvas.width / 45)}px sans-serif`;
  for (const { unique_id: id, left, top, right, bottom } of boxes) {
    pen.strokeRect(left, top, right - left, bottom - top);
    pen.fillText(String(id), left, top - pen.lineWidth);
  }
  canvas.dataset.boxes = String(boxes.length);
}
