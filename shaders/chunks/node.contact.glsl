// Effect: contact with rigid bodies, given by samples of their signed distance. Needs: bindings.
// Gives: tangent_at(obstacle, x): the plane that stands for an obstacle's surface near x, as far as it does;
// contact_correction: what puts a node back onto it and takes the velocity towards it, and up to friction times as much of
// that along it; place_in_contact(a). Residuals do not know of contact, so Rayleigh quotients of a step in contact are off.

layout(location = 15) uniform float time_step;  // s

/// Words, floats by their bits: the number of obstacles; obstacles; of each node the place of its rest position, 0 where it
/// touches nothing; rest positions, mm, from a point near all of them; samples.
layout(std430, binding = BINDING_CONTACT) readonly buffer Contact { uint contact[]; };

const uint obstacle_words = 26u;  // rows of the map from mm to steps of the samples, 1/mm; place of sample (0, 0, 0), mm from
                                  // the same point; size; the first sample; reach of the interpolation, mm; friction; the
                                  // inverse of the largest steepness; reach of a tangent, mm; velocity at the common
                                  // point, mm/s; spin, rad/s

float contact_number(uint at) { return uintBitsToFloat(contact[at]); }
vec3 contact_vector(uint at) { return vec3(contact_number(at), contact_number(at + 1u), contact_number(at + 2u)); }

uint obstacle_count() { return contact[0]; }
uint place_of_obstacle(uint o) { return 1u + obstacle_words * o; }
/// 0 where node a touches nothing.
uint place_in_contact(uint a) { return contact[place_of_obstacle(obstacle_count()) + a]; }
float friction_of(uint obstacle) { return contact_number(obstacle + 17u); }
/// How far the obstacle itself goes in a step at the common point, and everywhere where it does not turn, mm.
vec3 increment_of(uint obstacle) { return time_step * contact_vector(obstacle + 20u); }

/// Weights of the four samples about a point a fraction t past the second, and their derivatives (Keys 1981, eq. 15 with
/// a = -1/2).
vec4 cubic_weights(float t) {
    return vec4(((-0.5 * t + 1.0) * t - 0.5) * t, (1.5 * t - 2.5) * t * t + 1.0, ((-1.5 * t + 2.0) * t + 0.5) * t,
                (0.5 * t - 0.5) * t * t);
}
vec4 cubic_slopes(float t) {
    return vec4((-1.5 * t + 2.0) * t - 0.5, (4.5 * t - 5.0) * t, (-4.5 * t + 4.0) * t + 0.5, (1.5 * t - 1.0) * t);
}

vec4 row_of_samples(uint at) { return vec4(contact_vector(at), contact_number(at + 3u)); }

/// Four rows of samples weighed with y: value, slopes along x and y.
vec3 layer_of_samples(uint at, uint row, vec4 x, vec4 slope_x, vec4 y, vec4 slope_y) {
    mat4 d = mat4(row_of_samples(at), row_of_samples(at + row), row_of_samples(at + 2u * row), row_of_samples(at + 3u * row));
    vec4 along = x * d;
    return vec3(dot(along, y), dot(slope_x * d, y), dot(along, slope_y));
}

/// Distance, mm, and its derivatives by steps of the samples, at a fraction t past the sample at `first` and one step along
/// each axis; `row` and `layer` are how many samples these hold.
vec4 cubic_distance(vec3 t, uint first, uint row, uint layer) {
    vec4 x = cubic_weights(t.x), y = cubic_weights(t.y), z = cubic_weights(t.z);
    vec4 slope_x = cubic_slopes(t.x), slope_y = cubic_slopes(t.y), slope_z = cubic_slopes(t.z);
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < 4u; ++k) {
        vec3 of_layer = layer_of_samples(first + k * layer, row, x, slope_x, y, slope_y);
        sum += vec4(z[k] * of_layer, slope_z[k] * of_layer.x);
    }
    return sum;
}

/// Nearer than `reach` to where it was taken, a node is outside the obstacle if it is above the plane, and inside by its
/// depth below it; mm.
struct Tangent {
    vec3 normal;
    float height, reach;
};

/// `x` is a position from the common point.
Tangent tangent_at(uint obstacle, vec3 x) {
    Tangent away = Tangent(vec3(0.0), 1.0, 0.0);
    vec3 row_i = contact_vector(obstacle);
    vec3 row_j = contact_vector(obstacle + 3u);
    vec3 row_k = contact_vector(obstacle + 6u);
    vec3 from_first = x - contact_vector(obstacle + 9u);
    vec3 at = vec3(dot(row_i, from_first), dot(row_j, from_first), dot(row_k, from_first));
    uint row = contact[obstacle + 12u];
    uint layer = row * contact[obstacle + 13u];
    ivec3 last = ivec3(row, contact[obstacle + 13u], contact[obstacle + 14u]) - 3;
    // Integers, because comparisons with NaN may be compiled away. Outside of a grid it must look again at once, because
    // the border may lie inside the obstacle.
    ivec3 corner = ivec3(floor(at));
    if (any(lessThan(corner, ivec3(1))) || any(greaterThan(corner, last))) return away;
    // Of one sample alone: what is further away than the interpolation can reach needs no more.
    uint samples = contact[obstacle + 15u];
    uvec3 nearest = uvec3(floor(at + 0.5));
    float least = contact_number(samples + nearest.x + row * nearest.y + layer * nearest.z) - contact_number(obstacle + 16u);
    if (least > 0.0) {
        away.reach = least * contact_number(obstacle + 18u);
        return away;
    }
    uvec3 first = uvec3(corner - 1);
    vec4 d = cubic_distance(at - vec3(corner), samples + first.x + row * first.y + layer * first.z, row, layer);
    vec3 gradient = d.y * row_i + d.z * row_j + d.w * row_k;
    float steepness = length(gradient);
    if (!(steepness > 0.0)) return away;
    return Tangent(gradient / steepness, d.x / steepness,
                   max(d.x * contact_number(obstacle + 18u), contact_number(obstacle + 19u)));
}

/// What an obstacle adds to displacement and increment of a node so deep below its tangent, mm; v is the increment less
/// that of the obstacle.
vec3 contact_correction(vec3 normal, float depth, float friction, vec3 v) {
    vec3 slip = v - dot(normal, v) * normal;
    float slip_length = length(slip);
    vec3 correction = depth * normal;
    if (slip_length > 0.0) correction -= min(1.0, friction * depth / slip_length) * slip;
    return correction;
}
