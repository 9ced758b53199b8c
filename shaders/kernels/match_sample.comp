// One invocation per voxel of the wide grid: what the fixed image shows where the model takes that voxel, linear, and
// whether its nearest voxel there counts; off the image 0 and no.
// Needs: index, match, match.field.

layout(std430, binding = BINDING_MATCH_FIXED) readonly buffer MatchFixed { float fixed_value[]; };
/// Four voxels to a word, the first in its lowest byte.
layout(std430, binding = BINDING_MATCH_FIXED_SEEN) readonly buffer MatchFixedSeen { uint fixed_seen[]; };
layout(std430, binding = BINDING_MATCH_VALUE) writeonly buffer MatchValue { float value[]; };
layout(std430, binding = BINDING_MATCH_SEEN) writeonly buffer MatchSeen { uint seen[]; };

uint fixed_offset(uvec3 voxel) { return voxel.x + fixed_size.x * (voxel.y + fixed_size.y * voxel.z); }

float along_i(uint row, uvec2 columns, float fraction) {
    float left = fixed_value[row + columns.x];
    return left + fraction * (fixed_value[row + columns.y] - left);
}

float in_slice(uint k, uvec3 lower, uvec3 upper, vec3 fraction) {
    float near = along_i(fixed_offset(uvec3(0u, lower.y, k)), uvec2(lower.x, upper.x), fraction.x);
    float far = along_i(fixed_offset(uvec3(0u, upper.y, k)), uvec2(lower.x, upper.x), fraction.x);
    return near + fraction.y * (far - near);
}

float linear_value(vec3 index) {
    uvec3 last = fixed_size.xyz - 1u;
    uvec3 lower = min(uvec3(index), max(fixed_size.xyz, uvec3(2u)) - 2u);
    uvec3 upper = min(lower + 1u, last);
    vec3 fraction = index - vec3(lower);
    float near = in_slice(lower.z, lower, upper, fraction);
    float far = in_slice(upper.z, lower, upper, fraction);
    return near + fraction.z * (far - near);
}

void main() {
    uint offset = invocation_index();
    if (offset >= wide_count()) return;
    vec4 p = vec4(vec3(wide_voxel(offset)), 1.0);
    vec3 u = field_at(offset);
    vec3 index = vec3(dot(to_fixed_index[0], p) + dot(shift_to_index[0].xyz, u),
                      dot(to_fixed_index[1], p) + dot(shift_to_index[1].xyz, u),
                      dot(to_fixed_index[2], p) + dot(shift_to_index[2].xyz, u));
    vec3 last = vec3(fixed_size.xyz) - 1.0;
    bool on_image = all(greaterThanEqual(index, vec3(-0.5))) && all(lessThanEqual(index, last + 0.5));
    vec3 held = clamp(index, vec3(0.0), last);
    uint nearest = fixed_offset(uvec3(held + 0.5));
    value[offset] = on_image ? linear_value(held) : 0.0;
    seen[offset] = on_image ? (fixed_seen[nearest / 4u] >> (8u * (nearest % 4u))) & 1u : 0u;
}
