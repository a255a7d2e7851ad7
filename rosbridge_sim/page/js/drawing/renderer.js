/** The renderer: everything of the scene, from a camera, by WebGL 2. */

import { makeMapGeometry } from "../scene/map_geometry.js";
import { lightMaterial, makeLightBars } from "../scene/light_bars.js";
import { LineBuffer } from "../scene/line_buffer.js";
import { MATERIALS } from "../scene/materials.js";
import { stampOf } from "../scene/store.js";
import { FAR_FORM, FAR_ROOF, FORMS, lampHeight, makeBody } from "./bodies.js";
import { fillEntities } from "./entity_filler.js";
import { EntityLayer, LineLayer, ScreenLayer, SurfaceLayer } from "./gl_layers.js";
import { GlProgram } from "./gl_program.js";
import { MESH_SHADERS, MeshLayer } from "./mesh_layer.js";
import { HEAD_SHADERS, PointLayer } from "./point_layer.js";
import { PlanLayer } from "./plan_layer.js";
import { ENTITY_SHADERS, FAR_SHADERS, GROUND_SHADERS, LINE_SHADERS, SHADOW_SHADERS, SKY_SHADERS, SURFACE_SHADERS } from "./shaders.js";

/** @typedef {import("./top_camera.js").TopCamera} TopCamera */
/** @typedef {import("./chase_camera.js").ChaseCamera} ChaseCamera */

/**
 * Contents of one picture.
 * @typedef {{camera: TopCamera | ChaseCamera, palette: import("./palette.js").Palette,
 *   state: import("../scene/store.js").SceneState | null, poses: import("./picking.js").Poses,
 *   drawn: import("../scene/drawn_topics.js").DrawnTopics | null, hidden: number}} Picture
 *   hidden: row that the camera is in; drawn: null in the past, of which the page keeps no plans
 */

/** Arrows are drawn from this scale on, and lanes as lines below that one [pixels/m]. */
const ARROW_SCALE = 2.5;
const SPINE_SCALE = 1;
/** Light on the scene's mesh in dark colours, as a share of that at noon. */
const NIGHT_LIGHT = 0.35;
/** Fog behind the car: half of the colour is gone at about 500 m [1/m]. */
const FOG_DENSITY = 1 / 500;
/** Least size of lights of the map for vehicles and for people [pixels]. */
const CAR_LIGHT_PIXELS = 7;
const WALK_LIGHT_PIXELS = 4.5;
/** Lights are drawn from these scales on; those for people would hide a small crossing [pixels/m]. */
const CAR_LIGHT_SCALE = 0.9;
const WALK_LIGHT_SCALE = 3;
/** Phases of indicators a second of simulated time: a real one blinks about 1.5 times a second. */
const BLINKS = 3;

/** Draws the scene. */
export class Renderer {
  /** @param {WebGL2RenderingContext} gl @throws {Error} the shaders do not compile */
  constructor(gl) {
    this.gl = gl;
    this.programs = {
      surface: new GlProgram(gl, SURFACE_SHADERS),
      mesh: new GlProgram(gl, MESH_SHADERS),
      line: new GlProgram(gl, LINE_SHADERS),
      entity: new GlProgram(gl, ENTITY_SHADERS),
      shadow: new GlProgram(gl, SHADOW_SHADERS),
      head: new GlProgram(gl, HEAD_SHADERS),
      far: new GlProgram(gl, FAR_SHADERS),
      sky: new GlProgram(gl, SKY_SHADERS),
      ground: new GlProgram(gl, GROUND_SHADERS),
    };
    /** Entities by their form. */
    this.entities = FORMS.map((name, shape) => new EntityLayer(gl, makeBody(name), lampHeight(shape)));
    /** The static scene, for the camera behind the car; null until it is loaded. @type {MeshLayer | null} */
    this.mesh = null;
    this.heads = new PointLayer(gl, 3);
    this.screen = new ScreenLayer(gl);
    this.bars = new LineLayer(gl);
    /** Trails and other lines that change. */
    this.drawn = new LineLayer(gl);
    /** Drawings of topics of programs. */
    this.plans = new PlanLayer(gl);
    /** @type {{geometry: import("../scene/map_geometry.js").MapGeometry, lanes: SurfaceLayer, stripes: SurfaceLayer,
        arrows: SurfaceLayer, lines: LineLayer, spines: LineLayer} | null} */
    this.mapLayers = null;
    this.origin = { x: 0, y: 0, z: 0 };
    /** @type {import("../scene/map_types.js").MapLight[]} */
    this.lights = [];
    /** @type {import("../scene/light_bars.js").LightBar[]} */
    this.lightBars = [];
    /** @type {ArrayLike<number> | null} */
    this.shownStates = null;
    this.shownLights = "";
    /** @type {number[]} */
    this.lightMaterials = [];
    this.headKey = "";
    gl.frontFace(gl.CCW);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }

