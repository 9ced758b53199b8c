// The table of effects of docs/lab/verification.md: every verification case on every engine.
//     effect_table [--gpu]
// Prints a table in Markdown: the reference, and each engine's difference from it beside what is accepted. Ends with 1
// when one is larger.
#include "tests/verification/effect_cases.hpp"
#include "tled/blas_threads.hpp"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>
#include <vector>

using namespace tissuewarp;

namespace {

struct Column {
    const char* name;
    verification::MakeEngine make;
};

std::vector<Column> columns(bool gpu) {
    std::vector<Column> result{
        {"CPU float64", [](const tled::RestState& rest) { return tled::make_cpu_engine(rest, tled::Scalar::Float64); }},
        {"CPU float32",
         [](const tled::RestState& rest) { return tled::make_cpu_engine(rest, tled::Scalar::Float32); }}};
    if (gpu) result.push_back({"GPU", [](const tled::RestState& rest) { return tled::make_gpu_engine(rest); }});
    return result;
}

int print_table(const std::vector<Column>& engines) {
    std::printf("| effect | scene | quantity | closed form | value | accepted |");
    for (const Column& engine : engines) std::printf(" %s |", engine.name);
    std::printf("\n|---|---|---|---|---|---|");
    for (std::size_t i = 0; i < engines.size(); ++i) std::printf("---|");
    int missed = 0;
    std::vector<verification::EffectCase> cases = verification::effect_cases();
    for (const verification::EffectCase& each : verification::scene_cases()) cases.push_back(each);
    for (const verification::EffectCase& each : cases) {
        std::printf("\n| %s | %s | %s (%s) | %s | %.5g | %.2g |", each.effect.c_str(), each.scene.c_str(),
                    each.quantity.c_str(), each.unit.c_str(), each.source.c_str(), each.reference, each.bound);
        for (const Column& engine : engines) {
            const double difference = each.measure(engine.make) - each.reference;
            missed += !(std::abs(difference) <= each.bound);
            std::printf(" %+.2g |", difference);
            std::fflush(stdout);
        }
    }
    std::printf("\n");
    return missed;
}

}  // namespace

int main(int count, char** arguments) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    const bool gpu = count == 2 && std::strcmp(arguments[1], "--gpu") == 0;
    if (count > 1 && !gpu) {
        std::fprintf(stderr, "usage: effect_table [--gpu]\n");
        return 2;
    }
    try {
        return print_table(columns(gpu)) > 0 ? 1 : 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "effect_table: %s\n", error.what());
        return 2;
    }
}
