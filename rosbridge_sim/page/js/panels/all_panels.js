// All panels, made and put under their tabs.

import { Actions } from "./actions.js";
import { makeCodePanel } from "./code.js";
import { makeDrawnPanel } from "./drawn.js";
import { Driving } from "./driving.js";
import { makeEgoPanel } from "./ego.js";
import { EgoWatch } from "./ego_watch.js";
import { makeGraphPanel } from "./graph/graph.js";
import { makeHeaderValues } from "./header.js";
import { makeLogPanel } from "./log.js";
import { makeObjectsPanel } from "./objects.js";
import { makeScorePanel } from "./score.js";
import { makeSensorsPanel } from "./sensors.js";
import { ServerFiles } from "./server_files.js";
import { makeTimePanel } from "./time.js";
import { makeStartCard } from "./start_card.js";
import { makeTimelineBar } from "./timeline_bar.js";
import { TimeControls } from "./time_controls.js";
import { TimeWatch } from "./time_watch.js";
import { makeViewMenu } from "./view_menu.js";

/** @typedef {import("./context.js").PanelContext} PanelContext */

/**
 * Complete the context of the panels.
 * @param {Pick<PanelContext, "connection" | "scene" | "drawn" | "drivers" | "mapView" | "showTab" | "texts">} base @returns {PanelContext}
 */
export function makePanelContext(base) {
  const { connection, scene, drivers, texts } = base;
  const actions = new Actions(connection, texts.actions);
  const time = new TimeWatch(connection, drivers, texts);
  const timeControls = new TimeControls(actions, time, texts.time.actions);
  return { ...base, actions, time, timeControls, ego: new EgoWatch(connection, scene), files: new ServerFiles(connection) };
}

/** @param {PanelContext} context @param {import("../layout.js").Layout} layout */
export function addPanels(context, layout) {
  const driving = new Driving(context);
  layout.header.append(makeHeaderValues(context, driving));
  layout.stage.append(makeStartCard(context, driving), makeTimelineBar(context, driving, makeViewMenu(context, layout)));
  layout.addPanel("ego", driving);
  layout.addPanel("ego", makeEgoPanel(context));
  layout.addPanel("ego", makeSensorsPanel(context));
  layout.addPanel("ego", makeScorePanel(context));
  layout.addPanel("time", makeTimePanel(context));
  layout.addPanel("objects", makeObjectsPanel(context));
  layout.addPanel("objects", makeDrawnPanel(context));
  layout.addPanel("graph", makeGraphPanel(context));
  layout.addPanel("log", makeLogPanel(context, layout));
  layout.addPanel("code", makeCodePanel(context));
}
