// One workgroup per cell of CELL_SIDE voxels, one invocation per voxel: the products of a Gauss-Newton step of
// D2(x + shift) = D1(x) (docs/method.md, section 11), summed over the voxels that count and that the second image shows
// with their six neighbours. Integers, so that the order of the sums does not matter.
// Needs: index, match, match.cells. WORKGROUP_SIZE is CELL_SIDE cubed.
//! define CELL_SIDE

layout(std430, binding = BINDING_MATCH_DESCRIPTORS) readonly buffer MatchDescriptors { uint second[]; };
layout(std430, binding = BINDING_MATCH_SHOWN) readonly buffer MatchShown { uint shown[]; };
layout(std430, binding = BINDING_MATCH_MOVING) readonly buffer MatchMoving { uint first[]; };
/// Voxels in the mesh that the first image shows with their six neighbours.
layout(std430, binding = BINDING_MATCH_COUNTS) readonly buffer MatchCounts { uint counts[]; };
shared int lane[CELL_SUMS][WORKGROUP_SIZE];
shared uint counted;  // whether any voxel of the cell is

ivec4 channels(uint word) { return ivec4(uvec4(word, word >> 8, word >> 16, word >> 24) & 0xffu); }

int total(ivec4 a) { return a.x + a.y + a.z + a.w; }

int product(ivec4 a, ivec4 b) { return total(a * b); }

/// Four channels of a voxel and twice their central differences.
struct Described {
    ivec4 value, gradient[3];
};

Described first_at(uint n, uint part, uvec3 stride) {
    Described d;
    d.value = channels(first[3u * n + part]);
    for (int axis = 0; axis < 3; ++axis)
        d.gradient[axis] =
            channels(first[3u * (n + stride[axis]) + part]) - channels(first[3u * (n - stride[axis]) + part]);
    return d;
}

Described second_at(uint n, uint part, uvec3 stride) {
    Described d;
    d.value = channels(second[3u * n + part]);
    for (int axis = 0; axis < 3; ++axis)
        d.gradient[axis] =
            channels(second[3u * (n + stride[axis]) + part]) - channels(second[3u * (n - stride[axis]) + part]);
    return d;
}

bool is_shown(uint n, uvec3 stride) {
    return (shown[n] & shown[n - stride.x] & shown[n + stride.x] & shown[n - stride.y] & shown[n + stride.y] &
            shown[n - stride.z] & shown[n + stride.z]) != 0u;
}

int mixed(Described a, Described b, int p, int q) {
    return product(a.gradient[p], b.gradient[q]) + product(a.gradient[q], b.gradient[p]);
}

void add(Described a, Described b, inout int sums[CELL_SUMS]) {
    ivec4 residual = a.value - b.value;
    for (int p = 0; p < 3; ++p) {
        ivec4 both = a.gradient[p] + b.gradient[p];
        sums[p] += product(a.gradient[p], b.gradient[p]);
        sums[6 + p] += product(both, residual);
        sums[9] += product(a.gradient[p], a.gradient[p]) + product(b.gradient[p], b.gradient[p]);
        sums[11 + p] += product(both, a.value);
        sums[14 + p] += total(both);
    }
    sums[3] += mixed(a, b, 0, 1);
    sums[4] += mixed(a, b, 0, 2);
    sums[5] += mixed(a, b, 1, 2);
    sums[10] += product(residual, residual);
    sums[17] += product(a.value, a.value);
    sums[18] += total(a.value);
    sums[19] += product(a.value, residual);
    sums[20] += total(residual);
}

void main() {
    uint cell = invocation_index() / WORKGROUP_SIZE, local = gl_LocalInvocationID.x;
    int sums[CELL_SUMS];
    for (uint m = 0u; m < CELL_SUMS; ++m) sums[m] = 0;
    uvec3 place = uvec3(local % CELL_SIDE, local / CELL_SIDE % CELL_SIDE, local / (CELL_SIDE * CELL_SIDE));
    uvec3 voxel = 1u + CELL_SIDE * cell_of(cell) + place, size = grid_size();
    if (cell < cell_total() && all(lessThan(voxel + 1u, size))) {
        uint n = grid_offset(voxel);
        uvec3 stride = uvec3(1u, size.x, size.x * size.y);
        if (counts[n] != 0u && is_shown(n, stride)) {
            for (uint part = 0u; part < 3u; ++part) add(first_at(n, part, stride), second_at(n, part, stride), sums);
            sums[VOXELS] = 1;
            for (int axis = 0; axis < 3; ++axis) sums[VOXELS + 1u + uint(axis)] = int(place[axis]);
        }
    }
    for (uint m = 0u; m < CELL_SUMS; ++m) lane[m][local] = sums[m];
    if (local == 0u) counted = 0u;
    barrier();
    if (sums[VOXELS] != 0) counted = 1u;
    barrier();
    if (counted == 0u) {  // outside of the organ, as most are
        if (cell < cell_total() && local < CELL_SUMS) cell_sum[CELL_SUMS * cell + local] = 0;
        return;
    }
    for (uint half_size = WORKGROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
        if (local < half_size)
            for (uint m = 0u; m < CELL_SUMS; ++m) lane[m][local] += lane[m][local + half_size];
        barrier();
    }
    if (cell < cell_total() && local < CELL_SUMS) cell_sum[CELL_SUMS * cell + local] = lane[local][0];
}
