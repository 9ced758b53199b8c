// Prints the table "Estimated discretisation error" of docs/verification.md: estimated against true errors of
// displacements of the problems of data/reference, linear tetrahedra on three meshes.
//     effectivity_table [--problem PART] [--element NAME]

#include "tests/verification/effectivity.hpp"
#include "tests/verification/problems.hpp"

#include <cstdio>
#include <cstring>
#include <string>

using namespace tissuewarp::verification;

int main(int argc, char** argv) {
    std::string part, element;
    for (int i = 1; i + 1 < argc; i += 2) (std::strcmp(argv[i], "--problem") == 0 ? part : element) = argv[i + 1];
    for (const Problem& problem : all_problems()) {
        if (problem.plane_height || problem.name.find(part) == std::string::npos) continue;
        for (const Elements elements : {Elements::T4, Elements::AveragedPressure}) {
            if (!element.empty() && element != name_of(elements)) continue;
            for (int k = 0; k < (getenv("LEVELS") ? atoi(getenv("LEVELS")) : 2); ++k) {
                try {
                const EffectivityStudy s = effectivity(problem, elements, problem.levels[k]);
                for (const Effectivity& e : s.quantities)
                    std::printf("| %s | %s | %s | %d | %s | %.3g | %.3g | %.2g | %.2f%s | %.3g | %d | %.2f |\n", problem.name.c_str(), name_of(problem.law), name_of(elements),
                            s.tetrahedra, e.quantity.c_str(), e.estimated, e.actual, e.uncertain, e.index(), e.judged() ? "" : "?", e.left, s.iterations, s.seconds);
                if (!s.reason.empty()) std::printf("| %s | %s | %s | %d | %s\n", problem.name.c_str(), name_of(problem.law), name_of(elements), s.tetrahedra, s.reason.c_str());
                } catch (const std::exception& x) { std::printf("| %s | %s\n", problem.name.c_str(), x.what()); }
                std::fflush(stdout);
            }
        }
    }
    return 0;
}
