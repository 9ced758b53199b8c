#include "study/problem.hpp"

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "imaging/labels.hpp"
#include "registration/field.hpp"
#include "registration/update.hpp"
#include "registration/warp.hpp"
#include "study/detail/clock.hpp"
#include "study/label_mesh.hpp"
#include "study/phantom.hpp"

#include <cmath>
#include <map>

namespace tissuewarp::study {

namespace {

using detail::Clock;
namespace reg = registration;

constexpr double stiffer = 10;  // hard against soft data: stiffness of the springs

/// Seconds of each stage, run after run.
class StageTable {
public:
    void add(const std::string& name, Phase phase, double seconds) {
        for (Stage& stage : stages_)
            if (stage.name == name && stage.phase == phase) return stage.seconds.push_back(seconds);
        stages_.push_back({name, phase, {seconds}});
    }
    [[nodiscard]] const std::vector<Stage>& stages() const { return stages_; }

private:
    std::vector<Stage> stages_;
};

class PatientProblem final : public Problem {
public:
    PatientProblem(Patient patient, int gpu_index) : patient_(std::move(patient)), gpu_index_(gpu_index) {}

    [[nodiscard]] std::string name() const override { return patient_.name; }
    [[nodiscard]] std::string story() const override { return patient_.story; }
    [[nodiscard]] bool is_registration() const override { return true; }

    [[nodiscard]] Setting base() const override {
        Setting setting;
        setting.elements = 20000;
        setting.element = tled::Element::T4;
        setting.physics = {Law::LnJ, 0.45, Hold::Soft};
        return setting;
    }

    [[nodiscard]] std::string refusal(const Setting& setting) const override {
        if (setting.solver == Solver::Newton) return "Newton's method is no part of a registration";
        if (setting.arithmetic == tled::Scalar::Float64) return "registrations compute in float32";
        return {};
    }

    Point measure(const Setting& setting, int runs, Observer& observer) override {
        return attempted(name(), setting, [&](Point& point) {
            prepare(setting, observer);
            solve(setting, runs, point, observer);
        });
    }

private:
    void prepare(const Setting& setting, Observer& observer) {
        if (prepared_ && shared_.elements == setting.elements && shared_.element == setting.element &&
            shared_.physics == setting.physics)
            return;
        prepared_.reset();
        reg::PrepareOptions options;
        options.meshing.edge_length = edge_length_for(patient_.labels, setting.elements);
        options.default_material = material_of(setting.physics);
        options.element = setting.element;
        if (setting.physics.hold == Hold::Hard) options.data_stiffness *= stiffer;
        prepared_ = std::make_shared<const reg::PreparedModel>(reg::prepare(patient_.labels, options, observer));
        shared_ = setting;
    }

    [[nodiscard]] reg::Intraoperative seen(Hold hold) const {
        reg::Intraoperative data = patient_.seen;
        if (hold == Hold::Soft) return data;
        if (data.surface) data.surface->deviation_mm /= std::sqrt(stiffer);
        if (data.points) data.points->deviation_mm /= std::sqrt(stiffer);
        return data;
    }

    [[nodiscard]] reg::UpdateOptions update_options(const Setting& setting) const {
        constexpr double one_step_mm = 1e6;  // accepts what the triangular solve of each round gives
        reg::UpdateOptions options;
        options.align = !patient_.aligned;
        options.equilibrium.method = method_of(setting.solver);
        options.equilibrium.max_steps = 40000;
        options.equilibrium.tolerance_mm = setting.physics.law == Law::Linear ? one_step_mm : setting.tolerance_mm;
        options.device = setting.processor == tled::Processor::Gpu ? reg::Device::Gpu : reg::Device::Cpu;
        options.gpu_index = gpu_index_;
        return options;
    }

    void solve(const Setting& setting, int runs, Point& point, Observer& observer) {
        StageTable table;
        for (const reg::StageTime& time : prepared_->times) table.add(time.stage, Phase::Preparation, time.seconds);
        const Clock engine_clock;
        reg::Updater updater(prepared_, update_options(setting), observer);
        table.add("engine", Phase::Preparation, engine_clock.seconds());
        const reg::Intraoperative data = seen(setting.physics.hold);
        const imaging::Geometry& grid = data.labels ? data.labels->geometry : patient_.labels.geometry;
        reg::UpdateResult result;
        for (int n = 0; n < runs; ++n) {
            observer.checkpoint(name(), double(n) / runs);
            const Clock whole;
            result = updater.update(data, observer);
            for (const reg::StageTime& time : result.times) table.add(time.stage, Phase::Operation, time.seconds);
            const Clock warp;
            (void)reg::warp_labels(patient_.labels, reg::displacement_fixed_to_moving(result.deformation, grid));
            table.add("warp", Phase::Operation, warp.seconds());
            point.seconds.push_back(whole.seconds());
        }
        point.stages = table.stages();
        point.elements = prepared_->rest.element_count();
        point.nodes = prepared_->rest.node_count;
        point.engine = result.engine;
        point.method = setting.physics.law == Law::Linear ? "one triangular solve a round" : name_of(setting.solver);
        for (const reg::Round& round : result.rounds) point.force_evaluations += round.force_evaluations;
        point.estimated_mm = result.rounds.empty() ? 0 : result.rounds.back().estimated_error_mm;
        point.min_jacobian = result.min_jacobian;
        point.places = reg::PointTransform(result.deformation)(patient_.targets.moving);
        const reg::TargetError error = reg::target_error(patient_.targets, point.places);
        point.target = {error.after.mean, error.after.median, error.after.percentile_95, error.after.maximum,
                        error.before.mean};
    }

    Patient patient_;
    int gpu_index_;
    Setting shared_;
    std::shared_ptr<const reg::PreparedModel> prepared_;
};

}  // namespace

Patient patient_of(const std::filesystem::path& folder, const std::string& name, const std::string& story) {
    Patient patient;
    patient.name = name;
    patient.story = story;
    patient.labels = imaging::read_labels(folder / "preop_labels.nii.gz");
    patient.seen.labels = imaging::read_labels(folder / "intraop_labels.nii.gz");
    patient.targets = reg::read_landmarks(folder / "landmarks.csv");
    return patient;
}

Patient random_patient(std::uint64_t seed, Observer& observer) {
    Phantom phantom = random_phantom(seed, {}, observer);
    Patient patient;
    patient.name = "phantom:" + std::to_string(seed);
    patient.story = phantom.story;
    patient.labels = std::move(phantom.moving_labels);
    patient.seen.surface = std::move(phantom.surface);
    patient.seen.points = std::move(phantom.points);
    patient.targets = std::move(phantom.targets);
    return patient;
}

std::unique_ptr<Problem> patient_problem(Patient patient, int gpu_index) {
    return std::make_unique<PatientProblem>(std::move(patient), gpu_index);
}

}  // namespace tissuewarp::study
