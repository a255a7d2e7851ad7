"""The programs of the graphics library: scene, classes, shadows and sky."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

MAX_BEAMS: Final = 6
"""Vehicles whose head lamps light the road in a picture."""


ASPHALT_FADES, GRASS_FADES = 30.0, 60.0
"""Distances at which the patterns of asphalt and grass have faded away [m]."""


class Coat(StrEnum):
    """Pattern on the triangles of a class. Each has a shader program of its own.

    A processor that draws works out all branches of a program for each pixel, whichever is taken.
    """

    PLAIN = "PLAIN"
    ASPHALT = "ASPHALT"
    GRASS = "GRASS"
    SLABS = "SLABS"
    WALL = "WALL"


SCENE_VERTEX: Final = """#version 330
uniform mat4 view;        // from the scene to the picture
uniform vec3 eye;
uniform vec3 sun;
uniform vec3 direct;
uniform vec3 ambient;
uniform bool is_dark;
uniform float haze;
uniform int without;      // instance that is left out
in vec3 place;
in uvec4 look;            // red, green, blue, class
in ivec4 normal;          // x, y, z in 1/127, and whether it shines
in int instance;
flat out vec3 colour;
flat out vec3 upright;
flat out float shine;
out float lost;           // share of light that is lost on the way
out vec3 spot;

void main() {
    vec3 n = vec3(normal.xyz) / 127.0;
    vec3 away = place - eye;
    if (dot(n, away) > 0.0) n = -n;
    vec3 light = ambient * (0.86 + 0.14 * n.z) + direct * max(dot(n, sun), 0.0) / max(sun.z, 0.3);
    colour = vec3(look.rgb) / 255.0;
    shine = normal.w == 1 || (is_dark && normal.w == 2) ? 1.0 : 0.0;
    if (shine == 0.0) colour *= light;
    upright = n;
    spot = place;
    lost = (1.0 - exp(-length(away) * haze)) * (1.0 - 0.6 * shine);
    gl_Position = instance == without && without != 0 ? vec4(0.0, 0.0, 2.0, 1.0) : view * vec4(place, 1.0);
}
"""
"""Light and haze are worked out for the corners of the triangles, which are small: pixels have less to do."""

_SCENE_FRAGMENT: Final = """
uniform vec3 eye;
uniform vec3 haze_colour;
uniform vec3 zenith;
#ifdef DARK
uniform int num_beams;
uniform float beam;
uniform vec3 beam_place[MAX_BEAMS];
uniform vec3 beam_way[MAX_BEAMS];
#endif
flat in vec3 colour;
flat in vec3 upright;
flat in float shine;
in float lost;
in vec3 spot;
out vec4 rgba;

float chance(vec2 cell) {  // 0..1 for each cell
    ivec2 at = ivec2(floor(cell));
    uint h = uint(at.x) * 374761393u + uint(at.y) * 668265263u;
    h = (h ^ (h >> 13)) * 1274126177u;
    return float(h >> 8) * (1.0 / 16777216.0);
}

