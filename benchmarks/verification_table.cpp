// Prints the tables of docs/lab/verification.md: the problems of data/reference by Newton's method, every element, on four
// meshes and extrapolated; then every engine against Newton's method on one mesh.
//     verification_table [--csv FILE] [--problem PART]... [--element NAME] [--no-studies] [--no-engines] [--gpu]
//     verification_table --list
// FILE takes one line per quantity and mesh, for scripts/plot_verification.py. PART selects problems whose name holds
// it; a $ behind it stands for the end of the name.

#include "benchmarks/verification_engines.hpp"
#include "core/errors.hpp"
#include "tests/verification/problems.hpp"
#include "tests/verification/study.hpp"
#include "tled/blas_threads.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <set>
#include <string>
#include <vector>

using namespace tissuewarp;
using namespace tissuewarp::verification;

namespace {

struct Arguments {
    std::string csv;
    std::vector<std::string> parts;
    std::string element;
    bool studies = true, engines = true, gpu = false, list = false;
};

Arguments parse(int argc, char** argv) {
    Arguments result;
    const std::vector<std::string> given(argv + 1, argv + argc);
    for (std::size_t i = 0; i < given.size(); ++i) {
        const bool has_value = i + 1 < given.size();
        if (given[i] == "--csv" && has_value) {
            result.csv = given[++i];
        } else if (given[i] == "--problem" && has_value) {
            result.parts.push_back(given[++i]);
        } else if (given[i] == "--element" && has_value) {
            result.element = given[++i];
        } else if (given[i] == "--no-studies") {
            result.studies = false;
        } else if (given[i] == "--no-engines") {
            result.engines = false;
        } else if (given[i] == "--list") {
            result.list = true;
        } else if (given[i] == "--gpu") {
            result.gpu = true;
        } else {
            throw InvalidInput("unknown argument " + given[i] + "; see the head of verification_table.cpp");
        }
    }
    return result;
}

bool selected(const Problem& problem, const std::vector<std::string>& parts) {
    for (const std::string& part : parts) {
        if ((problem.name + "$").find(part) != std::string::npos) return true;
    }
    return parts.empty();
}

void print_head(const std::string& problem) {
    std::printf(
        "\n### %s\n\n"
        "| law | element | nodes | min J | quantity | finest mesh | order | extrapolated | reference | off | "
        "mesh error | within uncertainty + mesh error | with safety factor |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
        problem.c_str());
}

// Differences of exact states are rounding.
bool has_order(const Comparison& c) {
    return !std::isnan(c.order) && (!c.single() || c.mesh_error() > 1e-10 * std::abs(c.reference[0]));
}

void print_row(const Problem& problem, Elements elements, const Study& study, const Comparison& c) {
    std::printf("| %s | %s | %d | %.2f | %s, %s | ", name_of(problem.law), name_of(elements), study.nodes.back(),
                study.min_jacobian.back(), c.quantity.c_str(), c.unit.c_str());
    if (c.single()) {
        std::printf("%.6g | ", c.finest()[0]);
    } else {
        std::printf("– | ");
    }
    if (!has_order(c)) {
        std::printf("– | ");
    } else {
        std::printf("%.1f | ", c.order);
    }
    if (c.single() && has_order(c)) {
        std::printf("%.6g | ", c.extrapolated);
    } else {
        std::printf("– | ");
    }
    if (c.single()) {
        std::printf("%.6g ± %.2g | %+.3g (%+.2f %%) | ", c.reference[0], c.uncertain, c.off,
                    100.0 * c.off / std::abs(c.reference[0]));
    } else {
        std::printf("± %.2g | %.3g, at most %.3g | ", c.uncertain, c.off, c.largest_off);
    }
    std::printf("%.3g + %.2g | ", c.distance, c.limit_error);
    if (c.met()) {
        std::printf("met | ");
    } else if (expected_to_lock(problem, elements)) {
        std::printf("locks, by %.2g | ", c.excess());
    } else {
        std::printf("**not met** by %.2g | ", c.excess());
    }
    std::printf("%g: %s |\n", c.safety, c.met_within_index() ? "met" : "not met");
}

void write_csv(std::ofstream& csv, const Problem& problem, Elements elements, const Study& study, const Comparison& c) {
    for (std::size_t k = 0; k < c.values.size(); ++k) {
        const Eigen::VectorXd& value = c.values[k];
        const double off = (value - c.reference).norm() / std::sqrt(static_cast<double>(value.size()));
        csv << '"' << problem.name << "\"," << name_of(problem.law) << ',' << name_of(elements) << ",\"" << c.quantity
            << "\"," << c.unit << ',' << study.nodes[k] << ',' << (c.single() ? value[0] : off) << ',' << off << ','
            << (c.single() ? c.reference[0] : 0.0) << ',' << c.uncertain << ',' << c.mesh_error() << ','
            << c.index_error() << ',' << (expected_to_lock(problem, elements) ? "yes" : "no") << '\n';
    }
    csv.flush();
}

void run_studies(const Arguments& arguments) {
    std::ofstream csv;
    if (!arguments.csv.empty()) {
        csv.open(arguments.csv);
        csv.precision(10);
        csv << "problem,law,element,quantity,unit,nodes,value,off,reference,uncertainty,mesh_error,index_error,"
               "expected_to_lock\n";
    }
    std::vector<Problem> problems = all_problems();
    std::stable_sort(problems.begin(), problems.end(),
                     [](const Problem& a, const Problem& b) { return a.name < b.name; });
    std::string last;
    for (const Problem& problem : problems) {
        if (!selected(problem, arguments.parts)) continue;
        if (problem.name != last) print_head(problem.name);
        last = problem.name;
        for (const Elements elements : elements_for(problem)) {
            if (!arguments.element.empty() && arguments.element != name_of(elements)) continue;
            try {
                const Study found = study(problem, elements);
                for (const Comparison& c : found.comparisons) {
                    print_row(problem, elements, found, c);
                    if (csv.is_open()) write_csv(csv, problem, elements, found, c);
                }
            } catch (const SolverFailure& failure) {
                std::printf("| %s | %s | **%s** |\n", name_of(problem.law), name_of(elements), failure.what());
            }
            std::fflush(stdout);
        }
    }
}

/// Names in the order of the tables; problems of several laws share one.
void list_problems() {
    std::set<std::string> names;
    for (const Problem& problem : all_problems()) names.insert(problem.name);
    for (const std::string& name : names) std::printf("%s\n", name.c_str());
}

}  // namespace

int main(int argc, char** argv) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    try {
        const Arguments arguments = parse(argc, argv);
        if (arguments.list) {
            list_problems();
            return 0;
        }
        if (arguments.studies) run_studies(arguments);
        if (arguments.engines) print_engines(arguments.gpu ? GpuRows::Print : GpuRows::Omit);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "verification_table: %s\n", error.what());
        return 2;
    }
    return 0;
}
