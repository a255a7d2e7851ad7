#version 330
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
