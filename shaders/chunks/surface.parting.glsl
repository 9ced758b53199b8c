// Effect: pairs of nodes that press on one another or are apart. Needs: surface. Uniform 4 is the place of their lists.
// Gives: parting_force(s, u), mN: k n min(0, n · (u_other - u)) of each pair, n out of the node's own surface.

layout(location = 4) uniform uint parting_lists;

const uint parting_record = 5u;  // the other node; k, mN/mm; n

vec3 parting_force(uint s, vec3 u) {
    vec3 sum = vec3(0.0);
    uint end = surface_effects[parting_lists + s + 1u];
    for (uint at = surface_effects[parting_lists + s]; at < end; at += parting_record) {
        vec3 n = surface_vector(at + 2u);
        sum += (surface_number(at + 1u) * min(dot(n, moved_beyond(at, u)), 0.0)) * n;
    }
    return sum;
}
