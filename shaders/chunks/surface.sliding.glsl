// Effect: pairs of nodes that slide on one another. Needs: surface. Uniform 3 is the place of their lists.
// Gives: sliding_force(s, u), mN: k n (n · (u_other - u)) of each pair, the same for both of its nodes.

layout(location = 3) uniform uint sliding_lists;

const uint sliding_record = 5u;  // the other node; k, mN/mm; n

vec3 sliding_force(uint s, vec3 u) {
    vec3 sum = vec3(0.0);
    uint end = surface_effects[sliding_lists + s + 1u];
    for (uint at = surface_effects[sliding_lists + s]; at < end; at += sliding_record) {
        vec3 n = surface_vector(at + 2u);
        sum += (surface_number(at + 1u) * dot(n, moved_beyond(at, u))) * n;
    }
    return sum;
}