  /** Take a map; its buffers are made now, and once. @param {import("../scene/map_types.js").SceneMap} map */
  setMap(map) {
    const { gl } = this;
    if (this.mapLayers !== null) {
      const { lanes, stripes, arrows, lines, spines } = this.mapLayers;
      [lanes, stripes, arrows, lines, spines].forEach((layer) => layer.delete());
    }
    const geometry = makeMapGeometry(map);
    this.mapLayers = {
      geometry,
      lanes: new SurfaceLayer(gl, geometry.lanes),
      stripes: new SurfaceLayer(gl, geometry.stripes),
      arrows: new SurfaceLayer(gl, geometry.arrows),
      lines: new LineLayer(gl, geometry.lines),
      spines: new LineLayer(gl, geometry.spines),
    };
    this.origin = geometry.origin;
    this.lights = map.lights;
    this.lightBars = makeLightBars(map, geometry.origin);
    this.shownLights = "";
    this.setMesh(null);
  }

  /** @param {import("../scene/mesh_loader.js").MeshPart[] | null} parts - of the map; null: they are not loaded */
  setMesh(parts) {
    this.mesh?.delete();
    this.mesh = parts && new MeshLayer(this.gl, parts);
  }

  /** Set the lines that change: trails, marks, a measured distance. Places are relative to `origin`. @param {LineBuffer} lines */
  setLines(lines) {
    this.drawn.fill(lines.view());
  }

