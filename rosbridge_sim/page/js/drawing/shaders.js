/**
 * The programs of the graphics card. `view` takes places relative to the map's origin to the clip space; `pixel` times the
 * fourth clip coordinate is a pixel's size on the ground [m].
 */

import { NUM_MATERIALS } from "../scene/materials.js";

export const HEAD = `#version 300 es
precision highp float;
`;

/** Distance fades into the colour of the horizon; a density of 0 is none, for the camera above the map. */
export const FOG = `
uniform vec4 fog; // colour, and density [1/m]
vec3 fade(vec3 colour) {
  if (fog.w == 0.0) return colour;
  float far = fog.w / gl_FragCoord.w;
  return mix(fog.rgb, colour, 1.0 / (1.0 + far * far));
}
`;

/**
 * Flat things lie in one plane; a small shift for each layer keeps their order. Near a camera in perspective, `lift` makes
 * it larger than the error of 24 bits for places far from the map's origin; it is below 2 mm there.
 */
export const LAYER = `
uniform float layer, lift;
vec4 lifted(vec4 place) {
  place.z -= layer * (4e-6 * place.w + lift);
  return place;
}
`;

/** Colour of a number: an index of the palette, or below 0 a colour of its own, see `packedColour`. */
export const COLOUR = `
uniform vec3 palette[${NUM_MATERIALS}];
vec4 colourOf(float number) {
  if (number >= 0.0) return vec4(palette[int(number)], 1.0);
  int bits = int(-1.0 - number);
  return vec4(vec3(bits >> 17, (bits >> 11) & 63, (bits >> 5) & 63) / 63.0, float(bits & 31) / 31.0);
}
`;

/** Surface of the road, stripes and arrows. */
export const SURFACE_SHADERS = {
  vertex: `${HEAD}${LAYER}
layout(location = 0) in vec4 vertex; // place and material
uniform mat4 view;
uniform vec3 palette[${NUM_MATERIALS}];
flat out vec3 colour;
void main() {
  colour = palette[int(vertex.w)];
  gl_Position = lifted(view * vec4(vertex.xyz, 1.0));
}`,
  fragment: `${HEAD}${FOG}
flat in vec3 colour;
uniform float opacity;
out vec4 result;
void main() { result = vec4(fade(colour), opacity); }`,
};

/** Lines: each piece is a rectangle with a width on the ground and a least width on the screen. */
export const LINE_SHADERS = {
  vertex: `${HEAD}${LAYER}${COLOUR}
layout(location = 0) in vec2 corner;
layout(location = 1) in vec3 from;
layout(location = 2) in vec3 to;
layout(location = 3) in vec4 style; // width, least pixels, distance along, material
layout(location = 4) in vec2 dashes;
uniform mat4 view;
uniform float pixel;
flat out vec4 colour;
flat out vec2 dash;
out float along, side;
flat out float thin;
void main() {
  vec3 place = mix(from, to, corner.x);
  float unit = pixel * max((view * vec4(place, 1.0)).w, 0.0);
  float halfWidth = 0.5 * max(style.x, style.y * unit);
  vec2 way = to.xy - from.xy;
  float size = length(way);
  way = size > 0.0 ? way / size : vec2(1.0, 0.0);
  float ends = dashes.y > 0.0 ? 0.0 : (2.0 * corner.x - 1.0) * 0.4 * halfWidth; // closes the gap at a bend
  place.xy += vec2(-way.y, way.x) * corner.y * halfWidth + way * ends;
  along = style.z + corner.x * size + ends;
  dash = dashes;
  side = corner.y;
  thin = clamp(style.x / max(style.y * unit, 1e-6), 0.55, 1.0); // a line that is too thin to see becomes fainter
  colour = colourOf(style.w);
  gl_Position = lifted(view * vec4(place, 1.0));
}`,
  fragment: `${HEAD}${FOG}
flat in vec4 colour;
flat in vec2 dash;
in float along, side;
flat in float thin;
uniform float opacity;
out vec4 result;
void main() {
  float alpha = opacity * thin * colour.a;
  if (dash.y > 0.0) {
    float blur = fwidth(along);
    float at = mod(along, dash.y);
    float on = smoothstep(-blur, blur, at) * (1.0 - smoothstep(dash.x - blur, dash.x + blur, at));
    alpha *= mix(on, dash.x / dash.y, clamp(2.0 * blur / dash.y, 0.0, 1.0));
  }
  float edge = fwidth(side);
  alpha *= 1.0 - smoothstep(1.0 - min(edge, 1.0), 1.0, abs(side)) * 0.5;
  result = vec4(fade(colour.rgb), alpha);
}`,
};

