// Prints the table "Estimated error of the mesh" of docs/lab/verification.md: estimated against true errors of the
// displacements of data/reference, linear tetrahedra on the two coarser levels; on the first, quadratic ones as well.
//     effectivity_table [--problem PART]

#include "tests/verification/effectivity.hpp"
#include "tests/verification/problems.hpp"
#include "tled/blas_threads.hpp"

#include <cstdio>
#include <exception>
#include <optional>
#include <string>

using namespace tissuewarp::verification;

namespace {

void print(const Problem& problem, Elements elements, const EffectivityStudy& study) {
    const auto print_start = [&] {
        std::printf("| %s | %s | %s | %d | ", problem.name.c_str(), name_of(problem.law), name_of(elements),
                    study.tetrahedra);
    };
    if (!study.reason.empty()) {
        print_start();
        std::printf("no estimate: %s |\n", study.reason.c_str());
    }
    for (const Effectivity& each : study.quantities) {
        print_start();
        std::printf("%s | %.3g | %.3g ± %.2g | ", each.quantity.c_str(), each.estimated, each.actual, each.uncertain);
        std::printf(each.judged() && !each.met() ? "**%.2f** | " : "%.2f | ", each.index());
        std::printf("%s | %.3g | ", !each.judged() ? "unknown" : each.met() ? "met" : "**missed**", each.left);
        if (std::isnan(each.quadratic)) {
            std::printf("| %d |\n", study.iterations);
        } else {
            std::printf("%.2f | %d |\n", each.estimated / each.quadratic, study.iterations);
        }
    }
    std::fflush(stdout);
}

Elements quadratic_elements(const Problem& problem) {
    const bool soft = tissuewarp::tled::suggested_element(problem.materials) == tissuewarp::tled::Element::T4;
    return soft ? Elements::Quadratic : Elements::QuadraticMixed;
}

}  // namespace

int main(int argc, char** argv) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    const std::string part = argc == 3 && argv[1] == std::string("--problem") ? argv[2] : "";
    std::printf(
        "| problem | law | element | tetrahedra | quantity | estimated, mm | true, mm | effectivity | 0.5–2 | left, mm "
        "| "
        "against T10 | iterations |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    try {
        for (const Problem& problem : all_problems()) {
            if (problem.plane_height || problem.name.find(part) == std::string::npos) continue;
            std::optional<Solution> quadratic;  // its laws differ little
            if (problem.law == Law::Iso) quadratic = solve(problem, quadratic_elements(problem), problem.levels[0]);
            for (const Elements elements : {Elements::T4, Elements::AveragedPressure}) {
                print(problem, elements,
                      effectivity(problem, elements, problem.levels[0], quadratic ? &*quadratic : nullptr));
                print(problem, elements, effectivity(problem, elements, problem.levels[1]));
            }
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "effectivity_table: %s\n", error.what());
        return 2;
    }
    return 0;
}
