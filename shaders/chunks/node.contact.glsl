// Effect: contact with rigid bodies, given by samples of their signed distance. Needs: bindings.
// Gives: settle(a, constrained, u, v): after a step has brought node a to u by v, all obstacles in turn put it back onto their
// surface and take the velocity towards it, and up to friction times as much of that along it. Residuals do not know of it,
// so Rayleigh quotients of a step in contact are off.

/// Words, floats by their bits: the number of obstacles, the place of the first; of each node the place of its rest position,
/// 0 where it touches nothing; rest positions, mm, from a point near all of them; obstacles; samples.
layout(std430, binding = BINDING_CONTACT) readonly buffer Contact { uint contact[]; };

const uint obstacle_words = 18u;  // rows of the map from mm to steps of the samples, 1/mm; place of sample (0, 0, 0), mm from
                                  // the same point; size; the first sample; reach, mm; friction

float contact_number(uint at) { return uintBitsToFloat(contact[at]); }
vec3 contact_vector(uint at) { return vec3(contact_number(at), contact_number(at + 1u), contact_number(at + 2u)); }

/// Weights of the four samples about a point a fraction t past the second, and their derivatives (Keys 1981, eq. 15 with
/// a = -1/2).
vec4 cubic_weights(float t) {
    return vec4(((-0.5 * t + 1.0) * t - 0.5) * t, (1.5 * t - 2.5) * t * t + 1.0, ((-1.5 * t + 2.0) * t + 0.5) * t,
                (0.5 * t - 0.5) * t * t);
}
vec4 cubic_slopes(float t) {
    return vec4((-1.5 * t + 2.0) * t - 0.5, (4.5 * t - 5.0) * t, (-4.5 * t + 4.0) * t + 0.5, (1.5 * t - 1.0) * t);
}

/// Distance, mm, and its derivatives by steps of the samples, at a fraction t past the sample at `first` and one step along
/// each axis; `row` and `layer` are how many samples these hold.
vec4 cubic_distance(vec3 t, uint first, uint row, uint layer) {
    vec4 x = cubic_weights(t.x), y = cubic_weights(t.y), z = cubic_weights(t.z);
    vec4 slope_x = cubic_slopes(t.x), slope_y = cubic_slopes(t.y), slope_z = cubic_slopes(t.z);
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < 4u; ++k)
        for (uint j = 0u; j < 4u; ++j) {
            uint at = first + j * row + k * layer;
            vec4 d = vec4(contact_vector(at), contact_number(at + 3u));
            float along = dot(x, d);
            sum += vec4(along * y[j] * z[k], dot(slope_x, d) * y[j] * z[k], along * slope_y[j] * z[k],
                        along * y[j] * slope_z[k]);
        }
    return sum;
}

/// What an obstacle adds to displacement and increment of a node at a position from the common point.
vec3 contact_correction(uint obstacle, vec3 position, vec3 v) {
    vec3 row_i = contact_vector(obstacle);
    vec3 row_j = contact_vector(obstacle + 3u);
    vec3 row_k = contact_vector(obstacle + 6u);
    vec3 from_first = position - contact_vector(obstacle + 9u);
    vec3 at = vec3(dot(row_i, from_first), dot(row_j, from_first), dot(row_k, from_first));
    uint row = contact[obstacle + 12u];
    uint layer = row * contact[obstacle + 13u];
    ivec3 last = ivec3(row, contact[obstacle + 13u], contact[obstacle + 14u]) - 3;
    // Integers, because comparisons with NaN may be compiled away.
    ivec3 corner = ivec3(floor(at));
    if (any(lessThan(corner, ivec3(1))) || any(greaterThan(corner, last))) return vec3(0.0);
    // Of one sample alone: what is further away than the interpolation can reach needs no more.
    uint samples = contact[obstacle + 15u];
    uvec3 nearest = uvec3(floor(at + 0.5));
    if (contact_number(samples + nearest.x + row * nearest.y + layer * nearest.z) > contact_number(obstacle + 16u))
        return vec3(0.0);
    uvec3 first = uvec3(corner - 1);
    vec4 d = cubic_distance(at - vec3(corner), samples + first.x + row * first.y + layer * first.z, row, layer);
    vec3 gradient = d.y * row_i + d.z * row_j + d.w * row_k;
    float steepness = length(gradient);
    if (!(d.x < 0.0 && steepness > 0.0)) return vec3(0.0);
    vec3 normal = gradient / steepness;
    float depth = -d.x / steepness;
    vec3 slip = v - dot(normal, v) * normal;
    float slip_length = length(slip);
    vec3 correction = depth * normal;
    if (slip_length > 0.0) correction -= min(1.0, contact_number(obstacle + 17u) * depth / slip_length) * slip;
    return correction;
}

/// Constrained components stay where they are.
void settle(uint a, bvec3 constrained, inout vec3 u, inout vec3 v) {
    uint place = contact[2u + a];
    if (place == 0u) return;
    vec3 X = contact_vector(place);
    vec3 settled_u = u;
    vec3 settled_v = v;
    uint end = contact[1] + contact[0] * obstacle_words;
    for (uint obstacle = contact[1]; obstacle < end; obstacle += obstacle_words) {
        vec3 correction = contact_correction(obstacle, X + settled_u, settled_v);
        settled_u += correction;
        settled_v += correction;
    }
    u = mix(settled_u, u, constrained);
    v = mix(settled_v, v, constrained);
}
