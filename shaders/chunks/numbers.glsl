// Gives: what float32 needs care for.

/// Looks at the bits, because compilers may assume that no NaN occurs.
bool is_finite(float x) { return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u; }
bool is_finite(vec3 x) { return is_finite(x.x) && is_finite(x.y) && is_finite(x.z); }

float not_a_number() { return uintBitsToFloat(0x7fc00000u); }

/// b + A x, in multiply-adds alone.
vec3 multiply_add(mat3 A, vec3 x, vec3 b) { return b + x.x * A[0] + x.y * A[1] + x.z * A[2]; }

/// 1 / x to the last place or so: a device's own may be off by 2.5, always to one side, which adds up over many steps.
float reciprocal(float x) {
    float inverse = 1.0 / x;
    return fma(fma(-x, inverse, 1.0), inverse, inverse);
}

/// ln(1 + x) to a few units of the last place, NaN for x <= -1. GLSL's log() is only good to 2⁻²¹ absolutely near 1, which
/// the large volumetric modulus turns into noise; near 1 use ln(1 + x) = 2 artanh(x / (2 + x)), whose terms past s¹³ are
/// below 2e-8 of the sum for |x| <= 1/2.
float log_one_plus(float x) {
    float s = x * reciprocal(2.0 + x);
    float s2 = s * s;
    float series = 1.0 / 13.0;
    series = series * s2 + 1.0 / 11.0;
    series = series * s2 + 1.0 / 9.0;
    series = series * s2 + 1.0 / 7.0;
    series = series * s2 + 1.0 / 5.0;
    series = series * s2 + 1.0 / 3.0;
    float near = 2.0 * s + 2.0 * s * s2 * series;
    float far = x > -1.0 ? log(1.0 + x) : not_a_number();
    return abs(x) > 0.5 ? far : near;
}

/// exp(x) - 1 to a few units of the last place; the series' terms past x⁷ are below 1e-8 of the sum for |x| <= 1/4.
float exp_minus_one(float x) {
    if (abs(x) > 0.25) return exp(x) - 1.0;
    float series = 1.0 / 5040.0;
    series = series * x + 1.0 / 720.0;
    series = series * x + 1.0 / 120.0;
    series = series * x + 1.0 / 24.0;
    series = series * x + 1.0 / 6.0;
    series = series * x + 0.5;
    return x + x * x * series;
}
