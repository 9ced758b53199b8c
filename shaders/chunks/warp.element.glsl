// Needs: warp. Gives: barycentric_map(nodes), the barycentric coordinates of a deformed tetrahedron as affine functions
// of the output index.

/// Two entries a node: its deformed position as an output index, and X - z there, minus its displacement, mm, frame of
/// the moving image.
layout(std430, binding = BINDING_WARP_NODES) readonly buffer WarpNodes { vec4 warp_node[]; };
layout(std430, binding = BINDING_WARP_TETRAHEDRA) readonly buffer WarpTetrahedra { uvec4 warp_tetrahedron[]; };

struct BarycentricMap {
    vec3 corner;                              // of node 0
    vec3 gradient_1, gradient_2, gradient_3;  // of the coordinates, 1/voxel; that of node 0 is minus their sum
    float volume;                             // six times, voxel³, negative where inverted; 0 where flat
};

vec3 deformed(uint node) { return warp_node[2u * node].xyz; }

/// An element flatter than 1e-6 of its edges' product lies within the neighbours' slack (kernels/warp_rasterise.comp)
/// unless its edges pass 100 voxels; float32 could not tell its sides apart. Its gradients mean nothing.
BarycentricMap barycentric_map(uvec4 nodes) {
    BarycentricMap map;
    map.corner = deformed(nodes.x);
    vec3 a = deformed(nodes.y) - map.corner;
    vec3 b = deformed(nodes.z) - map.corner;
    vec3 c = deformed(nodes.w) - map.corner;
    vec3 normal = cross(b, c);
    float volume = dot(a, normal);
    map.volume = abs(volume) > 1e-6 * length(a) * length(b) * length(c) ? volume : 0.0;
    map.gradient_1 = normal / volume;
    map.gradient_2 = cross(c, a) / volume;
    map.gradient_3 = cross(a, b) / volume;
    return map;
}
