// Needs: node.contact; node.turning where its flag is 1.
// Gives: settle(a, constrained, u, v): after a step has brought node a to u by v, contact with all obstacles in turn.
//! define HAS_TURNING

/// Constrained components stay where they are.
void settle(uint a, bvec3 constrained, inout vec3 u, inout vec3 v) {
    uint place = place_in_contact(a);
    if (place == 0u) return;
    vec3 X = contact_vector(place);
    vec3 settled_u = u;
    vec3 settled_v = v;
    for (uint o = 0u; o < obstacle_count(); ++o) {
        uint obstacle = place_of_obstacle(o);
        Tangent tangent = tangent_at(obstacle, X + settled_u);
        if (!(tangent.height < 0.0)) continue;
        vec3 slip = settled_v - increment_of(obstacle);
#if HAS_TURNING
        slip -= turn_of(obstacle, X + settled_u);
#endif
        vec3 correction = contact_correction(tangent.normal, -tangent.height, friction_of(obstacle), slip);
        settled_u += correction;
        settled_v += correction;
    }
    u = mix(settled_u, u, constrained);
    v = mix(settled_v, v, constrained);
}
