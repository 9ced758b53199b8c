// Gives: cells of voxels in a row, i fastest, and sums over the voxels of each (DescriptorProducts).
// Needs: match.

/// CELL_SUMS a cell, with g twice the central difference and r = D1 - D2: 3 of g1a g2a, 3 of g1a g2b + g1b g2a (ab = 01,
/// 02, 12), 3 of (g1a + g2a) r, |g1|² + |g2|², r², 3 of (g1a + g2a) D1, 3 of g1a + g2a, D1², D1, D1 r, r, voxels, 3 of the
/// voxels' places in the cell.
layout(std430, binding = BINDING_MATCH_CELLS) buffer MatchCells { int cell_sum[]; };

#define CELL_SUMS 25u
#define STRUCTURE 9u
#define VOXELS 21u
#define SPREAD_SUMS 22u  // all but the places

uint cell_total() { return cell_count.x * cell_count.y * cell_count.z; }

uvec3 cell_of(uint n) {
    uint row = n / cell_count.x;
    return uvec3(n - row * cell_count.x, row % cell_count.y, row / cell_count.y);
}
