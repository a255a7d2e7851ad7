#version 330
uniform float strength;
in vec2 at;
out vec4 rgba;

void main() {
    vec2 inside = smoothstep(0.0, 0.22, 1.0 - abs(at));
    rgba = vec4(0.0, 0.0, 0.0, strength * inside.x * inside.y);
}
