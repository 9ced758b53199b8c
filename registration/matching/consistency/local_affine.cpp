// Compiled for every instruction set, chosen at run time: a fit in each lane of the vectors.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "registration/matching/consistency/local_affine.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "registration/matching/consistency/local_affine.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::registration::detail {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t most_lanes = 8;
using Tag = hn::CappedTag<double, most_lanes>;
using Vec = hn::Vec<Tag>;
using Lanes = double[most_lanes];

HWY_INLINE Vec of(double value) {
    return hn::Set(Tag(), value);
}

/// A neighbour of each point.
struct Datum {
    HWY_ALIGN Lanes phi[3];           // ξ = (x − point)/radius
    HWY_ALIGN Lanes weight[6];        // W: 00 10 20 11 21 22
    HWY_ALIGN Lanes displacement[3];  // mm
    HWY_ALIGN Lanes pull[3];          // W times displacement
    HWY_ALIGN Lanes used;             // 1 or 0
    HWY_ALIGN Lanes squared_residual;
};

HWY_INLINE Vec load(const Lanes& lanes) {
    return hn::Load(Tag(), lanes);
}
HWY_INLINE void store(Vec value, Lanes& lanes) {
    hn::Store(value, Tag(), lanes);
}

HWY_INLINE Vec squared_length(const Lanes* x) {
    const Vec a = load(x[0]), b = load(x[1]), c = load(x[2]);
    return hn::MulAdd(a, a, hn::MulAdd(b, b, hn::Mul(c, c)));
}

/// y = W x for a symmetric W.
HWY_INLINE void multiply(const Lanes* W, Vec x0, Vec x1, Vec x2, Vec& y0, Vec& y1, Vec& y2) {
    const Vec w10 = load(W[1]), w20 = load(W[2]), w21 = load(W[4]);
    y0 = hn::MulAdd(load(W[0]), x0, hn::MulAdd(w10, x1, hn::Mul(w20, x2)));
    y1 = hn::MulAdd(w10, x0, hn::MulAdd(load(W[3]), x1, hn::Mul(w21, x2)));
    y2 = hn::MulAdd(w20, x0, hn::MulAdd(w21, x1, hn::Mul(load(W[5]), x2)));
}

/// d(x) = t + G ξ about as many points as a vector has lanes; unknowns column by column: t, then the columns of G.
class AffineFits {
public:
    /// Of the points from `first` on.
    void run(const ScatteredMotion& motion, const Eigen::Matrix3Xd& points,
             const std::vector<std::vector<int>>& neighbours, double trimmed_share, std::size_t first,
             std::size_t count, LocalMotion* result) {
        gather(motion, points, neighbours, first, count);
        for (std::size_t lane = 0; lane < most_lanes; ++lane)
            kept_[lane] = std::max(1.0, std::ceil((1 - trimmed_share) * neighbours_[lane]));
        scale();
        concentrate();
        HWY_ALIGN Lanes residual;
        store(hn::Sqrt(median_squared_residual()), residual);
        for (std::size_t lane = 0; lane < count; ++lane)
            result[first + lane] = {{unknown_[0][lane], unknown_[1][lane], unknown_[2][lane]}, residual[lane]};
    }

private:
    static constexpr int unknowns = 12;
    std::vector<Datum> data_;     // those of a lane first, then zeros
    HWY_ALIGN Lanes neighbours_;  // their number
    HWY_ALIGN Lanes kept_;        // of them, in the next fit
    HWY_ALIGN Lanes unknown_[unknowns];
    HWY_ALIGN Lanes matrix_[unknowns][unknowns];  // lower triangle; then its Cholesky factor, diagonal inverted

    void gather(const ScatteredMotion& motion, const Eigen::Matrix3Xd& points,
                const std::vector<std::vector<int>>& neighbours, std::size_t first, std::size_t count) {
        std::size_t most = 0;
        for (std::size_t lane = 0; lane < count; ++lane) most = std::max(most, neighbours[first + lane].size());
        data_.assign(most, Datum{});
        for (std::size_t lane = 0; lane < most_lanes; ++lane) neighbours_[lane] = 0;
        for (std::size_t lane = 0; lane < count; ++lane) {
            const std::vector<int>& others = neighbours[first + lane];
            const double* point = points.data() + 3 * (first + lane);
            neighbours_[lane] = double(others.size());
            for (std::size_t k = 0; k < others.size(); ++k) put(motion, others[k], point, lane, data_[k]);
        }
    }

