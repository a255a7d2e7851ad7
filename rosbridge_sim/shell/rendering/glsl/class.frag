#version 330
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
