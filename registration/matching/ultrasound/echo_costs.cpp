#include "registration/matching/ultrasound/echo_costs.hpp"

#include "registration/matching/ultrasound/shifted_windows.hpp"

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

/// Σ w over a window of 1, m, g, m², g², m g, u, u m, u g, u²: w what both show, u echoes, m and g what explains them.
using Sums = Eigen::Array<float, 12, 1>;
enum Sum { W, M, G, MM = 4, GG, MG, U = 8, UM, UG, UU };

/// What a voxel of the moving image adds to the first eight.
using Explaining = Eigen::Array<float, 8, 1>;

std::vector<Explaining> explaining(const EchoImages& images) {
    std::vector<Explaining> result(images.grey.size(), Explaining::Zero());
    for (std::size_t n = 0; n < result.size(); ++n) {
        const float m = images.grey[n], g = images.gradient[n];
        if (images.shown[n] != 0) result[n] << 1, m, g, 0, m * m, g * g, m * g, 0;
    }
    return result;
}

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

ShiftedWindows windows_of(const EchoCostOptions& options) {
    return {options.window_mm, options.reach, options.stride, options.least_share, options.most_lost};
}

EchoCosts echo_costs(const EchoImages& images, const EchoCostOptions& options) {
    const std::vector<Explaining> moving = explaining(images);
    const auto add = [&](std::size_t n, std::size_t from, Sums& sums) {
        const float u = images.echo[n];
        Eigen::Array4f products = u * moving[from].head<4>();  // of 1, m, g
        products[3] = u * products[0];
        sums.head<8>() += moving[from];
        sums.tail<4>() += products;
    };
    const auto cost = [&](const Sums& sums) { return unexplained(sums, options.ridge); };
    return costs_of_shifts<Sums>(images, windows_of(options), add, cost);
}

}  // namespace tissuewarp::registration::detail