/** The part of an entity's vertex program that places it; `measure` is its size on the screen. */
const ENTITY = `
layout(location = 1) in vec4 pose; // x, y, z, roll
layout(location = 2) in vec4 body; // length, width, height, middle in front of the reference point
layout(location = 3) in vec4 looks; // kind, lamps, flags, least pixels
layout(location = 4) in vec4 way; // cosine and sine of the heading, pitch, paint
uniform mat4 view;
uniform float pixel;
uniform float enlarge; // 1: a thing that is too small to see is drawn larger, on the map
uniform vec3 kinds[4];
vec3 paintOf() { // on the map, and of egos, by the kind; else as cameras see it
  int paint = int(way.w);
  return looks.x > 0.0 && enlarge < 0.5 ? vec3(paint >> 16, paint >> 8 & 255, paint & 255) / 255.0 : kinds[int(looks.x)];
}
float sizeOnScreen() {
  float unit = pixel * max((view * vec4(pose.xyz, 1.0)).w, 0.0);
  return mix(1.0, max(1.0, looks.w * unit / max(body.x, 0.05)), enlarge);
}
vec3 placed(vec3 local) {
  if (pose.w != 0.0 || way.z != 0.0) {
    vec2 r = vec2(cos(pose.w), sin(pose.w));
    vec2 p = vec2(cos(way.z), sin(way.z));
    local = vec3(local.x, r.x * local.y - r.y * local.z, r.y * local.y + r.x * local.z);
    local = vec3(p.x * local.x + p.y * local.z, local.y, p.x * local.z - p.y * local.x);
  }
  return pose.xyz + vec3(way.x * local.x - way.y * local.y, way.y * local.x + way.x * local.y, local.z);
}
`;

/** Entities as bodies with lamps. */
export const ENTITY_SHADERS = {
  vertex: `${HEAD}${ENTITY}
layout(location = 0) in vec4 vertex; // along, across and up as shares of the body, and the part
out vec3 place;
out vec3 local; // along and across from the middle [m], and the share of the height
flat out vec4 look;
flat out vec2 size;
flat out float part;
flat out vec3 base;
void main() {
  base = paintOf();
  float scale = sizeOnScreen();
  vec3 at = vec3(vertex.x * body.x * scale + body.w, vertex.y * max(body.y, 0.05) * scale, vertex.z * body.z);
  local = vec3(vertex.x * body.x * scale, vertex.y * body.y * scale, vertex.z);
  place = placed(at);
  look = looks;
  size = body.xy * scale;
  part = vertex.w;
  gl_Position = view * vec4(place, 1.0);
}`,
  fragment: `${HEAD}${FOG}
in vec3 place, local;
flat in vec4 look;
flat in vec2 size;
flat in float part;
flat in vec3 base;
uniform vec3 contact;
uniform vec2 lampHeight; // where lamps are, as shares of the height
uniform float blink, isMarked;
out vec4 result;
void main() {
  vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
  int flags = int(look.z);
  vec3 body = (flags & 1) != 0 ? mix(base, contact, 0.8) : base;
  float shade = 0.66 + 0.34 * max(dot(normal, normalize(vec3(0.35, 0.25, 0.9))), 0.0);
  vec3 colour = body * shade;
  if (part == 0.0 && look.x < 1.5 && local.z < lampHeight.x - 0.12) colour *= 0.6; // bumpers and sills
  if (part == 1.0) colour = mix(vec3(0.10, 0.13, 0.17), vec3(0.42, 0.52, 0.60), 0.5 * max(normal.z, 0.0)) + 0.08 * body;
  if (part == 2.0) colour = vec3(0.10) * shade;
  if (part == 3.0) colour = mix(body, vec3(0.98, 0.80, 0.66), 0.75) * shade;
  if (part == 4.0) colour = mix(body, vec3(1.0), 0.75);
  if (part > 5.0) {
    int lamps = int(look.y);
    bool isOn = part == 7.0 ? (lamps & 4) != 0 : part == 10.0 ? (lamps & 8) != 0 : part != 6.0 && blink > 0.5 && (lamps & (part == 8.0 ? 1 : 2)) != 0;
    vec3 glass = part == 7.0 ? vec3(0.44, 0.07, 0.07) : part == 6.0 || part == 10.0 ? vec3(0.84) : vec3(0.62, 0.36, 0.1);
    vec3 light = part == 7.0 ? vec3(1.0, 0.14, 0.1) : part == 10.0 ? vec3(1.0) : vec3(1.0, 0.63, 0.08);
    colour = isOn ? light : glass * shade;
  }
  if (isMarked > 0.5 && part == 0.0 && look.x < 1.5) { // on the map, where real lamps would not be seen
    float unit = length(vec2(fwidth(local.x), fwidth(local.y)));
    float deep = max(0.3, 1.3 * unit);
    float wide = min(max(0.34, 2.0 * unit), 0.45 * size.y);
    float aside = 0.5 * size.y - abs(local.y);
    bool isRear = local.x < deep - 0.5 * size.x;
    bool isFront = local.x > 0.5 * size.x - deep;
    bool isLamp = (isRear || isFront) && local.z > lampHeight.x && (local.z < lampHeight.y || local.z > 0.97);
    int lamps = int(look.y);
    if (isLamp && aside < wide) {
      bool isOn = blink > 0.5 && (lamps & (local.y > 0.0 ? 1 : 2)) != 0;
      colour = isRear ? vec3(0.45, 0.02, 0.05) : vec3(0.93, 0.93, 0.86);
      if (isRear && (lamps & 4) != 0) colour = vec3(1.0, 0.05, 0.05);
      if (isOn) colour = vec3(1.0, 0.68, 0.0);
    } else if (isLamp && isRear && aside < 2.0 * wide && (lamps & 8) != 0) {
      colour = vec3(1.0);
    }
  }
  result = vec4(fade(colour), 1.0);
}`,
};

