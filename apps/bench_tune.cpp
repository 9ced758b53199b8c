#include "apps/bench_tune.hpp"

#include "apps/bench_engines.hpp"
#include "core/errors.hpp"
#include "tled/step_tuning.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>

namespace tissuewarp::apps {

namespace {

constexpr std::array kinds_of_element{tled::Element::T4, tled::Element::AveragedPressureT4};

const char* name_of(tled::Element element) {
    return element == tled::Element::T4 ? "linear tetrahedra" : "averaged pressure";
}

void refuse_options_of_studies(const BenchOptions& options) {
    const char* of_studies = options.study != "all"     ? "--study"
                             : !options.labels.empty()  ? "--labels"
                             : !options.only.empty()    ? "--label"
                             : !options.engines.empty() ? "--engines"
                             : !options.output.empty()  ? "--output"
                                                        : nullptr;
    if (of_studies != nullptr)
        throw InvalidInput(
            fmt::format("{} with --tune has no meaning: tuning times shapes of GPU steps on the cube and "
                        "prints them; leave one of the two out",
                        of_studies));
}

BenchDevice tuned_device(const BenchOptions& options) {
    if (std::optional<BenchDevice> device = bench_device(options.device.name)) return std::move(*device);
    throw InvalidInput("--tune needs an OpenGL device, and there is none with --device " + options.device.name);
}

std::vector<int> sizes(const BenchOptions& options, const BenchDevice& device) {
    if (!options.elements.empty()) return options.elements;
    if (options.quick) return {750};
    if (!device.gpu.hardware) return {6000, 16464};
    return {6000, 16464, 82944, 384000, 998250, 3072000};
}

tled::TuningEffort effort_of(const BenchOptions& options) {
    tled::TuningEffort effort{.runs = options.repeats};
    if (!options.quick) return effort;
    effort.warm_up_seconds = 0;
    effort.run_seconds = 0.005;
    effort.compared_steps = 20;
    return effort;
}

void print_table(tled::Element element, int elements, const std::vector<tled::StepShapeTiming>& timings,
                 const tled::GpuStepShape& suggested) {
    const double fastest = timings.front().seconds_per_step;
    fmt::print("\n{} {}\n{:<22}{:>14}{:>14}{:>10}\n", elements, name_of(element), "shape", "median us", "ps/el",
               "ratio");
    for (const tled::StepShapeTiming& timing : timings) {
        const std::string name = name_of(timing.shape);
        const char* note = timing.shape == suggested ? "  suggested" : "";
        if (timing.fault.empty())
            fmt::print("{:<22}{:>14.2f}{:>14.2f}{:>10.3f}{}\n", name, timing.seconds_per_step * 1e6,
                       timing.seconds_per_step / elements * 1e12, timing.seconds_per_step / fastest, note);
        else
            fmt::print("{:<22}{:>14}{:>14}{:>10}{}  out: {}\n", name, "-", "-", "-", note, timing.fault);
    }
}

}  // namespace

void run_tuning(const BenchOptions& options, ProgressLine& progress) {
    refuse_options_of_studies(options);
    // With its own cache of shaders NVIDIA's driver may run what it sees for the first time at half the speed
    // (docs/performance.md), and each shape is a first time.
    ::setenv("__GL_SHADER_DISK_CACHE", "0", 0);
    const BenchDevice device = tuned_device(options);
    const std::filesystem::path path = tled::step_shape_cache_path();
    tled::StepShapeCache cache = device.measured;
    tled::write_step_shape_cache(cache, path);  // an unwritable place is found before an hour of measuring
    if (!options.common.quiet) {
        fmt::print("{}, {}, {} multiprocessors\n", device.gpu.name, device.gpu.driver,
                   device.gpu.multiprocessors > 0 ? std::to_string(device.gpu.multiprocessors) : "unknown");
        fmt::print("shape: tetrahedra of a patch : of a fan : invocations of a workgroup : workgroups at once\n");
        if (cache.skipped > 0) fmt::print("note: {}\n", skipped_lines(cache));
    }
    const std::vector<int> wanted = sizes(options, device);
    const double runs = double(wanted.size() * kinds_of_element.size());
    double done = 0;
    for (const int elements : wanted)
        for (const tled::Element element : kinds_of_element) {
            progress.begin(fmt::format("{} {}", elements, name_of(element)), done / runs, (done + 1) / runs);
            done += 1;
            const tled::RestState rest = stretched_cube(cells_for(elements), element).rest;
            const int count = rest.element_count();
            const std::vector<tled::StepShapeTiming> timings =
                tled::tuned_gpu_step_shape(rest, device.index, progress, effort_of(options));
            keep(cache, {device.gpu.name, device.gpu.driver, element, count, timings.front().shape,
                         timings.front().seconds_per_step});
            tled::write_step_shape_cache(cache, path);
            progress.clear();
            if (options.common.quiet) continue;
            print_table(element, count, timings,
                        tled::suggested_gpu_step_shape(count, element, device.gpu.multiprocessors));
        }
    if (!options.common.quiet) fmt::print("\nthe fastest are kept in {}\n", path.string());
}

std::string skipped_lines(const tled::StepShapeCache& cache) {
    return fmt::format("{} lines of {} could not be used", cache.skipped, tled::step_shape_cache_path().string());
}

}  // namespace tissuewarp::apps
