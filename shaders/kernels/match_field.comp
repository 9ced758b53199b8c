// One invocation per voxel of the wide grid: the displacement of the tissue there, 0 outside the mesh.
// Needs: index, match, match.field.

const uint no_owner = 0xffffffffu;

/// Barycentric coordinates of nodes 1, 2, 3 as functions of the wide index: gradient . (index - corner).
struct MatchElement {
    uvec4 nodes;
    vec4 corner, gradient_1, gradient_2, gradient_3;
};

layout(std430, binding = BINDING_MATCH_OWNER) readonly buffer MatchOwner { uint owner[]; };
layout(std430, binding = BINDING_MATCH_ELEMENTS) readonly buffer MatchElements { MatchElement element[]; };
layout(std430, binding = BINDING_MATCH_NODES) readonly buffer MatchNodes { vec4 displacement[]; };  // mm

void main() {
    uint offset = invocation_index();
    if (offset >= wide_count()) return;
    uint e = owner[offset];
    vec3 u = vec3(0.0);
    if (e != no_owner) {
        uvec4 nodes = element[e].nodes;
        vec3 from_corner = vec3(wide_voxel(offset)) - element[e].corner.xyz;
        vec3 u0 = displacement[nodes.x].xyz;
        u = u0 + dot(element[e].gradient_1.xyz, from_corner) * (displacement[nodes.y].xyz - u0) +
            dot(element[e].gradient_2.xyz, from_corner) * (displacement[nodes.z].xyz - u0) +
            dot(element[e].gradient_3.xyz, from_corner) * (displacement[nodes.w].xyz - u0);
    }
    set_field(offset, u);
}