void main() {
    vec3 seen = colour;
#ifdef ASPHALT
    // Stones of 2 cm, which melt into one another with the distance.
    vec3 away = spot - eye;
    float fade = max(1.0 - dot(away, away) * (1.0 / FADES2), 0.0);
    seen *= 1.0 + (chance(spot.xy * 48.0) - 0.5) * 0.22 * fade;
#endif
#ifdef GRASS
    vec3 away = spot - eye;
    float fade = max(1.0 - dot(away, away) * (1.0 / FADES2), 0.0);
    seen *= 1.0 + (chance(spot.xy * 22.0) - 0.5) * 0.30 * fade;
#endif
#ifdef SLABS
    vec2 slab = abs(fract(spot.xy * 1.11) - 0.5);
    seen *= max(slab.x, slab.y) > 0.485 && lost < 0.02 ? 0.92 : 1.0;
#endif
#ifdef WALL
    // Windows: 1.5 m wide in fields of 3 m, one row for each storey.
    vec2 flat_place = vec2(dot(spot.xy, vec2(-upright.y, upright.x)), spot.z) / vec2(3.0, 3.2);
    vec2 field = fract(flat_place);
    bool is_window = abs(upright.z) < 0.5 && abs(field.x - 0.5) < 0.26 && abs(field.y - 0.54) < 0.24;
    vec3 pane = mix(seen * 0.38, zenith * 0.55, 0.45);
#ifdef DARK
    float which = chance(flat_place);
    pane = which > 0.72 ? vec3(0.72, 0.58, 0.34) * (0.5 + 0.5 * which) : pane;
#endif
    seen = is_window ? pane : seen;
#endif
#ifdef DARK
    vec3 lit = vec3(0.0);
    for (int i = 0; i < num_beams; i++) {
        vec3 ray = spot - beam_place[i];
        float reach = max(length(ray), 0.5);
        float cone = smoothstep(0.86, 0.985, dot(ray / reach, beam_way[i]));
        lit += cone * 60.0 / (reach * reach + 40.0) * vec3(1.0, 0.96, 0.86);
    }
    seen += lit * seen * beam * (1.0 - shine);
#endif
#ifdef WET
    vec3 ray = normalize(spot - eye);
    float slant = 1.0 - clamp(-ray.z, 0.0, 1.0);
    vec3 mirror = mix(seen * 0.72, haze_colour, 0.5 * slant * slant * slant * slant);
    seen = upright.z > 0.9 && shine == 0.0 ? mirror : seen;
#endif
    rgba = vec4(mix(seen, haze_colour, lost), 1.0);
}
"""


def scene_fragment(coat: Coat, *, is_dark: bool, is_wet: bool) -> str:
    """Return the program for the pixels of a class.

    Args:
        is_dark: head lamps light it.
    """
    words = [coat.value, *(["DARK"] if is_dark else []), *(["WET"] if is_wet else [])]
    fades = {Coat.ASPHALT: ASPHALT_FADES, Coat.GRASS: GRASS_FADES}.get(coat, 1.0)
    head = "".join(f"#define {word}\n" for word in [*words, f"FADES2 {fades * fades:.1f}"])
    return f"#version 330\n{head}const int MAX_BEAMS = {MAX_BEAMS};\n{_SCENE_FRAGMENT}"


CLASS_VERTEX: Final = """#version 330
uniform mat4 view;
uniform int without;
in vec3 place;
in uvec4 look;
in int instance;
flat out uint label;
flat out int entity;
out float depth;

void main() {
    label = look.a;
    entity = instance;
    gl_Position = instance == without && without != 0 ? vec4(0.0, 0.0, 2.0, 1.0) : view * vec4(place, 1.0);
    depth = gl_Position.w;
}
"""

CLASS_FRAGMENT: Final = """#version 330
flat in uint label;
flat in int entity;
in float depth;
layout(location = 0) out uint label_out;
layout(location = 1) out int entity_out;
layout(location = 2) out float depth_out;

void main() {
    label_out = label;
    entity_out = entity;
    depth_out = depth;
}
"""

SHADOW_VERTEX: Final = """#version 330
uniform mat4 view;
in vec3 place;
in vec2 edge;
out vec2 at;

void main() {
    at = edge;
    gl_Position = view * vec4(place, 1.0);
}
"""

SHADOW_FRAGMENT: Final = """#version 330
uniform float strength;
in vec2 at;
out vec4 rgba;

void main() {
    vec2 inside = smoothstep(0.0, 0.22, 1.0 - abs(at));
    rgba = vec4(0.0, 0.0, 0.0, strength * inside.x * inside.y);
}
"""

SKY_VERTEX: Final = """#version 330
uniform mat4 back;        // from the picture to directions
in vec2 corner;
out vec3 way;

void main() {
    gl_Position = vec4(corner, 1.0, 1.0);
    way = (back * vec4(corner, 1.0, 1.0)).xyz;
}
"""

SKY_FRAGMENT: Final = """#version 330
uniform vec3 zenith;
uniform vec3 horizon;
in vec3 way;
out vec4 rgba;

void main() {
    float up = normalize(way).z;
    rgba = vec4(mix(horizon, zenith, smoothstep(0.0, 0.45, up)), 1.0);
}
"""
