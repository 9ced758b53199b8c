// tissuewarp calibrate: what meshes cost and give on this machine, for --accuracy and --time-budget.

#include "apps/progress.hpp"
#include "apps/study.hpp"
#include "apps/update_device.hpp"
#include "apps/verbs.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "registration/dial/fronts_io.hpp"
#include "study/calibration.hpp"

#include <fmt/format.h>

#include <numeric>

namespace tissuewarp::apps {

namespace {

using registration::Fronts;

constexpr std::uint64_t most_phantoms = 1000;  // half a day

std::vector<std::uint64_t> seeds_of(const CalibrateOptions& options, const std::vector<std::uint64_t>& otherwise) {
    const auto [first, last] = phantom_seeds(options.problems, {otherwise.front(), otherwise.back()});
    if (last - first >= most_phantoms)
        throw InvalidInput(fmt::format("--problems names {} phantoms; {} are the most, and 8 are enough for most uses",
                                       last - first + 1, most_phantoms));
    std::vector<std::uint64_t> seeds(last - first + 1);
    std::iota(seeds.begin(), seeds.end(), first);
    return seeds;
}

std::filesystem::path destination(const CalibrateOptions& options) {
    if (!options.output.empty()) return options.output;
    const std::filesystem::path path = registration::fronts_path();
    if (path.empty())
        throw InvalidInput("no folder for the figures: set TISSUEWARP_CACHE or HOME, or give --output FILE");
    return path;
}

void print(const Fronts& fronts) {
    fmt::print("{}\n", fronts.machine);
    fmt::print("data     edges/organ  tetrahedra  prepare s  rounds s  95th  fields s  error mm  95th\n");
    for (const registration::FrontPoint& p : fronts.points)
        fmt::print("{:<9}{:>11.3g}{:>12.0f}{:>11.2f}{:>10.2f}{:>6.2f}{:>10.2f}{:>10.2f}{:>6.2f}\n", name_of(p.kind),
                   p.edges_per_organ, p.tetrahedra, p.preparation_s, p.rounds_s, p.rounds_95_s, p.fields_s, p.error_mm,
                   p.error_95_mm);
    fmt::print(
        "alignment of labels {:.2f} s + {:.2f} s per million voxels, fields {:.3f} s per million voxels beside the "
        "mesh's, warp {:.2f} + {:.3f}\n",
        fronts.alignment[0].constant_s, fronts.alignment[0].slope_s, fronts.fields.slope_s, fronts.warp.constant_s,
        fronts.warp.slope_s);
}

}  // namespace

void run_calibrate(const CalibrateOptions& options) {
    const std::filesystem::path path = destination(options);
    require_writable_folder(std::filesystem::absolute(path).parent_path());
    ProgressLine progress(options.common);
    study::FrontsPlan plan;
    plan.update = on_device(options.device);
    plan.seeds = seeds_of(options, plan.seeds);
    if (options.quick) {
        plan.seeds.resize(std::min<std::size_t>(2, plan.seeds.size()));
        plan.edges_per_organ = {8, 12};
    }
    progress.begin("registering phantoms", 0.0, 1.0);
    const Fronts fronts = study::measure_fronts(plan, progress);
    registration::write_fronts(fronts, path);
    progress.clear();
    if (options.common.quiet) return;
    print(fronts);
    fmt::print("kept in {}\n", path.string());
}

}  // namespace tissuewarp::apps
