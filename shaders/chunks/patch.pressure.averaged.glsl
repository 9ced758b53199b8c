// Element AveragedPressureT4. Needs: index, bindings, patch, patch.exchange, patch.nodes, patch.units, patch.fans, a law.
// Gives: the volume changes of a patch's nodes, in shared memory and sent to the patches of the same material; nodal pressures
// from them; and Pressure, that of a tetrahedron of a fan: the mean of its nodes' (kPa).

/// Shares of slots in the volume changes of tetrahedra, ¼ V_e (J_e - 1) summed over the patch, mm³; then one zero.
layout(std430, binding = BINDING_PATCH_VOLUMES) COHERENT buffer PatchVolumes { float patch_volumes[]; };

shared int node_volume[SLOTS];       // units of 1/24 mm³ over scale
shared float nodal_pressure[SLOTS];  // kPa

struct Pressure {
    float of_edge, of_c, of_d;
};

Pressure first_pressure(Patch here, uint a, uint b, uint c) {
    return Pressure(nodal_pressure[a] + nodal_pressure[b], 0.0, nodal_pressure[c]);
}
void take_next_node(inout Pressure pressure, uint d) {
    pressure.of_c = pressure.of_d;
    pressure.of_d = nodal_pressure[d];
}
float pressure_of(Pressure pressure, float volume_change) {
    return 0.25 * (pressure.of_edge + (pressure.of_c + pressure.of_d));
}

/// 6 V (J - 1) = det(D + G) - det D with D = (rest_b, rest_c, rest_d) and G = (moved_b, moved_c, moved_d).
float six_volume_change(Edges t) {
    vec3 bc = cross(t.moved_b, t.moved_c);
    float linear = dot(t.moved_b, t.normal_b) + dot(t.moved_c, t.normal_c) + dot(t.moved_d, t.normal_d);
    float quadratic = dot(t.rest_b, cross(t.moved_c, t.moved_d)) + dot(t.rest_c, cross(t.moved_d, t.moved_b)) +
                      dot(t.rest_d, bc);
    return linear + (quadratic + dot(t.moved_d, bc));
}

int volumes_before;  // see no_sum

void leave_volume(uint i, float v, float scale, inout uint largest) {
    largest = max(largest, floatBitsToUint(abs(v)));
    volumes_before |= atomicAdd(node_volume[i], int(roundEven(v * scale)));
}

void add_fan_volumes(uvec4 fan, float scale, inout uint largest) {
    uint a = fan.x & 0xffffu, b = fan.x >> 16u, c = fan.y & 0xffffu;
    Node node_of_a = node(a);
    Edges t = first_edges(node_of_a, node(b), node(c));
    float last = 0.0, sum = 0.0;
    for (Ring ring = ring_of(fan); ring.next != no_node; ring = next_of_ring(ring)) {
        t = next_edges(t, node_of_a, node(ring.next));
        float v = six_volume_change(t);
        leave_volume(c, last + v, scale, largest);
        last = v;
        sum += v;
        c = ring.next;
    }
    leave_volume(c, last, scale, largest);
    leave_volume(a, sum, scale, largest);
    leave_volume(b, sum, scale, largest);
}

/// As compute_forces.
bool compute_volumes(Patch here, uvec4 first, inout float scale, out uint largest) {
    uint lane = gl_LocalInvocationID.x;
    for (;;) {
        uint largest_here = 0u;
        volumes_before = 0;
        uvec4 fan = first;
        for (uint f = lane; f < here.fans; f += WORKGROUP_SIZE) {
            uvec4 next = fan_of(here, f + WORKGROUP_SIZE);
            add_fan_volumes(fan, scale, largest_here);
            fan = next;
        }
        atomicMax(largest_of_patch, largest_here | no_sum(volumes_before));
        barrier();
        largest = largest_of_patch;
        if (!countable(largest)) return false;
        if (fits(largest, scale)) return true;
        scale = scale_for(largest);
        barrier();
        for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) node_volume[i] = 0;
        if (lane == 0u) largest_of_patch = 0u;
        barrier();
    }
}

void send_volume(uint s, uint i, float scale, bool good) {
    patch_volumes[s] = good ? float(node_volume[i]) / (24.0 * scale) : not_a_number();
}

/// A source of another material has no share in a node's volume here: the zero instead.
uint volume_at(uint source) { return (source & other_material) == 0u ? source : slots_of_all; }

float volumes_of_planes(uint i, Planes planes) {
    uvec4 source = sources_of_planes(i, planes);
    bvec4 present = lessThan(uvec4(i), planes.counts);
    float a = patch_volumes[present.x ? volume_at(source.x) : slots_of_all];
    float b = patch_volumes[present.y ? volume_at(source.y) : slots_of_all];
    float c = patch_volumes[present.z ? volume_at(source.z) : slots_of_all];
    float d = patch_volumes[present.w ? volume_at(source.w) : slots_of_all];
    return ((a + b) + c) + d;
}

/// Sum over all patches that share slot i, in an order that all of them share.
float received_volume(Patch here, uint i) {
    uint s = here.index * SLOTS + i;
    if (i >= here.shared_slots) return patch_volumes[s];
    Planes planes = first_planes(here);
    if (i >= planes.counts.x) return patch_volumes[s] + patch_volumes[volume_at(source_of_pair(here, i))];
    float sum = volumes_of_planes(i, planes);
    for (uint quad = 1u; quad < 4u; ++quad) {
        planes = next_planes(here, planes, quad);
        if (i >= planes.counts.x) break;
        sum += volumes_of_planes(i, planes);
    }
    return sum;
}

/// q_a = M U'(J_a) with J_a - 1 = Σ ¼ V_e (J_e - 1) / V_a.
void find_pressure(Patch here, uint i) {
    float inverse_volume = patch_rest[7u * slots_of_all + here.index * SLOTS + i];
    nodal_pressure[i] = here.volumetric_modulus * volumetric_derivative(received_volume(here, i) * inverse_volume);
}
