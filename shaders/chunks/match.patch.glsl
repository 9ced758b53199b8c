// Gives: the Gaussian window of one voxel, from its centre on; the whole sums to 1.

const float patch_sum = 1.0 + 2.0 * (exp(-0.5) + exp(-2.0) + exp(-4.5) + exp(-8.0));
const float patch_window[5] =
    float[5](1.0 / patch_sum, exp(-0.5) / patch_sum, exp(-2.0) / patch_sum, exp(-4.5) / patch_sum, exp(-8.0) / patch_sum);
