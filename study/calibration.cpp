#include "study/calibration.hpp"

#include "core/errors.hpp"
#include "registration/field.hpp"
#include "registration/warp.hpp"
#include "study/detail/registered_phantom.hpp"
#include "study/point.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <string>

namespace tissuewarp::study {

using namespace registration;

namespace {

class Stopwatch {
public:
    double lap() {
        const auto now = std::chrono::steady_clock::now();
        const double seconds = std::chrono::duration<double>(now - last_).count();
        last_ = now;
        return seconds;
    }

private:
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Amounts of work and the seconds that they took.
struct Cost {
    std::vector<double> amounts, seconds;
    void add(double amount, double taken) {
        amounts.push_back(amount);
        seconds.push_back(taken);
    }
    /// Least squares with neither part below 0.
    [[nodiscard]] LinearCost line() const {
        const auto n = double(amounts.size());
        double x = 0, y = 0, xx = 0, xy = 0;
        for (std::size_t i = 0; i < amounts.size(); ++i) {
            x += amounts[i] / n;
            y += seconds[i] / n;
            xx += amounts[i] * amounts[i] / n;
            xy += amounts[i] * seconds[i] / n;
        }
        const double variance = xx - x * x;
        const double slope = variance > 1e-9 * xx ? std::max(0.0, (xy - x * y) / variance) : 0.0;
        if (y - slope * x >= 0) return {y - slope * x, slope};
        return {0.0, xx > 0 ? xy / xx : 0.0};
    }
};

/// What all registrations of one mesh density and one kind of data gave.
struct Sample {
    std::vector<double> tetrahedra, preparation, rounds, fields, errors;
};

/// The same box with voxels of half the size.
imaging::Geometry halved(imaging::Geometry grid) {
    for (int& size : grid.size) size *= 2;
    grid.origin -= grid.direction * (grid.spacing / 4);
    grid.spacing /= 2;
    return grid;
}

double seconds_of(const std::vector<StageTime>& times, const std::string& stage) {
    double sum = 0;
    for (const StageTime& time : times)
        if (time.stage == stage) sum += time.seconds;
    return sum;
}

class Measurement {
public:
    Measurement(const FrontsPlan& plan, Observer& observer) : plan_(plan), observer_(observer) {
        if (plan.seeds.empty() || plan.edges_per_organ.empty() || plan.voxel_mm.empty())
            throw InvalidInput("nothing to measure: give phantoms, meshes and sizes of voxels");
        work_ = plan.seeds.size() * (plan.edges_per_organ.size() + 1) + plan.voxel_mm.size() - 1;
    }

    Fronts run() {
        for (const std::uint64_t seed : plan_.seeds) {
            const Phantom phantom = made(seed, plan_.voxel_mm.front());
            for (const double density : plan_.edges_per_organ) register_with(phantom, density);
        }
        for (std::size_t size = 1; size < plan_.voxel_mm.size(); ++size) {
            const Phantom phantom = made(plan_.seeds.front(), plan_.voxel_mm[size]);
            register_with(phantom, plan_.edges_per_organ.front());
        }
        return fronts();
    }

private:
    const FrontsPlan& plan_;
    Observer& observer_;
    std::size_t work_ = 0, done_ = 0;
    std::map<std::pair<DataKind, double>, Sample> samples_;
    Cost alignment_[2], warp_;
    std::vector<double> seconds_per_megavoxel_;  // of both fields
    std::string engine_;

    void checkpoint() { observer_.checkpoint("measuring", std::min(1.0, double(done_++) / double(work_))); }

    Phantom made(std::uint64_t seed, double voxel_mm) {
        checkpoint();
        PhantomOptions options;
        options.voxel_mm = voxel_mm;
        return random_phantom(seed, options);
    }

