// Gives: what voxels add to the mean difference of descriptors of self-similarity, and that mean
// (registration/matching/ultrasound/structure_costs.hpp).
// Needs: match.echo.

/// Σ w and Σ w d over a window: w what both show, d the mean difference of descriptors.
const int sum_count = 2;

/// Twelve channels of eight bits; the last word is 0.
layout(std430, binding = BINDING_ECHO_FIXED) readonly buffer EchoFixed { uvec4 seen_words[]; };
layout(std430, binding = BINDING_ECHO_MOVING) readonly buffer EchoMoving { uvec4 moving_words[]; };
layout(std430, binding = BINDING_ECHO_SHOWN) readonly buffer EchoShown { float shown[]; };

uint difference_of_words(uint a, uint b) {
    ivec4 d = abs(ivec4(uvec4(a, a >> 8, a >> 16, a >> 24) & 0xffu) - ivec4(uvec4(b, b >> 8, b >> 16, b >> 24) & 0xffu));
    return uint(d.x + d.y + d.z + d.w);
}

void add(int n, int from, inout float sums[sum_count]) {
    if (shown[from] == 0.0) return;
    uvec4 a = seen_words[n], b = moving_words[from];
    uint sum = difference_of_words(a.x, b.x) + difference_of_words(a.y, b.y) + difference_of_words(a.z, b.z);
    const float most = 255.0 * 12.0;
    sums[0] += 1.0;
    sums[1] += float(sum) / most;
}

float cost(float s[sum_count]) { return s[1] / s[0]; }
