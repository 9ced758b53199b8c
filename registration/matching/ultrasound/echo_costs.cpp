#include "registration/matching/ultrasound/echo_costs.hpp"

#include "registration/matching/ultrasound/window_sums.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace tissuewarp::registration::detail {

namespace {

/// Σ w over a window of 1, u, u², m, g, m², g², m g, u m, u g: w what both show, u echoes, m and g what explains them.
using Sums = Eigen::Array<float, 12, 1>;
enum Sum { W, U, UU, M, G, MM, GG, MG, UM, UG };

using Grid = SumGrid<Sums>;

/// Memory of a thread.
struct Work {
    Grid one, other;
};

/// The share of the echoes' variance that is not explained.
float unexplained(const Sums& s, double ridge) {
    const double w = s[W], u = s[U] / w, m = s[M] / w, g = s[G] / w;
    const double variance = s[UU] / w - u * u;
    const double mm = s[MM] / w - m * m + ridge, gg = s[GG] / w - g * g + ridge, mg = s[MG] / w - m * g,
                 um = s[UM] / w - u * m, ug = s[UG] / w - u * g;
    const double determinant = mm * gg - mg * mg;
    const double explained = (um * um * gg - 2 * um * ug * mg + ug * ug * mm) / determinant;
    return static_cast<float>(1 - explained / std::max(variance, 1e-6));
}

class Shifted {
public:
    Shifted(const EchoImages& images, const EchoCostOptions& options)
        : images_(images), options_(options), weights_(gaussian_window(options.window_mm / images.grid.spacing[0])) {}

    /// Sums of the windows about all places, of the moving image shifted by steps.
    Grid& sums(const Eigen::Vector3i& shift, Work& work) const {
        fill(shift, work.one);
        return window_sums(weights_, options_.stride, work.one, work.other);
    }

private:
    const EchoImages& images_;
    const EchoCostOptions& options_;
    std::vector<float> weights_;

    void fill(const Eigen::Vector3i& shift, Grid& grid) const {
        const auto& size = images_.grid.size;
        grid.size = size;
        grid.sums.assign(images_.echo.size(), Sums::Zero());
        const std::ptrdiff_t away = shift[0] + size[0] * (shift[1] + std::ptrdiff_t{size[1]} * shift[2]);
        for (int k = std::max(0, shift[2]); k < std::min(size[2], size[2] + shift[2]); ++k)
            for (int j = std::max(0, shift[1]); j < std::min(size[1], size[1] + shift[1]); ++j)
                for (int i = std::max(0, shift[0]); i < std::min(size[0], size[0] + shift[0]); ++i) {
                    const std::ptrdiff_t there = i + size[0] * (j + std::ptrdiff_t{size[1]} * k);
                    const auto n = static_cast<std::size_t>(there), from = static_cast<std::size_t>(there - away);
                    if (images_.seen[n] == 0 || images_.shown[from] == 0) continue;
                    const float u = images_.echo[n], m = images_.grey[from], g = images_.gradient[from];
                    grid.sums[n] << 1, u, u * u, m, g, m * m, g * g, m * g, u * m, u * g, 0, 0;
                }
    }
};

}  // namespace

Eigen::Vector3d EchoCosts::place(std::size_t n) const {
    const auto index = static_cast<std::ptrdiff_t>(at[n]);
    const std::ptrdiff_t row = places.size[0], slice = row * places.size[1];
    return places.point({double(index % row), double(index % slice / row), double(index / slice)});
}

Eigen::Vector3i EchoCosts::shift(std::size_t entry) const {
    const int m = static_cast<int>(entry), s = side();
    return {m % s - reach, m / s % s - reach, m / (s * s) - reach};
}

EchoCosts echo_costs(const EchoImages& images, const EchoCostOptions& options) {
    EchoCosts result;
    result.step_mm = images.grid.spacing[0];
    result.reach = options.reach;
    result.places = images.grid;
    result.places.spacing *= options.stride;
    for (int& size : result.places.size) size = (size + options.stride - 1) / options.stride;
    const Shifted shifted(images, options);
    Work work;
    EchoImages all = images;
    std::fill(all.shown.begin(), all.shown.end(), 1.F);
    const Grid& full = Shifted(all, options).sums(Eigen::Vector3i::Zero(), work);
    for (std::size_t n = 0; n < full.sums.size(); ++n)
        if (full.sums[n][W] >= options.least_share) {
            result.at.push_back(n);
            result.window_share.push_back(full.sums[n][W]);
        }
    const std::size_t lattice = result.lattice();
    result.cost.resize(result.at.size() * lattice);
    tbb::enumerable_thread_specific<Work> works;
    tbb::parallel_for(std::size_t{0}, lattice, [&](std::size_t entry) {
        const Grid& sums = shifted.sums(result.shift(entry), works.local());
        for (std::size_t n = 0; n < result.at.size(); ++n) {
            const Sums& here = sums.sums[result.at[n]];
            const bool lost = here[W] < (1 - options.most_lost) * result.window_share[n];
            result.cost[n * lattice + entry] =
                lost ? std::numeric_limits<float>::infinity() : unexplained(here, options.ridge);
        }
    });
    return result;
}

}  // namespace tissuewarp::registration::detail
