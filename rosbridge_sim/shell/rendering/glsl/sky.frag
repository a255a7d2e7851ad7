#version 330
uniform vec3 zenith;
uniform vec3 horizon;
in vec3 way;
out vec4 rgba;

void main() {
    float up = normalize(way).z;
    rgba = vec4(mix(horizon, zenith, smoothstep(0.0, 0.45, up)), 1.0);
}
