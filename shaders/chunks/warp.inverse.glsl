// Needs: warp; the passes warp_rasterise and warp_elements have run; with HAS_CONTINUATION the chunk warp.continuation.
// Gives: inverse_displacement(offset, p), X - z of the tissue found at a voxel, mm, frame of the moving image.
//! define HAS_CONTINUATION

layout(std430, binding = BINDING_WARP_OWNER) readonly buffer WarpOwner { uint owner[]; };
layout(std430, binding = BINDING_WARP_ELEMENT_FIELD) readonly buffer WarpElementField { vec4 element_field[]; };

vec3 inverse_displacement(uint offset, vec3 p) {
    uint e = owner[offset];
#if HAS_CONTINUATION
    if (e == NO_OWNER) return continued(offset);
#else
    if (e == NO_OWNER) return vec3(0.0);
#endif
    vec3 from_corner = p - element_field[4u * e + 3u].xyz;
    vec4 x = element_field[4u * e];
    vec4 y = element_field[4u * e + 1u];
    vec4 z = element_field[4u * e + 2u];
    return vec3(dot(x.xyz, from_corner) + x.w, dot(y.xyz, from_corner) + y.w, dot(z.xyz, from_corner) + z.w);
}
