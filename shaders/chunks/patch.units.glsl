// Needs: patch.
// Gives: sums of a patch as integers, which add up to the same in any order. Their unit is a power of two such that
// `contributions` of the largest summand fit into 32 bits: about 2⁻²⁴ of that summand. It follows from the largest of the step
// before; when the summands have outgrown it, the patch adds them again.

shared uint largest_of_patch;

/// The unit is 1 / scale.
float scale_for(uint largest) {
    uint exponent = floatBitsToUint(uintBitsToFloat(largest) * (2.0 * contributions)) >> 23u;  // biased
    // 2²⁹ over the power of two below; at most 2¹¹⁷, whose multiples and their reciprocals are still normal numbers.
    return uintBitsToFloat(clamp(283u - exponent, 1u, 244u) << 23u);
}

bool fits(uint largest, float scale) { return (uintBitsToFloat(largest) * contributions) * scale < 2.1e9; }

/// 0, of the bits of all sums that an invocation found before its additions: -2³¹ alone is none that fits. Something has to look at what
/// atomicAdd returns: else NVIDIA's compiler (driver 580) sums within a warp first, comparing all addresses and branching at
/// each addition, which costs a twentieth of a step.
uint no_sum(int before) { return before == int(0x80000000u) ? 1u : 0u; }

/// Summands beyond are as good as infinite: their sums would not fit whatever the unit.
bool countable(uint largest) { return largest < floatBitsToUint(1e30); }