/** Vehicles from far away: little work for each pixel, because there may be very many. */
export const FAR_SHADERS = {
  vertex: `${HEAD}${ENTITY}
layout(location = 0) in vec4 vertex;
uniform vec3 contact;
flat out vec3 colour, tail;
out float along;
void main() {
  float scale = sizeOnScreen();
  vec3 at = vec3(vertex.x * body.x * scale + body.w, vertex.y * body.y * scale, vertex.z * body.z);
  vec3 paint = paintOf();
  if ((int(looks.z) & 1) != 0) paint = mix(paint, contact, 0.8);
  colour = vertex.w == 1.0 ? vec3(0.2, 0.24, 0.29) + 0.1 * paint : paint * (vertex.w == 5.0 ? 0.97 : 0.78);
  tail = (int(looks.y) & 4) != 0 ? vec3(1.0, 0.05, 0.05) : colour;
  along = vertex.x;
  gl_Position = view * vec4(placed(at), 1.0);
}`,
  fragment: `${HEAD}${FOG}
flat in vec3 colour, tail;
in float along;
out vec4 result;
void main() { result = vec4(fade(along < -0.38 ? tail : colour), 1.0); }`,
};

/** Soft shadows under entities. */
export const SHADOW_SHADERS = {
  vertex: `${HEAD}${ENTITY}${LAYER}
layout(location = 0) in vec4 vertex;
out vec2 at;
flat out vec2 size;
void main() {
  float scale = sizeOnScreen();
  size = 0.5 * body.xy * scale + 0.35;
  at = vertex.xy * 2.0 * size;
  gl_Position = lifted(view * vec4(placed(vec3(at.x + body.w, at.y, 0.0)), 1.0));
}`,
  fragment: `${HEAD}
in vec2 at;
flat in vec2 size;
out vec4 result;
void main() {
  vec2 inside = (size - abs(at)) / 0.7;
  result = vec4(0.0, 0.0, 0.0, 0.36 * clamp(inside.x, 0.0, 1.0) * clamp(inside.y, 0.0, 1.0));
}`,
};

const WHOLE_SCREEN = `${HEAD}
layout(location = 0) in vec2 corner;
out vec2 at;
void main() {
  at = corner;
  gl_Position = vec4(corner, 0.999999, 1.0);
}`;

/** Sky above the horizon, for the camera behind the car. */
export const SKY_SHADERS = {
  vertex: WHOLE_SCREEN,
  fragment: `${HEAD}
in vec2 at;
uniform vec3 zenith, haze;
uniform float skyline;
out vec4 result;
void main() { result = vec4(mix(haze, zenith, clamp(0.8 * (at.y - skyline), 0.0, 1.0)), 1.0); }`,
};

/** Ground below the horizon, with lines that are 10 m apart. */
export const GROUND_SHADERS = {
  vertex: WHOLE_SCREEN,
  fragment: `${HEAD}
in vec2 at;
uniform vec3 eye; // above the ground in z; x and y within the pattern
uniform vec3 forward, right, up, haze, ground, grid;
uniform float density;
out vec4 result;
void main() {
  vec3 ray = forward + at.x * right + at.y * up;
  float distance = -eye.z / min(ray.z, -1e-5);
  vec2 place = (eye.xy + distance * ray.xy) * 0.1;
  vec2 blur = fwidth(place);
  vec2 line = abs(fract(place - 0.5) - 0.5);
  vec2 on = clamp(1.0 - (line - 0.006) / (1.5 * blur + 0.001), 0.0, 1.0) * clamp(1.0 - 3.0 * blur, 0.0, 1.0);
  float far = density * distance;
  result = vec4(mix(haze, mix(ground, grid, max(on.x, on.y)), 1.0 / (1.0 + far * far)), 1.0);
}`,
};
