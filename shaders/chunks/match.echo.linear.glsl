// Gives: what voxels add to the share of echoes that no linear combination of intensity and gradient magnitude explains
// (LC2; Wein et al., MICCAI 2013; registration/matching/ultrasound/echo_costs.hpp), and that share.
// Needs: match.echo.

/// Σ w over a window of 1, m, g, m², g², m g, u, u m, u g, u²: w what both show, u echoes, m and g what explains them.
const int sum_count = 10;
const int W = 0, M = 1, G = 2, MM = 3, GG = 4, MG = 5, U = 6, UM = 7, UG = 8, UU = 9;

layout(std430, binding = BINDING_ECHO_FIXED) readonly buffer EchoFixed { float echo[]; };
/// Intensity, gradient magnitude, 1 where something is shown.
layout(std430, binding = BINDING_ECHO_MOVING) readonly buffer EchoMoving { vec4 explaining[]; };

void add(int n, int from, inout float sums[sum_count]) {
    vec4 moving = explaining[from];
    if (moving.z == 0.0) return;
    float u = echo[n], m = moving.x, g = moving.y;
    sums[W] += 1.0;
    sums[M] += m;
    sums[G] += g;
    sums[MM] += m * m;
    sums[GG] += g * g;
    sums[MG] += m * g;
    sums[U] += u;
    sums[UM] += u * m;
    sums[UG] += u * g;
    sums[UU] += u * u;
}

float cost(float s[sum_count]) {
    float w = s[W], u = s[U] / w, m = s[M] / w, g = s[G] / w;
    float variance = s[UU] / w - u * u;
    float mm = s[MM] / w - m * m + ridge, gg = s[GG] / w - g * g + ridge, mg = s[MG] / w - m * g;
    float um = s[UM] / w - u * m, ug = s[UG] / w - u * g;
    float explained = (um * um * gg - 2.0 * um * ug * mg + ug * ug * mm) / (mm * gg - mg * mg);
    return 1.0 - explained / max(variance, 1e-6);
}
