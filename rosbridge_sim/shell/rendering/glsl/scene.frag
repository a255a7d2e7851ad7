
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
