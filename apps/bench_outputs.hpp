#pragma once
/// What the benchmark leaves: tables on standard output, bench.json, bench.csv and figures.

#include "apps/bench_results.hpp"

#include <nlohmann/json.hpp>

#include <string>

namespace tissuewarp::apps {

/// A long benchmark shows each study as soon as it is measured: an interrupt then costs the study at hand alone.
void print_head(const BenchResults& results);
void print_study(const BenchResults& results, const StudyResults& study);
void print_limits(const BenchResults& results);

/// Times in s; the keys are listed in docs/manual/bench.md.
nlohmann::json bench_json(const BenchResults& results);

/// One line for each engine on each mesh.
std::string bench_csv(const BenchResults& results);

/// Time per step, and the ratio to the scalar loops (cube and brain: figures 2 and 3 of Taylor, Cheng, Ourselin 2007)
/// or the time of an element-step (scaling), over the number of elements, as SVG.
std::string bench_figure(const StudyResults& study);

}  // namespace tissuewarp::apps
