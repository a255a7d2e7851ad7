#version 330
uniform mat4 back;        // from the picture to directions
in vec2 corner;
out vec3 way;

void main() {
    gl_Position = vec4(corner, 1.0, 1.0);
    way = (back * vec4(corner, 1.0, 1.0)).xyz;
}
