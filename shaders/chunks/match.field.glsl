// Gives: the displacement of the wide grid's voxels, mm, moving frame; a block for each component, so that none is larger
// than an image.
// Needs: match.

layout(std430, binding = BINDING_MATCH_FIELD_X) buffer MatchFieldX { float field_x[]; };
layout(std430, binding = BINDING_MATCH_FIELD_Y) buffer MatchFieldY { float field_y[]; };
layout(std430, binding = BINDING_MATCH_FIELD_Z) buffer MatchFieldZ { float field_z[]; };

vec3 field_at(uint offset) { return vec3(field_x[offset], field_y[offset], field_z[offset]); }

void set_field(uint offset, vec3 displacement) {
    field_x[offset] = displacement.x;
    field_y[offset] = displacement.y;
    field_z[offset] = displacement.z;
}
