/** The latest collisions, over the map. */

import { contactName } from "../drawing/scene_labels.js";
import { stampOf } from "../scene/store.js";
import { closeButton, element, replaceChildren, setText } from "../widgets/dom.js";

/** @typedef {import("../scene/contacts.js").Contact} Contact */

/**
 * Make the list.
 * @param {{connection: import("../wire/connection.js").Connection, scene: import("../scene/store.js").SceneStore,
 *   texts: import("../layout.js").Texts}} context
 * @param {import("../scene/contacts.js").ContactList} contacts
 * @param {import("../drawing/map_view.js").MapView | null} view
 * @returns {HTMLElement}
 */
export function makeContactList({ connection, scene, texts }, contacts, view) {
  const title = element("h2", {});
  const list = element("ol", {});
  const node = element("section", { className: "contact-list", "aria-live": "polite", hidden: true }, title, list);
  const nameOf = (/** @type {Contact} */ contact, /** @type {number} */ i) => contactName(contact, i, texts.mapView);
  const show = () => {
    node.hidden = contacts.contacts.length === 0;
    setText(title, texts.contacts.title(contacts.total));
    replaceChildren(
      list,
      ...contacts.contacts.map((contact) => {
        const speed = (3.6 * contact.relative_speed).toFixed(1);
        const text = texts.contacts.line(contact.frame, nameOf(contact, 0), nameOf(contact, 1), speed);
        const button = element("button", { type: "button", title: texts.contacts.goThere, disabled: view === null }, text);
        button.onclick = () => view?.goTo(contact);
        return element("li", {}, button);
      }),
    );
    view?.change();
  };
  node.prepend(closeButton(texts.contacts.clear, () => {
    contacts.clear();
    show();
  }));
  connection.subscribe(
    "/sim/collisions",
    "rosbridge_sim_msgs/Contact",
    (message) => {
      contacts.add(message, performance.now());
      const [contact] = contacts.contacts;
      scene.timeline.mark("collision", `${nameOf(contact, 0)}, ${nameOf(contact, 1)}`, stampOf(message));
      show();
    },
    { encoding: "cbor", queueLength: 10 },
  );
  let place = "";
  connection.onState((state) => {
    if (state === "open") { // what another server told
      contacts.clear();
      show();
    }
  });
  scene.onLive(() => {
    const { frame = 0, scenario = "", map_digest: digest = "" } = scene.live ?? {};
    const isElsewhere = place !== "" && place !== `${digest} ${scenario}` && contacts.contacts.length > 0;
    place = `${digest} ${scenario}`;
    if (isElsewhere) {
      contacts.clear(); // they happened in another scenario
    }
    if (contacts.dropAfter(frame) || isElsewhere) {
      show();
    }
  });
  return node;
}