    void register_with(const Phantom& phantom, double density) {
        checkpoint();
        Stopwatch stopwatch;
        PrepareOptions options;
        options.meshing.edge_length = organ_size(phantom.moving_labels) / density;
        const auto prepared = std::make_shared<PreparedModel>(prepare(phantom.moving_labels, options));
        prepare_loads(*prepared);
        const double preparation = stopwatch.lap();
        Updater updater(prepared, plan_.update);
        for (const DataKind kind : {DataKind::Labels, DataKind::Partial}) {
            const UpdateResult result = updater.update(detail::seen_of(phantom, kind));
            engine_ = result.engine;
            Sample& sample = samples_[{kind, density}];
            sample.tetrahedra.push_back(prepared->model.mesh.tet_count());
            sample.preparation.push_back(preparation);
            sample.rounds.push_back(seconds_of(result.times, "correspondence") +
                                    seconds_of(result.times, "equilibrium"));
            sample.errors.push_back(detail::root_mean_square_error(result.deformation, phantom.targets));
            alignment_[int(kind)].add(
                kind == DataKind::Labels ? detail::megavoxels(phantom.fixed_labels.geometry) : 0.0,
                seconds_of(result.times, "rigid alignment") + seconds_of(result.times, "boundary maps"));
            sample.fields.push_back(time_images(phantom, result.deformation));
            if (density == plan_.edges_per_organ.front()) time_finer_fields(phantom, result.deformation);
        }
    }

    /// Seconds of both fields.
    double time_images(const Phantom& phantom, const Deformation& deformation) {
        const imaging::Geometry &moving = phantom.moving_labels.geometry, &fixed = phantom.fixed_labels.geometry;
        Stopwatch stopwatch;
        const imaging::Volume forward = displacement_moving_to_fixed(deformation, moving);
        const imaging::Volume backward = displacement_fixed_to_moving(deformation, fixed);
        const double fields = stopwatch.lap();
        warp_image(phantom.moving_labels.as(CV_32F), backward);
        warp_labels(phantom.moving_labels, backward);
        warp_.add(detail::megavoxels(fixed), stopwatch.lap());
        return fields;
    }

    /// The phantoms' own grids are too much alike to tell what voxels cost beside what the mesh does.
    void time_finer_fields(const Phantom& phantom, const Deformation& deformation) {
        const imaging::Geometry& coarse = phantom.moving_labels.geometry;
        const imaging::Geometry fine = halved(coarse);
        Stopwatch stopwatch;
        for (const auto& field : {displacement_moving_to_fixed, displacement_fixed_to_moving}) {
            field(deformation, coarse, {}, silent_observer());
            const double few = stopwatch.lap();
            field(deformation, fine, {}, silent_observer());
            const double many = stopwatch.lap();
            seconds_per_megavoxel_.push_back((many - few) / (detail::megavoxels(fine) - detail::megavoxels(coarse)));
        }
    }

    [[nodiscard]] Fronts fronts() const {
        Fronts fronts;
        fronts.machine = engine_;
        fronts.measured_here = true;
        for (const DataKind kind : {DataKind::Labels, DataKind::Partial})
            fronts.alignment[int(kind)] = alignment_[int(kind)].line();
        fronts.fields = {0, std::max(0.0, percentile(seconds_per_megavoxel_, 0.5))};
        fronts.warp = warp_.line();
        for (const auto& [key, sample] : samples_) {
            FrontPoint point;
            std::tie(point.kind, point.edges_per_organ) = key;
            point.tetrahedra = percentile(sample.tetrahedra, 0.5);
            point.preparation_s = percentile(sample.preparation, 0.5);
            point.rounds_s = percentile(sample.rounds, 0.5);
            point.rounds_95_s = percentile(sample.rounds, 0.95);
            point.fields_s = percentile(sample.fields, 0.5);
            point.error_mm = percentile(sample.errors, 0.5);
            point.error_95_mm = percentile(sample.errors, 0.95);
            fronts.points.push_back(point);
        }
        return fronts;
    }
};

}  // namespace

Fronts measure_fronts(const FrontsPlan& plan, Observer& observer) {
    return Measurement(plan, observer).run();
}

}  // namespace tissuewarp::study
