// One invocation per voxel of the output: reads the moving image where the tissue came from, trilinear, or with
// TAKES_NEAREST the nearest voxel; clamped over the half voxel beyond the outermost centres, `outside` further off.
// Needs: index, warp, warp.inverse.
//! define TAKES_NEAREST

layout(location = 0) uniform uint outside;  // the bits of a result

/// Bits of float32, with TAKES_NEAREST of anything.
layout(std430, binding = BINDING_WARP_MOVING) readonly buffer WarpMoving { uint moving[]; };
layout(std430, binding = BINDING_WARP_RESULT) writeonly buffer WarpResult { uint result[]; };

/// Rounding must not push the outermost half voxel outside.
bool held(vec3 index) {
    vec3 upper = vec3(moving_size.xyz) - 0.5 + 1e-6;
    return all(greaterThanEqual(index, vec3(-0.5 - 1e-6))) && all(lessThanEqual(index, upper));
}

uint moving_offset(ivec3 voxel) {
    return uint(voxel.x) + moving_size.x * (uint(voxel.y) + moving_size.y * uint(voxel.z));
}

#if TAKES_NEAREST
uint value_at(ivec3 p, vec3 offset) {
    ivec3 voxel = p + ivec3(floor(offset + 0.5));
    return moving[moving_offset(clamp(voxel, ivec3(0), ivec3(moving_size.xyz) - 1))];
}
#else
float along_i(uint row, ivec2 columns, float fraction) {
    float left = uintBitsToFloat(moving[row + uint(columns.x)]);
    return left + fraction * (uintBitsToFloat(moving[row + uint(columns.y)]) - left);
}

float in_slice(int k, ivec3 lower, ivec3 upper, vec3 fraction) {
    ivec2 columns = ivec2(lower.x, upper.x);
    float near = along_i(moving_offset(ivec3(0, lower.y, k)), columns, fraction.x);
    float far = along_i(moving_offset(ivec3(0, upper.y, k)), columns, fraction.x);
    return near + fraction.y * (far - near);
}

/// The cell comes from integers and a small offset: the fraction keeps the digits that an index of hundreds would cost.
uint value_at(ivec3 p, vec3 offset) {
    vec3 whole = floor(offset);
    ivec3 cell = p + ivec3(whole);
    ivec3 last = ivec3(moving_size.xyz) - 1;
    vec3 fraction = mix(offset - whole, vec3(0.0), lessThan(cell, ivec3(0)));
    ivec3 lower = clamp(cell, ivec3(0), last);
    ivec3 upper = min(lower + 1, last);
    float near = in_slice(lower.z, lower, upper, fraction);
    float far = in_slice(upper.z, lower, upper, fraction);
    return floatBitsToUint(near + fraction.z * (far - near));
}
#endif

void main() {
    uint voxel = invocation_index();
    if (voxel >= voxel_count()) return;
    ivec3 whole = ivec3(output_voxel(voxel));
    vec3 p = vec3(whole);
    vec3 w = inverse_displacement(voxel, p);
    vec3 offset = vec3(dot(rigid_offset[0].xyz, p) + rigid_offset[0].w + dot(to_moving_index[0].xyz, w),
                       dot(rigid_offset[1].xyz, p) + rigid_offset[1].w + dot(to_moving_index[1].xyz, w),
                       dot(rigid_offset[2].xyz, p) + rigid_offset[2].w + dot(to_moving_index[2].xyz, w));
    result[voxel] = held(p + offset) ? value_at(whole, offset) : outside;
}