  /** Draw a picture. @param {Picture} picture */
  draw(picture) {
    const { gl } = this;
    const { camera, palette } = picture;
    this.showLights(picture.state?.light_state ?? null);
    for (const layer of this.entities) {
      layer.clear();
    }
    const scale = camera.isPerspective ? Infinity : 1 / camera.pixelSize;
    const { single } = palette;
    const lift = camera.isPerspective ? 2e-4 : 0;
    const common = { view: camera.matrix(this.origin), pixel: camera.pixelSize, lift };
    fillEntities(this.entities, picture.state, picture.poses, this.origin, common.view, common.pixel, picture.hidden);
    const fog = { fog: [...single.horizon, camera.isPerspective ? FOG_DENSITY : 0] };
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.depthMask(true);
    gl.clearColor(single.paper[0], single.paper[1], single.paper[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    // Solid bodies come first, so that nothing hidden by them is drawn.
    gl.disable(gl.BLEND);
    const flat = { ...common, ...fog, palette: palette.materials, opacity: 1 };
    const bodies = { ...common, ...fog, enlarge: camera.isPerspective ? 0 : 1 };
    const mesh = camera.isPerspective ? this.mesh : null;
    if (mesh !== null) {
      this.programs.mesh.use();
      this.programs.mesh.set({ ...common, ...fog, light: palette.isDark ? NIGHT_LIGHT : 1 });
      mesh.draw(this.programs.mesh, this.origin, common.view);
    } else if (this.mapLayers !== null) {
      this.programs.surface.use();
      this.programs.surface.set({ ...flat, layer: 1 });
      this.mapLayers.lanes.draw();
    }
    this.drawEntities(bodies, picture);
    gl.depthMask(false);
    if (camera.isPerspective) {
      this.drawBackground(/** @type {ChaseCamera} */ (camera), single);
    }
    gl.enable(gl.BLEND);
    this.drawMarks(scale, flat, mesh === null);
    this.programs.shadow.use();
    this.programs.shadow.set({ ...bodies, layer: 6 });
    this.entities.forEach((layer, shape) => shape !== FAR_FORM && layer.drawShadows());
    const spin = camera.isPerspective ? 100 : /** @type {TopCamera} */ (camera).rotation;
    const ratio = gl.drawingBufferWidth / camera.width;
    if (picture.drawn !== null) {
      this.plans.fill(picture.drawn, this.origin);
      this.plans.draw(this.programs.line, { ...flat, ratio });
    }
    this.programs.head.use();
    this.programs.head.set({ ...common, ...fog, palette: palette.materials, spin, ratio });
    this.fillHeads(scale);
    this.heads.draw();
    gl.bindVertexArray(null);
  }

  /**
   * Draw what is painted on the road, and lines that change.
   * @param {number} scale - [pixels/m] @param {Record<string, any>} uniforms @param {boolean} hasPaint - else the mesh has it
   */
  drawMarks(scale, uniforms, hasPaint) {
    const { programs, mapLayers } = this;
    if (mapLayers !== null && hasPaint) {
      programs.surface.use();
      if (scale > 0.5) {
        programs.surface.set({ ...uniforms, layer: 2 });
        mapLayers.stripes.draw();
      }
      if (scale > ARROW_SCALE) {
        programs.surface.set({ ...uniforms, layer: 2, opacity: 0.7 });
        mapLayers.arrows.draw();
      }
    }
    programs.line.use();
    programs.line.set({ ...uniforms, layer: 3 });
    if (mapLayers !== null) {
      if (hasPaint) {
        (scale < SPINE_SCALE ? mapLayers.spines : mapLayers.lines).draw();
      }
      if (scale > 0.5) {
        programs.line.set({ layer: 4 });
        this.bars.draw();
      }
    }
    programs.line.set({ layer: 5, opacity: 0.85 });
    this.drawn.draw();
  }

  /** @param {Record<string, any>} uniforms @param {Picture} picture */
  drawEntities(uniforms, { palette, state }) {
    const { gl, programs } = this;
    this.entities.forEach((layer) => layer.upload());
    programs.entity.use();
    const blink = state === null ? 0 : Math.floor(stampOf(state) * BLINKS) % 2;
    const looks = { ...uniforms, kinds: palette.kinds, contact: palette.single.contact };
    programs.entity.set({ ...looks, blink, isMarked: uniforms.enlarge });
    for (const layer of this.entities.slice(0, FAR_FORM)) {
      programs.entity.set({ lampHeight: layer.lampHeight });
      layer.draw(0);
    }
    gl.enable(gl.CULL_FACE); // it is closed
    programs.far.use();
    programs.far.set(looks);
    this.entities[FAR_FORM].draw(uniforms.enlarge ? FAR_ROOF : 0);
    gl.disable(gl.CULL_FACE);
  }

  /** @param {ChaseCamera} camera @param {import("./palette.js").Palette["single"]} colours */
  drawBackground(camera, { zenith, horizon, ground, grid }) {
    const { programs } = this;
    const [x, y, z] = camera.eye();
    const forward = camera.forward();
    const across = Math.hypot(forward[0], forward[1]);
    const right = [forward[1] / across, -forward[0] / across, 0];
    const up = [right[1] * forward[2], -right[0] * forward[2], right[0] * forward[1] - right[1] * forward[0]];
    const [wide, high] = [0.5 * camera.width * camera.pixelSize, 0.5 * camera.height * camera.pixelSize];
    const skyline = -forward[2] / (up[2] * high);
    const { gl } = this;
    const [pixelsWide, pixelsHigh] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const row = Math.round(Math.min(1, Math.max(0, 0.5 * (skyline + 1))) * pixelsHigh);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, row, pixelsWide, pixelsHigh - row);
    programs.sky.use();
    programs.sky.set({ zenith, haze: horizon, skyline });
    this.screen.draw();
    gl.scissor(0, 0, pixelsWide, row);
    programs.ground.use();
    programs.ground.set({
      eye: [x % 1000, y % 1000, Math.max(z - camera.target.z, 0.1)],
      forward,
      right: right.map((part) => part * wide),
      up: up.map((part) => part * high),
      haze: horizon,
      ground,
      grid,
      density: FOG_DENSITY,
    });
    this.screen.draw();
    gl.disable(gl.SCISSOR_TEST);
  }

  /** Colour the bars of the lights, if a light has changed. @param {ArrayLike<number> | null} states */
  showLights(states) {
    if (states === this.shownStates && this.shownLights !== "") {
      return; // no new state
    }
    this.shownStates = states;
    const materials = this.lights.map((_, row) => lightMaterial(states?.[row] ?? 0));
    const shown = `lights ${materials.join(" ")}`;
    if (shown === this.shownLights) {
      return;
    }
    this.shownLights = shown;
    this.lightMaterials = materials;
    this.headKey = "";
    const lines = new LineBuffer();
    for (const bar of this.lightBars) {
      const style = { width: bar.width, minPixels: 2.5, material: materials[bar.light] };
      lines.add(bar.x0, bar.y0, bar.z0, bar.x1, bar.y1, bar.z1, style);
    }
    this.bars.fill(lines.view());
  }

  /** Fill the buffer of the lights that are drawn at a scale, if others were drawn before. @param {number} scale - [pixels/m] */
  fillHeads(scale) {
    const key = `${scale > CAR_LIGHT_SCALE} ${scale > WALK_LIGHT_SCALE}`;
    if (key === this.headKey) {
      return;
    }
    this.headKey = key;
    /** @type {number[]} */
    const values = [];
    this.lights.forEach((light, row) => {
      if (scale > (light.is_pedestrian ? WALK_LIGHT_SCALE : CAR_LIGHT_SCALE)) {
        const least = light.is_pedestrian ? WALK_LIGHT_PIXELS : CAR_LIGHT_PIXELS;
        const material = this.lightMaterials[row] ?? MATERIALS.lightDark;
        const { x, y, z } = this.origin;
        values.push(light.x - x, light.y - y, light.z - z, material, (light.heading_deg * Math.PI) / 180, least);
      }
    });
    this.heads.fill(new Float32Array(values));
  }
}
