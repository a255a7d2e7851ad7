#version 330
uniform mat4 view;
in vec3 place;
in vec2 edge;
out vec2 at;

void main() {
    at = edge;
    gl_Position = view * vec4(place, 1.0);
}
