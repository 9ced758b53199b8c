#include "tests/verification/problems.hpp"

namespace tissuewarp::verification {

std::vector<Problem> all_problems() {
    constexpr std::array laws{Law::Iso, Law::LnJ};
    constexpr std::array poisson_ratios{0.3, 0.45, 0.49, 0.499, 0.4999};
    std::vector<Problem> result;
    for (const auto& cube : {cube_stretch, cube_mild_compression, cube_compression, cube_shear}) {
        for (const Law law : laws) result.push_back(cube(law));
    }
    for (const double nu : poisson_ratios) {
        for (const Law law : laws) result.push_back(cook_plane_strain(law, nu));
    }
    for (const double nu : poisson_ratios) {
        for (const Law law : laws) {
            if (std::optional<Problem> problem = cook_3d(law, nu)) result.push_back(*std::move(problem));
        }
    }
    for (const auto& bar : {bar_twist, cantilever, ellipsoid_plain}) {
        for (const Law law : laws) result.push_back(bar(law));
    }
    result.push_back(ellipsoid_inclusion());
    for (const Gravity gravity : {Gravity::Prone, Gravity::Supine}) {
        for (const Law law : laws) result.push_back(breast(law, gravity));
    }
    for (const Law law : laws) {
        for (const int step : {1, 3}) result.push_back(block_contact(law, step));
        for (const int step : {5, 7}) result.push_back(half_ball_contact(law, step));
    }
    return result;
}

}  // namespace tissuewarp::verification
