// Links to a view: ?scenario=town&camera=chase&follow=ego&panel=time. A link is from anywhere, so each value is checked.

/** @typedef {import("../drawing/map_view.js").CameraName} CameraName */

/**
 * Request of a link; null: nothing is requested.
 * @typedef {{scenario: string | null, camera: CameraName | null, follow: {id: number, isEgo: boolean} | null, panel: string | null}} PageLink
 */

/** @type {CameraName[]} */
export const CAMERAS = ["top", "chase", "seat", "orbit"];
/** A name of a scenario: no longer than a file's name and its folder. */
const SCENARIO_NAME = /^[\p{L}\p{N} _./-]{1,200}$/u;

/**
 * @param {string} search of the page's address @param {readonly string[]} panels names of tabs
 * @returns {{link: PageLink, problems: {name: string, value: string, expected: string}[]}}
 */
export function parseLink(search, panels) {
  /** @type {PageLink} */
  const link = { scenario: null, camera: null, follow: null, panel: null };
  const problems = [];
  for (const [name, value] of new URLSearchParams(search)) {
    const follow = /^(?:ego(\d{0,6})|(\d{1,10}))$/.exec(value);
    const camera = CAMERAS.find((one) => one === value);
    if (name === "scenario" && SCENARIO_NAME.test(value)) {
      link.scenario = value;
    } else if (name === "camera" && camera) {
      link.camera = camera;
    } else if (name === "follow" && follow) {
      link.follow = follow[2] ? { id: Number(follow[2]), isEgo: false } : { id: Number(follow[1]), isEgo: true };
    } else if (name === "panel" && panels.includes(value)) {
      link.panel = value;
    } else {
      /** @type {Record<string, string>} */
      const expected = { scenario: "a name", camera: CAMERAS.join(", "), follow: "ego, ego2, 17", panel: panels.join(", ") };
      problems.push({ name: name.slice(0, 40), value: name === "token" ? "…" : value.slice(0, 40), expected: expected[name] ?? "" });
    }
  }
  return { link, problems };
}

/**
 * The address of a view. Whatever else the page's own address has, such as a token, is left out.
 * @param {string} href of the page @param {PageLink} link
 */
export function linkTo(href, { scenario, camera, follow, panel }) {
  const url = new URL(href);
  url.search = url.hash = url.username = url.password = "";
  const id = follow && (follow.isEgo ? `ego${follow.id || ""}` : String(follow.id));
  for (const [name, value] of Object.entries({ scenario, camera, follow: id, panel })) {
    if (value) {
      url.searchParams.set(name, value);
    }
  }
  return url.href;
}
