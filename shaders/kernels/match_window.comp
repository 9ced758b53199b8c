// One invocation per cell and sum: the sums of match_forces spread along an axis, (1, 4, 6, 4, 1)/16 of cells beside each
// other; along i first, which reads integers.
// Needs: index, match, match.cells.

layout(location = 0) uniform uint axis;

layout(std430, binding = BINDING_MATCH_SOURCE) readonly buffer MatchSpreadSource { float source[]; };
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchSpreadTarget { float target[]; };

float sum_at(uint cell, uint sum) {
    return axis == 0u ? float(cell_sum[CELL_SUMS * cell + sum]) : source[SPREAD_SUMS * cell + sum];
}

void main() {
    uint index = invocation_index(), cell = index / SPREAD_SUMS, sum = index % SPREAD_SUMS;
    if (cell >= cell_total()) return;
    const float weights[3] = float[3](6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0);
    uint at = cell_of(cell)[axis], stride = uvec3(1u, cell_count.x, cell_count.x * cell_count.y)[axis];
    float result = weights[0] * sum_at(cell, sum);
    for (uint away = 1u; away <= 2u; ++away) {
        if (at >= away) result += weights[away] * sum_at(cell - away * stride, sum);
        if (at + away < cell_count[axis]) result += weights[away] * sum_at(cell + away * stride, sum);
    }
    target[index] = result;
}
