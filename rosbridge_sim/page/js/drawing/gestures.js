/** Gestures on the map: drag, wheel, two fingers, click. Points are in CSS pixels from the upper left of the element. */

/** @typedef {{x: number, y: number}} Point */
/**
 * @typedef {object} GestureTakers
 * @property {(dx: number, dy: number) => void} pan
 * @property {(x: number, y: number, factor: number) => void} zoom - above 1 is nearer
 * @property {(x: number, y: number, dx: number, dy: number) => void} turn - by dragging with the right button
 * @property {(x: number, y: number, angle: number) => void} twist - by two fingers, counter-clockwise [rad]
 * @property {(point: Point | null) => void} hover
 * @property {(point: Point) => void} tap
 * @property {(point: Point) => void} doubleTap
 * @property {(start: Point, now: Point, isDone: boolean) => boolean} draw - true: the drag belongs to a tool
 */

/** A pointer that moves less than this has clicked [pixels]. */
const TAP_REACH = 5;
/** The wheel zooms by this for each pixel that it would scroll: a notch of 100 pixels is a factor of 1.2. */
const WHEEL_ZOOM = 0.0018;
/** Pixels of a line and of a page, for wheels that count in them. */
const WHEEL_UNITS = [1, 33, 400];

/** Listen to gestures. @param {HTMLElement} target @param {GestureTakers} takers */
export function listenToGestures(target, takers) {
  /** @type {Map<number, {start: Point, now: Point, isTurning: boolean, isTap: boolean}>} */
  const pointers = new Map();
  const pointOf = (/** @type {MouseEvent} */ event) => {
    const { left, top } = target.getBoundingClientRect();
    return { x: event.clientX - left, y: event.clientY - top };
  };
  target.addEventListener("pointerdown", (event) => {
    target.setPointerCapture(event.pointerId);
    const start = pointOf(event);
    const isTurning = event.button === 2 || (event.button === 0 && (event.shiftKey || event.ctrlKey));
    pointers.set(event.pointerId, { start, now: start, isTurning, isTap: true });
    if (pointers.size > 1) {
      pointers.forEach((pointer) => (pointer.isTap = false));
    } else {
      takers.draw(start, start, false);
    }
  });
  target.addEventListener("pointermove", (event) => {
    const pointer = pointers.get(event.pointerId);
    const point = pointOf(event);
    if (event.pointerType !== "touch") {
      takers.hover(point);
    }
    if (pointer === undefined) {
      return;
    }
    const before = pointer.now;
    pointer.now = point;
    if (pointers.size === 2) {
      const other = [...pointers.values()].find((one) => one !== pointer);
      if (other) {
        pinch(takers, other.now, before, point);
      }
      return;
    }
    const isFar = Math.hypot(point.x - pointer.start.x, point.y - pointer.start.y) >= TAP_REACH;
    const wasTap = pointer.isTap;
    pointer.isTap = pointer.isTap && !isFar;
    if (pointer.isTap || takers.draw(pointer.start, point, false)) {
      return;
    }
    const from = wasTap ? pointer.start : before; // what the hand moved before it was a drag counts, too
    if (pointer.isTurning) {
      takers.turn(pointer.start.x, pointer.start.y, point.x - from.x, point.y - from.y);
    } else {
      takers.pan(point.x - from.x, point.y - from.y);
    }
  });
  const end = (/** @type {PointerEvent} */ event) => {
    const pointer = pointers.get(event.pointerId);
    pointers.delete(event.pointerId);
    if (pointer === undefined || event.type !== "pointerup" || pointers.size > 0) {
      return;
    }
    if (!takers.draw(pointer.start, pointer.now, true) && pointer.isTap && !pointer.isTurning) {
      takers.tap(pointer.now);
    }
  };
  target.addEventListener("pointerup", end);
  target.addEventListener("pointercancel", end);
  target.addEventListener("pointerleave", () => takers.hover(null));
  target.addEventListener("dblclick", (event) => takers.doubleTap(pointOf(event)));
  target.addEventListener("contextmenu", (event) => event.preventDefault());
  target.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault(); // the page does not scroll
      const { x, y } = pointOf(event);
      const pixels = event.deltaY * (WHEEL_UNITS[event.deltaMode] ?? 1);
      takers.zoom(x, y, Math.exp(-WHEEL_ZOOM * pixels * (event.ctrlKey ? 4 : 1))); // a touch pad's pinch has small steps
    },
    { passive: false },
  );
}

/** @param {GestureTakers} takers @param {Point} still - the other finger @param {Point} before @param {Point} now */
function pinch(takers, still, before, now) {
  const old = Math.hypot(before.x - still.x, before.y - still.y);
  const distance = Math.hypot(now.x - still.x, now.y - still.y);
  if (old > 0 && distance > 0) {
    takers.zoom(still.x, still.y, distance / old);
    const angle = Math.atan2(before.y - still.y, before.x - still.x) - Math.atan2(now.y - still.y, now.x - still.x);
    takers.twist(still.x, still.y, angle);
  }
}
