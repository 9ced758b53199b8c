// Prints the table of docs/verification.md: the cube problems of data/reference by Newton's method, both laws and both
// elements, on three meshes and extrapolated.
//     verification_table [coarse middle fine cells an edge, constant ratio; default 8 12 18]

#include "tests/verification/cube_reference.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

using namespace tissuewarp;
using namespace tissuewarp::verification;

namespace {

constexpr double N = 1e-3, J = 1e-6;  // of mN and of mN mm

using Levels = std::array<int, 3>;

// "value (order) | difference %" or dashes where three meshes show no order of convergence yet.
void print_extrapolation(const Extrapolation& found, double expected, double unit) {
    if (!(found.order > 0.5)) {
        std::printf(" – | – |");
    } else {
        std::printf(" %.4f (%.2f) | %+.2f |", unit * found.value, found.order,
                    100 * (found.value - expected) / std::abs(expected));
    }
}

void print_row(const CubeReference& reference, Law law, tled::Element element, const Levels& levels, int component) {
    std::array<CubeSolution, 3> solutions;
    for (std::size_t k = 0; k < 3; ++k) solutions[k] = solve_cube(reference, element, levels[k]);
    const double ratio = static_cast<double>(levels[2]) / levels[1];
    const double expected = reference.force[component];
    const Extrapolation force =
        richardson(solutions[0].force[component], solutions[1].force[component], solutions[2].force[component], ratio);
    const Extrapolation energy = richardson(solutions[0].energy, solutions[1].energy, solutions[2].energy, ratio);
    std::printf("| %s | %s | %s | %c |", reference.name.c_str(), law == Law::Iso ? "iso" : "lnJ",
                element == tled::Element::T4 ? "T4" : "averaged pressure", "xyz"[component]);
    for (const CubeSolution& solution : solutions) std::printf(" %.4f |", N * solution.force[component]);
    std::printf(" %.4f ± %.4f |", N * expected, N * reference.force_uncertainty[component]);
    print_extrapolation(force, expected, N);
    print_extrapolation(energy, reference.energy, J);
    for (const CubeSolution& solution : solutions) std::printf(" %.3f |", largest_point_error(reference, solution));
    std::printf(" %.2f |\n", solutions[2].min_jacobian);
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
    const Levels levels =
        argc == 4 ? Levels{std::atoi(argv[1]), std::atoi(argv[2]), std::atoi(argv[3])} : Levels{8, 12, 18};
    std::printf(
        "| problem | law | element | force | n=%d, N | n=%d, N | n=%d, N | reference, N | extrapolated, N (order) | "
        "off, %% | "
        "energy extrapolated, J (order) | off, %% | points n=%d, mm | n=%d, mm | n=%d, mm | min J |\n",
        levels[0], levels[1], levels[2], levels[0], levels[1], levels[2]);
    std::printf("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    const std::string folder = std::string(TISSUEWARP_SOURCE_DIR) + "/data/reference/";
    for (const char* problem : {"p1_cube_stretch", "p2_cube_compress_mild", "p2_cube_shear"}) {
        for (Law law : {Law::Iso, Law::LnJ}) {
            const CubeReference reference = cube_reference(folder + problem + ".json", law);
            const int component = std::string(problem) == "p2_cube_shear" ? 0 : 2;
            for (tled::Element element : {tled::Element::T4, tled::Element::AveragedPressureT4}) {
                print_row(reference, law, element, levels, component);
            }
        }
    }
    return 0;
}