    /// ξ is not divided by the radius yet.
    static void put(const ScatteredMotion& motion, int neighbour, const double* about, std::size_t lane, Datum& datum) {
        constexpr int lower[] = {0, 1, 2, 4, 5, 8};
        const auto column = 3 * static_cast<std::ptrdiff_t>(neighbour);
        const double *point = motion.points.data() + column, *displacement = motion.displacements.data() + column,
                     *W = motion.weights[static_cast<std::size_t>(neighbour)].data();
        for (int i = 0; i < 3; ++i) {
            datum.phi[i][lane] = point[i] - about[i];
            datum.displacement[i][lane] = displacement[i];
        }
        for (int n = 0; n < 6; ++n) datum.weight[n][lane] = W[lower[n]];
        datum.used[lane] = 1;
    }

    void scale() {
        Vec squared_radius = of(1e-12);
        for (const Datum& datum : data_) squared_radius = hn::Max(squared_radius, squared_length(datum.phi));
        const Vec inverse = hn::Div(of(1), hn::Sqrt(squared_radius));
        for (Datum& datum : data_) {
            for (Lanes& phi : datum.phi) store(hn::Mul(load(phi), inverse), phi);
            Vec x, y, z;
            multiply(datum.weight, load(datum.displacement[0]), load(datum.displacement[1]),
                     load(datum.displacement[2]), x, y, z);
            store(x, datum.pull[0]);
            store(y, datum.pull[1]);
            store(z, datum.pull[2]);
        }
    }

    /// Concentration steps until no lane uses others than before, where further ones change nothing.
    void concentrate() {
        constexpr int concentration_steps = LocalAffineOptions().concentration_steps;
        solve();
        for (int step = 0; step < concentration_steps; ++step) {
            find_residuals();
            if (!keep_lowest()) break;
            solve();
        }
    }

    void solve() {
        sum_up<0>();
        sum_up<1>();
        sum_up<2>();
        sum_up<3>();
        stiffen();
        factorise();
        substitute();
    }

