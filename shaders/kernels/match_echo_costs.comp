// One invocation per shift and place, which is a brick: the window about it along i, of sums that are windows along k and
// j; and its cost, 1e30 where the moving image shows too little of what the ultrasound does.
// Needs: index, match, match.echo, match.echo.linear or match.echo.structure.

layout(std430, binding = BINDING_ECHO_SOURCE) readonly buffer EchoSource { float source[]; };
/// The bricks that are places, ascending.
layout(std430, binding = BINDING_ECHO_PLACES) readonly buffer EchoPlaces { uint place_brick[]; };
/// Of the window about each place, what the ultrasound shows.
layout(std430, binding = BINDING_ECHO_SHARES) readonly buffer EchoShares { float window_share[]; };
/// Place by place, in each shift by shift.
layout(std430, binding = BINDING_ECHO_COSTS) writeonly buffer EchoCosts { float shift_cost[]; };

void main() {
    uint index = invocation_index(), shift = index / place_count, place = index - shift * place_count;
    if (shift >= shift_count) return;
    ivec2 window = window_of(place_brick[place], 0u);
    int offset = sum_offset(shift, place_brick[place]);
    float sums[sum_count];
    for (int s = 0; s < sum_count; ++s, offset += int(sum_stride())) {
        sums[s] = 0.0;
        for (int d = window.x; d <= window.y; ++d) sums[s] += brick_weight[d + window_radius] * source[offset + d];
    }
    const float nowhere = 1e30;
    bool lost = sums[0] < least_kept * window_share[place];
    shift_cost[place * shift_count + shift] = lost ? nowhere : cost(sums);
}
