// One invocation per cell: shift and information from the sums of its window (docs/method.md, section 11), the same as
// forces_of() finds with double precision (registration/matching/dense/dense_cells.cpp), along the axes of the grid.
// Needs: index, match, match.cells.

// DenseForceRules of registration/matching/dense/dense_cells.hpp.
layout(location = 0) uniform float independent_share;
layout(location = 1) uniform float least_square;
layout(location = 2) uniform float least_deviation;
layout(location = 3) uniform float leakage;
layout(location = 4) uniform float most_shift;

layout(std430, binding = BINDING_MATCH_SOURCE) readonly buffer MatchWindows { float spread[]; };

/// As registration/matching/gpu/gpu_match_layout.hpp has it: MatchForce.
struct Force {
    int voxels, place[3];    // of the cell that count, and the sum of their places in it
    int alike, structure;   // Σ g1·g2 and Σ |g1|² + |g2|² over them
    uint said;               // 1 where there is a force
    float shift[3];          // voxels
    float root[9];           // 1/voxel: three vectors r, the information is the sum of r rᵀ
};
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchForces { Force force[]; };

const float channel_count = 12.0;

/// Sums over the voxels of a window, steps of the descriptors' eight bits and voxels.
struct Window {
    mat3 normal;           // A
    vec3 right;            // b
    float squares, voxels;
};

vec3 spread_at(uint n) { return vec3(spread[n], spread[n + 1u], spread[n + 2u]); }

/// What D2 = D1 - (D1, 1) c explains, c the same for all channels, is taken out.
Window window_of(uint cell) {
    uint n = SPREAD_SUMS * cell;
    vec3 diagonal = spread_at(n) / 4.0, mixed = spread_at(n + 3u) / 8.0;
    mat3 normal = mat3(diagonal.x, mixed.x, mixed.y, mixed.x, diagonal.y, mixed.z, mixed.y, mixed.z, diagonal.z);
    mat2x3 slopes = mat2x3(spread_at(n + 11u), spread_at(n + 14u)) / 4.0;
    float first_squares = spread[n + 17u], first = spread[n + 18u], voxels = spread[n + VOXELS];
    vec2 residuals = vec2(spread[n + 19u], spread[n + 20u]);
    float samples = channel_count * voxels;
    mat2 scale = inverse(mat2(first_squares + least_square * samples, first, first, samples));
    return Window(normal - slopes * scale * transpose(slopes), spread_at(n + 6u) / 4.0 - slopes * (scale * residuals),
                  spread[n + 10u] - dot(residuals, scale * residuals), voxels);
}

/// Turns axes p and q so that A has no entry (p, q) any more.
void turn(inout mat3 A, inout mat3 axes, int p, int q) {
    if (A[p][q] == 0.0) return;
    float half_gap = 0.5 * (A[q][q] - A[p][p]) / A[p][q];
    float tangent = (half_gap < 0.0 ? -1.0 : 1.0) / (abs(half_gap) + sqrt(half_gap * half_gap + 1.0));
    float cosine = inversesqrt(tangent * tangent + 1.0), sine = tangent * cosine;
    mat3 rotation = mat3(1.0);
    rotation[p][p] = rotation[q][q] = cosine;
    rotation[q][p] = sine;
    rotation[p][q] = -sine;
    A = transpose(rotation) * A * rotation;
    axes = axes * rotation;
}

/// Leaves the eigenvectors of a symmetric A as columns, and returns its eigenvalues, in no order (Jacobi 1846).
vec3 eigenvalues(mat3 A, out mat3 axes) {
    axes = mat3(1.0);
    for (int sweep = 0; sweep < 5; ++sweep) {
        turn(A, axes, 0, 1);
        turn(A, axes, 0, 2);
        turn(A, axes, 1, 2);
    }
    return vec3(A[0][0], A[1][1], A[2][2]);
}

/// Leaves the force, its information as columns r of which it is the sum of r rᵀ: that has no negative eigenvalue, which
/// its own entries, rounded, may have. False where there is none.
bool solve(Window window, out vec3 shift, out mat3 root) {
    mat3 axes;
    vec3 strength = eigenvalues(window.normal, axes), along = transpose(axes) * window.right;
    float strongest = max(strength.x, max(strength.y, strength.z));
    float variance = max(window.squares / window.voxels, channel_count * least_square);
    vec3 raw = max(independent_share / variance * (strength - leakage * strongest), 0.0);
    shift = vec3(0.0);
    root = mat3(0.0);
    for (int n = 0; n < 3; ++n)
        if (raw[n] > 0.0) {
            shift += along[n] / strength[n] * axes[n];
            root[n] = sqrt(raw[n] / (1.0 + raw[n] * least_deviation * least_deviation)) * axes[n];
        }
    shift *= min(1.0, most_shift / max(length(shift), 1e-30));
    return strongest > 0.0;
}

void main() {
    uint cell = invocation_index(), n = CELL_SUMS * cell;
    if (cell >= cell_total()) return;
    force[cell].voxels = cell_sum[n + VOXELS];
    force[cell].said = 0u;
    if (cell_sum[n + VOXELS] == 0) return;  // the rest is not read
    vec3 shift;
    mat3 root;
    bool said = solve(window_of(cell), shift, root);
    for (uint axis = 0u; axis < 3u; ++axis) {
        force[cell].place[axis] = cell_sum[n + VOXELS + 1u + axis];
        force[cell].shift[axis] = shift[axis];
        for (uint row = 0u; row < 3u; ++row) force[cell].root[3u * axis + row] = root[axis][row];
    }
    force[cell].alike = cell_sum[n] + cell_sum[n + 1u] + cell_sum[n + 2u];
    force[cell].structure = cell_sum[n + STRUCTURE];
    force[cell].said = said ? 1u : 0u;
}