    /// Block row `a` of the normal matrix Σ φ_a φ_b W, b ≤ a, and of the right side Σ φ_a W d, with φ = (1, ξ).
    template <int a>
    HWY_INLINE void sum_up() {
        Vec w[a + 1][6], right[3];
        for (auto& block : w)
            for (Vec& sum : block) sum = hn::Zero(Tag());
        for (Vec& sum : right) sum = hn::Zero(Tag());
        for (const Datum& datum : data_) {
            const Vec used = load(datum.used), own = a == 0 ? used : hn::Mul(used, load(datum.phi[a == 0 ? 0 : a - 1]));
            for (int i = 0; i < 3; ++i) right[i] = hn::MulAdd(own, load(datum.pull[i]), right[i]);
            for (int b = 0; b <= a; ++b) {
                const Vec both = b == 0 ? own : hn::Mul(own, load(datum.phi[b == 0 ? 0 : b - 1]));
                for (int n = 0; n < 6; ++n) w[b][n] = hn::MulAdd(both, load(datum.weight[n]), w[b][n]);
            }
        }
        constexpr int entry[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
        for (int i = 0; i < 3; ++i) {
            store(right[i], unknown_[3 * a + i]);
            for (int b = 0; b <= a; ++b)
                for (int j = 0; j < 3; ++j) store(w[b][entry[i][j]], matrix_[3 * a + i][3 * b + j]);
        }
    }

    /// A little stiffness against stretch keeps few or collinear neighbours from extrapolating.
    void stiffen() {
        const Vec trace = hn::Add(hn::Add(load(matrix_[0][0]), load(matrix_[1][1])), load(matrix_[2][2]));
        for (int i = 0; i < unknowns; ++i) {
            const Vec more = hn::MulAdd(
                trace, of((i < 3 ? LocalAffineOptions().shift_stiffness : LocalAffineOptions().stretch_stiffness) / 3),
                of(1e-12));
            store(hn::Add(load(matrix_[i][i]), more), matrix_[i][i]);
        }
    }

    void factorise() {
        for (int j = 0; j < unknowns; ++j) {
            const Vec inverse = hn::Div(of(1), hn::Sqrt(load(matrix_[j][j])));
            store(inverse, matrix_[j][j]);
            for (int i = j + 1; i < unknowns; ++i) {
                const Vec entry = hn::Mul(load(matrix_[i][j]), inverse);
                store(entry, matrix_[i][j]);
                for (int k = j + 1; k <= i; ++k)
                    store(hn::NegMulAdd(entry, load(matrix_[k][j]), load(matrix_[i][k])), matrix_[i][k]);
            }
        }
    }

    void substitute() {
        for (int j = 0; j < unknowns; ++j) {
            const Vec value = hn::Mul(load(unknown_[j]), load(matrix_[j][j]));
            store(value, unknown_[j]);
            for (int i = j + 1; i < unknowns; ++i)
                store(hn::NegMulAdd(load(matrix_[i][j]), value, load(unknown_[i])), unknown_[i]);
        }
        for (int j = unknowns - 1; j >= 0; --j) {
            const Vec value = hn::Mul(load(unknown_[j]), load(matrix_[j][j]));
            store(value, unknown_[j]);
            for (int i = 0; i < j; ++i)
                store(hn::NegMulAdd(load(matrix_[j][i]), value, load(unknown_[i])), unknown_[i]);
        }
    }

    /// Infinite where a lane has no such neighbour.
    void find_residuals() {
        double k = 0;
        for (Datum& datum : data_) {
            Vec e[3], w[3];
            for (int i = 0; i < 3; ++i) {
                e[i] = hn::Sub(load(unknown_[i]), load(datum.displacement[i]));
                for (int a = 0; a < 3; ++a) e[i] = hn::MulAdd(load(unknown_[3 + 3 * a + i]), load(datum.phi[a]), e[i]);
            }
            multiply(datum.weight, e[0], e[1], e[2], w[0], w[1], w[2]);
            const Vec squared = hn::MulAdd(e[0], w[0], hn::MulAdd(e[1], w[1], hn::Mul(e[2], w[2])));
            const auto none = hn::Ge(of(k++), load(neighbours_));
            store(hn::IfThenElse(none, of(std::numeric_limits<double>::infinity()), squared), datum.squared_residual);
        }
    }

    /// How many neighbours have lower residuals, or the same and come before.
    [[nodiscard]] HWY_INLINE Vec rank(std::size_t n) const {
        const Vec own = load(data_[n].squared_residual), one = of(1);
        Vec rank = hn::Zero(Tag());
        for (std::size_t k = 0; k < n; ++k)
            rank = hn::Add(rank, hn::IfThenElseZero(hn::Le(load(data_[k].squared_residual), own), one));
        for (std::size_t k = n + 1; k < data_.size(); ++k)
            rank = hn::Add(rank, hn::IfThenElseZero(hn::Lt(load(data_[k].squared_residual), own), one));
        return rank;
    }

    /// Returns whether these are others than before.
    bool keep_lowest() {
        const Vec kept = load(kept_);
        bool changed = false;
        for (std::size_t n = 0; n < data_.size(); ++n) {
            const Vec used = hn::IfThenElseZero(hn::Lt(rank(n), kept), of(1));
            changed |= !hn::AllTrue(Tag(), hn::Eq(used, load(data_[n].used)));
            store(used, data_[n].used);
        }
        return changed;
    }

    [[nodiscard]] Vec median_squared_residual() const {
        const Vec middle = hn::Floor(hn::Mul(load(neighbours_), of(0.5)));
        Vec median = hn::Zero(Tag());
        for (std::size_t n = 0; n < data_.size(); ++n)
            median = hn::IfThenElse(hn::Eq(rank(n), middle), load(data_[n].squared_residual), median);
        return hn::IfThenElseZero(hn::Gt(load(neighbours_), hn::Zero(Tag())), median);
    }
};

void fit(const ScatteredMotion& motion, const Eigen::Matrix3Xd& points, const std::vector<std::vector<int>>& neighbours,
         double trimmed_share, std::size_t first, std::size_t last, LocalMotion* result) {
    const std::size_t lanes = hn::Lanes(Tag());
    AffineFits fits;
    for (; first < last; first += lanes)
        fits.run(motion, points, neighbours, trimmed_share, first, std::min(lanes, last - first), result);
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::registration::detail
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tissuewarp::registration::detail {

HWY_EXPORT(fit);

std::vector<LocalMotion> fit_local_affine(const ScatteredMotion& motion, const Eigen::Matrix3Xd& points,
                                          const std::vector<std::vector<int>>& neighbours, double trimmed_share) {
    constexpr std::size_t at_once = 32;
    std::vector<LocalMotion> result(neighbours.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, result.size(), at_once), [&](const auto& range) {
        HWY_DYNAMIC_DISPATCH(fit)
        (motion, points, neighbours, trimmed_share, range.begin(), range.end(), result.data());
    });
    return result;
}

Eigen::Matrix3d neighbour_weight(const BlockMatch& match) {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    const double largest = axes.computeDirect(match.information, Eigen::EigenvaluesOnly).eigenvalues()[2];
    if (!(largest > 0)) return Eigen::Matrix3d::Zero();
    return match.confidence / largest * match.information;
}

}  // namespace tissuewarp::registration::detail
#endif
