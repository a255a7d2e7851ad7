import assert from "node:assert/strict";
import { test } from "node:test";

import { linkTo, parseLink } from "../../../rosbridge_sim/page/js/panels/page_link.js";

const PANELS = ["ego", "time"];

test("a link has scenario, camera, object and panel", () => {
  const { link, problems } = parseLink("?scenario=rush_hour&camera=seat&follow=17&panel=time", PANELS);
  assert.deepEqual(link, { scenario: "rush_hour", camera: "seat", follow: { id: 17, isEgo: false }, panel: "time" });
  assert.deepEqual(problems, []);
  assert.deepEqual(parseLink("?follow=ego2", PANELS).link.follow, { id: 2, isEgo: true });
  assert.deepEqual(parseLink("?follow=ego", PANELS).link.follow, { id: 0, isEgo: true });
});

test("a value that is none is left out, and told with what is expected", () => {
  const { link, problems } = parseLink("?camera=drone&follow=-1&panel=<b>&scenario=a%00b&token=secret", PANELS);
  assert.deepEqual(link, { scenario: null, camera: null, follow: null, panel: null });
  assert.deepEqual(problems.map(({ name, expected }) => [name, expected !== ""]), [["camera", true], ["follow", true], ["panel", true], ["scenario", true], ["token", false]]); // prettier-ignore
  assert.ok(!JSON.stringify(problems).includes("secret"));
});

test("a link to a view is read again, and has nothing else of the page's address", () => {
  const link = /** @type {const} */ ({ scenario: "town & more", camera: "orbit", follow: { id: 2, isEgo: true }, panel: "ego" });
  const url = linkTo("https://ann:pw@host:9090/sim/?token=secret&x=1#token=secret", link);
  assert.ok(url.startsWith("https://host:9090/sim/?scenario=town"), url);
  assert.ok(!url.includes("secret") && !url.includes("pw"), url);
  assert.deepEqual(parseLink(new URL(linkTo("http://h/", { ...link, scenario: "my town" })).search, PANELS).link, { ...link, scenario: "my town" });
  assert.equal(linkTo("http://h/", { scenario: null, camera: null, follow: null, panel: null }), "http://h/");
});
