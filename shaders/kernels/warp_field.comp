// One invocation per voxel of the output: one component of the backward field X - y, mm, LPS. A component at a time, so
// that no block is larger than an image.
// Needs: index, warp, warp.inverse.

layout(location = 0) uniform uint component;

layout(std430, binding = BINDING_WARP_RESULT) writeonly buffer WarpResult { float result[]; };

void main() {
    uint voxel = invocation_index();
    if (voxel >= voxel_count()) return;
    vec3 p = vec3(output_voxel(voxel));
    vec3 w = inverse_displacement(voxel, p);
    vec4 row = component == 0u ? rigid_field[0] : component == 1u ? rigid_field[1] : rigid_field[2];
    float elastic = component == 0u ? w.x : component == 1u ? w.y : w.z;
    result[voxel] = dot(row.xyz, p) + row.w + elastic;
}
