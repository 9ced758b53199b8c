// Needs: numbers, deformation, material, isochoric, a law with USES_SHEAR 1, patch.nodes, patch.units, patch.fans, and
// patch.pressure.element or patch.pressure.averaged; patch.fibre, and patch.viscosity or patch.resting, where their
// flags are 1.
// Gives: the forces of a patch's tetrahedra on its nodes, in shared memory.
//! define HAS_FIBRES
//! define HAS_VISCOSITY
//! define MOVES_STRESSES

shared int force_x[SLOTS], force_y[SLOTS], force_z[SLOTS];  // units of a sixth mN over scale

void clear_force(uint i) {
    force_x[i] = 0;
    force_y[i] = 0;
    force_z[i] = 0;
}

int sums_before;  // see no_sum

void add_force(uint i, ivec3 f) {
    sums_before |= atomicAdd(force_x[i], f.x);
    sums_before |= atomicAdd(force_y[i], f.y);
    sums_before |= atomicAdd(force_z[i], f.z);
}

/// mN; `unit` is force_unit of the scale.
vec3 force_here(uint i, float unit) { return unit * vec3(force_x[i], force_y[i], force_z[i]); }
float force_unit(float scale) { return 1.0 / (6.0 * scale); }

/// What a fan leaves on its nodes.
struct Tally {
    float scale;
    uint largest;
    ivec3 sum;
};

void leave_force(uint i, vec3 f, inout Tally tally) {
    tally.largest = max(tally.largest, floatBitsToUint(abs(f.x) + abs(f.y) + abs(f.z)));  // NaN is the largest
    ivec3 units = ivec3(roundEven(f * tally.scale));
    tally.sum += units;
    add_force(i, units);
}

#if HAS_FIBRES || HAS_VISCOSITY
/// What the next tetrahedron of a fan has for itself is fetched well before it is needed.
void next_tetrahedron() {
    next_place();
#if HAS_FIBRES
    fetch_fibre();
#endif
#if HAS_VISCOSITY
    fetch_viscous_stress();
#endif
}
#endif

/// P of a tetrahedron.
mat3 stress_of_tetrahedron(Edges t, Parameters parameters, Pressure pressure) {
    mat3 G = mat3(t.moved_b, t.moved_c, t.moved_d);
    mat3 N = mat3(t.normal_b, t.normal_c, t.normal_d);
    Deformation d = deformation((G * transpose(N)) * reciprocal(dot(t.rest_b, t.normal_b)));
    float p = pressure_of(pressure, d.volume_change);
#if MOVES_STRESSES
    return relaxed_stress(d, stress(0u, d, parameters, 0.0), p);
#elif HAS_VISCOSITY
    return rested_stress(d, stress(0u, d, parameters, p));
#else
    return first_piola_kirchhoff(d, stress(0u, d, parameters, p));
#endif
}

/// Six times the forces of a fan's nodes; the force on a is minus the sum of the others, to the unit.
void add_fan(uvec4 fan, Parameters parameters, Patch here, inout Tally tally) {
    uint a = fan.x & 0xffffu, b = fan.x >> 16u, c = fan.y & 0xffffu;
    Node node_of_a = node(a);
    Edges t = first_edges(node_of_a, node(b), node(c));
    Pressure pressure = first_pressure(here, a, b, c);
    vec3 force_b = vec3(0.0);
    vec3 force_c = vec3(0.0);
    tally.sum = ivec3(0);
    for (Ring ring = ring_of(fan); ring.next != no_node; ring = next_of_ring(ring)) {
#if HAS_FIBRES || HAS_VISCOSITY
        next_tetrahedron();
#endif
        t = next_edges(t, node_of_a, node(ring.next));
        take_next_node(pressure, ring.next);
        mat3 P = stress_of_tetrahedron(t, parameters, pressure);
        force_b = multiply_add(P, t.normal_b, force_b);
        leave_force(c, multiply_add(P, t.normal_c, force_c), tally);
        force_c = P * t.normal_d;
        c = ring.next;
    }
    leave_force(c, force_c, tally);
    leave_force(b, force_b, tally);
    add_force(a, -tally.sum);
}

/// Forces of all fans in units of scale, which is changed when they do not fit; true where they are numbers. `first` is
/// fan_of(here, lane); each further one is fetched while the one before is computed. Ends with all of them in place.
bool compute_forces(Patch here, uvec4 first, Parameters parameters, inout float scale, out uint largest) {
    uint lane = gl_LocalInvocationID.x;
#if MOVES_STRESSES
    advance_stresses(here.material);
#endif
    for (;;) {
        Tally tally = Tally(scale, 0u, ivec3(0));
        sums_before = 0;
        uvec4 fan = first;
        for (uint f = lane; f < here.fans; f += WORKGROUP_SIZE) {
            uvec4 next = fan_of(here, f + WORKGROUP_SIZE);
#if HAS_FIBRES || HAS_VISCOSITY
            begin_fan(here, f);
#endif
            add_fan(fan, parameters, here, tally);
            fan = next;
        }
        atomicMax(largest_of_patch, tally.largest | no_sum(sums_before));
        barrier();
        largest = largest_of_patch;
        if (!countable(largest)) return false;
        if (fits(largest, scale)) return true;
        scale = scale_for(largest);
#if MOVES_STRESSES
        hold_stresses();
#endif
        barrier();
        for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) clear_force(i);
        if (lane == 0u) largest_of_patch = 0u;
        barrier();
    }
}
