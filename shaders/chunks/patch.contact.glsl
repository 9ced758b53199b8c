// Needs: node.contact, patch, patch.state, patch.node; node.turning where its flag is 1.
// Gives: early_tangent, settle: after a step has brought slot s to u by v, contact with all obstacles in
// turn. It looks at samples only where the slot has left the reach of the tangent that it keeps.
//! define STAYS
//! define HAS_TURNING

layout(location = 14) uniform uint obstacles;

/// Planes of PatchState from 6 on, for each obstacle: the square of the reach, mm², 0 where the slot has not looked yet,
/// `never` where it need not; displacement at the last look, normal and height of the tangent, mm.
const uint tangent_planes = 8u;
const float never = 1e30;

struct KeptTangent {
    float reach_squared;
    vec3 from, normal;
    float height;
};

KeptTangent kept_tangent(uint s, uint o) {
    uint plane = 6u + tangent_planes * o;
    return KeptTangent(state_number(s, plane), state_plane(s, plane + 1u), state_plane(s, plane + 4u),
                       state_number(s, plane + 7u));
}

/// What is asked for before the force is known, of obstacle 0: all of it where a step waits for memory, the reach where it
/// waits for the amount of memory, since most nodes keep nothing else.
KeptTangent early_tangent(uint s) {
#if STAYS
    return kept_tangent(s, 0u);
#else
    return KeptTangent(state_number(s, 6u), vec3(0.0), vec3(0.0), 0.0);
#endif
}

void keep_tangent(uint s, uint o, KeptTangent tangent) {
    uint plane = 6u + tangent_planes * o;
    store_state_number(s, plane, tangent.reach_squared);
    store_state(s, plane + 1u, tangent.from);
    store_state(s, plane + 4u, tangent.normal);
    store_state_number(s, plane + 7u, tangent.height);
}

KeptTangent look(uint s, uint o, vec3 u) {
    uint place = place_in_contact(node_of_slot[s]);
    KeptTangent kept = KeptTangent(never, vec3(0.0), vec3(0.0), 0.0);
    if (place != 0u) {
        Tangent tangent = tangent_at(place_of_obstacle(o), contact_vector(place) + u);
        kept = KeptTangent(tangent.reach * tangent.reach, u, tangent.normal, tangent.height);
    }
    keep_tangent(s, o, kept);
    return kept;
}

/// `tangent` is what was asked for early. Constrained components stay where they are.
void settle(uint s, bvec3 constrained, KeptTangent tangent, inout vec3 u, inout vec3 v) {
    if (tangent.reach_squared == never) return;
#if !STAYS
    tangent = kept_tangent(s, 0u);
#endif
    vec3 settled_u = u;
    vec3 settled_v = v;
    for (uint o = 0u; o < obstacles; ++o) {
        if (o > 0u) tangent = kept_tangent(s, o);
        vec3 way = settled_u - tangent.from;
        if (!(dot(way, way) < tangent.reach_squared)) {
            tangent = look(s, o, settled_u);
            way = vec3(0.0);
        }
        float depth = -(tangent.height + dot(tangent.normal, way));
        if (!(depth > 0.0)) continue;
        uint obstacle = place_of_obstacle(o);
        vec3 slip = settled_v - increment_of(obstacle);
#if HAS_TURNING
        slip -= turn_of(obstacle, contact_vector(place_in_contact(node_of_slot[s])) + settled_u);
#endif
        vec3 correction = contact_correction(tangent.normal, depth, friction_of(obstacle), slip);
        settled_u += correction;
        settled_v += correction;
    }
    u = mix(settled_u, u, constrained);
    v = mix(settled_v, v, constrained);
}
