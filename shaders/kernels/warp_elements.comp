// One invocation per tetrahedron: writes its inverse displacement X - z as an affine function of the output index: rows
// (gradient, value at node 0) of x, y, z, then node 0. Relative to a node, because far from the origin of the grid the
// steep field of a thin element would lose its digits. Counts what a simulation should not have left; the host zeroes the
// counters.
// Needs: index, warp, warp.element.

layout(location = 0) uniform uint element_count;

layout(std430, binding = BINDING_WARP_ELEMENT_FIELD) writeonly buffer WarpElementField { vec4 element_field[]; };
layout(std430, binding = BINDING_WARP_COUNTS) buffer WarpCounts { uint negative_elements, flat_elements; };

vec3 inverse_displacement(uint node) { return warp_node[2u * node + 1u].xyz; }

void main() {
    uint e = invocation_index();
    if (e >= element_count) return;
    uvec4 nodes = warp_tetrahedron[e];
    BarycentricMap map = barycentric_map(nodes);
    if (map.volume < 0.0) atomicAdd(negative_elements, 1u);
    if (map.volume == 0.0) atomicAdd(flat_elements, 1u);
    vec3 w = inverse_displacement(nodes.x);
    vec3 to_1 = inverse_displacement(nodes.y) - w;
    vec3 to_2 = inverse_displacement(nodes.z) - w;
    vec3 to_3 = inverse_displacement(nodes.w) - w;
    element_field[4u * e] = vec4(to_1.x * map.gradient_1 + to_2.x * map.gradient_2 + to_3.x * map.gradient_3, w.x);
    element_field[4u * e + 1u] = vec4(to_1.y * map.gradient_1 + to_2.y * map.gradient_2 + to_3.y * map.gradient_3, w.y);
    element_field[4u * e + 2u] = vec4(to_1.z * map.gradient_1 + to_2.z * map.gradient_2 + to_3.z * map.gradient_3, w.z);
    element_field[4u * e + 3u] = vec4(map.corner, 0.0);
}
