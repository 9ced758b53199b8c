// tissuewarp compound: a volume from the frames of a tracked ultrasound probe.

#include "imaging/compounding.hpp"

#include "apps/output_folder.hpp"
#include "apps/progress.hpp"
#include "apps/silenced_stderr.hpp"
#include "apps/verbs.hpp"
#include "core/errors.hpp"
#include "imaging/image_io.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

imaging::Sweep read(const CompoundOptions& options) {
    imaging::SweepOptions how;
    how.to = options.to;
    how.axes = options.axes == "lps" ? imaging::Axes::LPS : imaging::Axes::RAS;
    if (!options.calibration.empty()) how.image_to_probe = imaging::read_calibration(options.calibration);
    return imaging::read_sweep(options.input, how);
}

/// A sweep cannot be acquired again.
void require_other_file(const CompoundOptions& options, const imaging::Sweep& sweep) {
    std::vector<std::filesystem::path> inputs = sweep.files;
    inputs.push_back(options.input);
    if (!options.calibration.empty()) inputs.push_back(options.calibration);
    std::error_code ignored;
    for (const std::filesystem::path& input : inputs)
        if (std::filesystem::equivalent(input, options.output, ignored))
            throw InvalidInput(
                fmt::format("the output '{}' is a file of the input; give another name", options.output.string()));
}

void print(const CompoundOptions& options, const imaging::Sweep& sweep, const imaging::Compounded& made) {
    const Eigen::Affine3d& first = sweep.frames.front().to_patient;
    const auto [nx, ny, nz] = made.volume.geometry.size;
    for (const std::string& note : sweep.notes) fmt::print("note: {}\n", note);
    if (made.gaps > 0)
        fmt::print(
            "note: {} steps from frame to frame are wider than {:g} mm at their middle; where they are, nothing is "
            "shown\n",
            made.gaps, options.gap);
    fmt::print(
        "{}: {} frames of pixels of {:.3g} x {:.3g} mm, {:.2g} mm apart; {} x {} x {} voxels of {:g} mm, {:.0f} "
        "% of them seen\n",
        options.output.string(), sweep.frames.size(), first.linear().col(0).norm(), first.linear().col(1).norm(),
        made.median_step_mm, nx, ny, nz, options.spacing, 100 * made.seen_share);
    fmt::print(
        "register it with --similarity linear-combination: a mean of frames has little speckle to be known by\n");
}

}  // namespace

void run_compound(const CompoundOptions& options) {
    ProgressLine progress(options.common);
    require_could_write_file(options.output);
    progress.begin("reading", 0.0, 0.2);
    const imaging::Sweep sweep = read(options);
    require_other_file(options, sweep);
    progress.begin("compounding", 0.2, 0.9);
    const imaging::Compounded made = [&] {
        try {
            return imaging::compound(sweep, {options.spacing, options.gap}, progress);
        } catch (const InvalidInput& problem) {
            throw InvalidInput(fmt::format("cannot compound '{}': {}", options.input.string(), problem.what()));
        }
    }();
    progress.begin("writing", 0.9, 1.0);
    {
        const SilencedStandardError silenced;
        imaging::write_volume(made.volume, options.output);
    }
    progress.clear();
    if (!options.common.quiet) print(options, sweep, made);
}

}  // namespace tissuewarp::apps
