// Effect: pressure that follows faces. Needs: surface. Uniform 1 is the place of its lists.
// Gives: pressure_force(s, u), mN: - p/6 e_b × e_c of each face at the node, e its deformed edges.

layout(location = 1) uniform uint pressure_lists;

const uint pressure_record = 9u;  // nodes b, c; p/6, kPa; edges to b and c at rest, mm

vec3 pressure_force(uint s, vec3 u) {
    vec3 sum = vec3(0.0);
    uint end = surface_effects[pressure_lists + s + 1u];
    for (uint at = surface_effects[pressure_lists + s]; at < end; at += pressure_record) {
        vec3 to_b = surface_vector(at + 3u) + moved_beyond(at, u);
        vec3 to_c = surface_vector(at + 6u) + moved_beyond(at + 1u, u);
        sum -= surface_number(at + 2u) * cross(to_b, to_c);
    }
    return sum;
}
