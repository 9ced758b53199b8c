#include "registration/field/continuation_grid.hpp"

#include "registration/field/continuation.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

constexpr ContinuationOptions options;

/// Calls visit(n) for the inner free nodes of one colour (0, 1) or of both (−1), in parallel.
template <class Visit>
void for_each_free(const ContinuationGrid& level, int colour, const Visit& visit) {
    tbb::parallel_for(1, level.size[2] - 1, [&](int k) {
        for (int j = 1; j < level.size[1] - 1; ++j) {
            const int first = colour < 0 ? 1 : 1 + (j + k + colour) % 2;
            for (int i = first; i < level.size[0] - 1; i += colour < 0 ? 1 : 2)
                if (const std::size_t n = level.at(i, j, k); !level.fixed[n]) visit(n);
        }
    });
}

/// 1 + (|∇u| / s)² at the free nodes, |∇u|² from the mean of the one-sided differences; averaged with the value before,
/// without which the alternation of weights and values oscillates.
void update_stiffness(ContinuationGrid& level) {
    const auto neighbours = level.neighbours();
    const float scale =
        static_cast<float>(0.5 / (level.spacing * level.spacing * options.stiffening * options.stiffening));
    level.stiffness.resize(level.value.size(), 0.0F);
    for_each_free(level, -1, [&](std::size_t n) {
        const Vec4* v = level.value.data() + n;
        const SurfaceLinks* links = level.links_at(n);
        Vec4 sum = Vec4::Zero();
        for (std::size_t e = 0; e < 6; ++e) {
            const bool cut = links && links->fraction[e] < 1.0F;
            const Vec4 difference =
                cut ? Vec4((links->value[e] - *v) / links->fraction[e]) : Vec4(v[neighbours[e]] - *v);
            sum += difference.square();
        }
        const float relative = scale * (sum[0] + sum[1] + sum[2]);
        const float wanted = 1.0F + relative;
        level.stiffness[n] = level.stiffness[n] > 0.0F ? 0.5F * (level.stiffness[n] + wanted) : wanted;
    });
}

/// One red-black sweep of successive over-relaxation; the border of the grid stays. An edge has the mean stiffness of
/// its ends, or of its free end.
void relax(ContinuationGrid& level, float omega) {
    const auto neighbours = level.neighbours();
    for (int colour = 0; colour < 2; ++colour) {
        for_each_free(level, colour, [&](std::size_t n) {
            const Vec4* v = level.value.data() + n;
            const float* stiffness = level.stiffness.data() + n;
            const SurfaceLinks* links = level.links_at(n);
            Vec4 sum = Vec4::Zero();
            float weights = 0.0F;
            for (std::size_t e = 0; e < 6; ++e) {
                const float other = stiffness[neighbours[e]];
                float weight = *stiffness + (other > 0.0F ? other : *stiffness);
                if (links && links->fraction[e] < 1.0F) {
                    weight /= links->fraction[e];
                    sum += weight * links->value[e];
                } else {
                    sum += weight * v[neighbours[e]];
                }
                weights += weight;
            }
            level.value[n] += omega * (sum / weights - *v);
        });
    }
}

ContinuationGrid coarsened(const ContinuationGrid& fine) {
    ContinuationGrid coarse({(fine.size[0] + 1) / 2, (fine.size[1] + 1) / 2, (fine.size[2] + 1) / 2},
                            2.0 * fine.spacing);
    for (int k = 0; k < coarse.size[2]; ++k)
        for (int j = 0; j < coarse.size[1]; ++j)
            for (int i = 0; i < coarse.size[0]; ++i) {
                const std::size_t from = fine.at(2 * i, 2 * j, 2 * k), to = coarse.at(i, j, k);
                coarse.fixed[to] = fine.fixed[from];
                coarse.value[to] = fine.value[from];
            }
    return coarse;
}

/// Free nodes of the fine grid from the coarse one, trilinear.
void prolong(const ContinuationGrid& coarse, ContinuationGrid& fine) {
    tbb::parallel_for(0, fine.size[2], [&](int k) {
        for (int j = 0; j < fine.size[1]; ++j) {
            for (int i = 0; i < fine.size[0]; ++i) {
                const std::size_t n = fine.at(i, j, k);
                if (fine.fixed[n]) continue;
                Vec4 sum = Vec4::Zero();
                for (int corner = 0; corner < 8; ++corner) {
                    const auto half = [&](int index, int bit, int axis) {
                        return std::min((index + (corner >> bit & 1)) / 2, coarse.size[axis] - 1);
                    };
                    sum += coarse.value[coarse.at(half(i, 0, 0), half(j, 1, 1), half(k, 2, 2))];
                }
                fine.value[n] = 0.125F * sum;
            }
        }
    });
}

}  // namespace

void solve(ContinuationGrid& level) {
    const bool coarsest = *std::min_element(level.size.begin(), level.size.end()) < options.coarsest_nodes;
    if (!coarsest) {
        ContinuationGrid coarse = coarsened(level);
        solve(coarse);
        prolong(coarse, level);
    }
    const int rounds = coarsest ? options.coarsest_rounds : options.rounds;
    for (int round = 0; round < rounds; ++round) {
        update_stiffness(level);
        for (int sweep = 0; sweep < options.sweeps; ++sweep) relax(level, options.relaxation);
    }
}

}  // namespace tissuewarp::registration::detail
