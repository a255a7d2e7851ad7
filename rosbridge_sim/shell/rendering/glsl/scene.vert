#version 330
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
