#include "study/problem.hpp"

#include "core/errors.hpp"
#include "meshing/point_location.hpp"
#include "study/detail/clock.hpp"
#include "study/reference.hpp"
#include "tled/load_path.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/reference/newton.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

namespace tissuewarp::study {

namespace {

using detail::Clock;
using Eigen::Matrix3Xd;

/// A nodal displacement at fixed places.
class Sampling {
public:
    Sampling(const meshing::TetMesh& mesh, const Matrix3Xd& places) : mesh_(mesh) {
        constexpr double near_by = 1.0;  // of an element: coarse meshes cut corners of the body
        const meshing::PointLocator locator(mesh);
        for (const auto& place : places.colwise()) {
            auto location = locator.find(place);
            if (!location) location = locator.find(place, near_by);
            if (!location)
                throw InvalidInput("a mesh of " + std::to_string(mesh.tet_count()) +
                                   " tetrahedra is too coarse for this body; ask for more");
            locations_.push_back(*location);
        }
    }

    [[nodiscard]] Matrix3Xd of(const Matrix3Xd& nodal) const {
        Matrix3Xd values(3, static_cast<Eigen::Index>(locations_.size()));
        for (std::size_t i = 0; i < locations_.size(); ++i)
            values.col(static_cast<Eigen::Index>(i)) = meshing::interpolate(mesh_, nodal, locations_[i]);
        return values;
    }

private:
    const meshing::TetMesh& mesh_;
    std::vector<meshing::Location> locations_;
};

/// A mesh of so many tetrahedra, wanted and made.
struct Meshed {
    int wanted = 0;
    meshing::TetMesh mesh;
    double seconds = 0;
    std::unique_ptr<Sampling> sampling;
};

/// What settings with the same mesh, element and physics share.
struct Prepared {
    int wanted = 0;
    tled::Element element = tled::Element::T4;
    Physics physics;
    tled::RestState rest;
    tled::NodalConditions conditions;
    std::unique_ptr<tled::RestStiffness> stiffness;
    double rest_seconds = 0, stiffness_seconds = 0;
    std::map<std::string, double> kept_seconds;  ///< of what the stiffness keeps, when it was made
    std::optional<Matrix3Xd> exact;              ///< on this mesh, where it was asked for

    /// Makes what the stiffness keeps, the first time.
    template <class Make>
    double seconds_of(const std::string& what, const Make& make) {
        const auto known = kept_seconds.find(what);
        if (known != kept_seconds.end()) return known->second;
        const Clock clock;
        make(*stiffness);
        return kept_seconds[what] = clock.seconds();
    }

    [[nodiscard]] bool serves(const Setting& setting) const {
        return wanted == setting.elements && element == setting.element && physics == setting.physics;
    }
};

/// Without a factor; automatic on a GPU (tled::equilibrium).
bool is_self_checked(const Setting& setting) {
    if (setting.physics.law == Law::Linear) return false;
    return setting.solver == Solver::SelfCheckedRelaxation ||
           (setting.solver == Solver::Automatic && setting.processor == tled::Processor::Gpu);
}

/// Chooses between methods, and tunes dynamic relaxation.
bool needs_frequency(const Setting& setting) {
    return setting.physics.law != Law::Linear && !is_self_checked(setting) &&
           (setting.solver == Solver::Automatic || setting.solver == Solver::DynamicRelaxation);
}

/// An answer with what it took.
struct Solved {
    Matrix3Xd displacement;
    std::string engine, method;
    int force_evaluations = 0;
    double estimated_mm = 0;
};

class BodyProblem final : public Problem {
public:
    BodyProblem(Body body, const BodyOptions& options) : body_(std::move(body)), options_(options) {}

    [[nodiscard]] std::string name() const override { return body_.name; }
    [[nodiscard]] std::string story() const override { return body_.story; }
    [[nodiscard]] Setting base() const override {
        Setting setting;
        setting.physics.hold = body_.hold;
        return setting;
    }
    [[nodiscard]] bool is_registration() const override { return false; }

    [[nodiscard]] std::string refusal(const Setting& setting) const override {
        const bool gpu = setting.processor == tled::Processor::Gpu;
        if (gpu && setting.arithmetic == tled::Scalar::Float64) return "the GPU's engine computes in float32";
        if (gpu && (setting.solver == Solver::Newton || setting.physics.law == Law::Linear))
            return "factors are solved on the processor";
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
        if (meshed_.wanted != setting.elements) {
            prepared_ = {};
            meshed_ = {};
            const Clock clock;
            meshed_.mesh = body_.mesh(setting.elements, observer);
            meshed_.seconds = clock.seconds();
            meshed_.sampling = std::make_unique<Sampling>(meshed_.mesh, body_.samples);
            meshed_.wanted = setting.elements;
        }
        if (prepared_.serves(setting)) return;
        prepared_ = {};
        const Clock rest_clock;
        tled::Model model;
        model.mesh = meshed_.mesh;
        model.materials[1] = material_of(setting.physics);
        model.element = setting.element;
        prepared_.rest = tled::rest_state(model);
        prepared_.rest_seconds = rest_clock.seconds();
        prepared_.conditions =
            tled::nodal_conditions(conditions_of(body_, setting.physics.hold, meshed_.mesh), prepared_.rest.node_count);
        const Clock stiffness_clock;
        prepared_.stiffness = std::make_unique<tled::RestStiffness>(prepared_.rest, prepared_.conditions);
        prepared_.stiffness_seconds = stiffness_clock.seconds();
        prepared_.wanted = setting.elements;
        prepared_.element = setting.element;
        prepared_.physics = setting.physics;
    }

    void solve(const Setting& setting, int runs, Point& point, Observer& observer) {
        const tled::RestState& rest = prepared_.rest;
        point.elements = rest.element_count();
        point.nodes = rest.node_count;
        point.stages = {{"mesh", Phase::Preparation, {meshed_.seconds}},
                        {"rest state", Phase::Preparation, {prepared_.rest_seconds}}};
        add_stiffness(setting, point);
        const auto run = runner(setting, point, observer);
        Solved solved;
        Stage equilibrium{"equilibrium", Phase::Operation, {}};
        for (int n = 0; n < runs; ++n) {
            observer.checkpoint(name(), double(n) / runs);
            const Clock clock;
            solved = run();
            equilibrium.seconds.push_back(clock.seconds());
        }
        point.seconds = equilibrium.seconds;
        point.stages.push_back(std::move(equilibrium));
        point.engine = solved.engine;
        point.method = solved.method;
        point.force_evaluations = solved.force_evaluations;
        point.estimated_mm = solved.estimated_mm;
        point.min_jacobian = tled::jacobians(rest, solved.displacement).minCoeff();
        judge(setting, solved.displacement, point, observer);
    }

    /// What the method takes of the stiffness.
    void add_stiffness(const Setting& setting, Point& point) {
        if (setting.solver == Solver::Newton) return;
        const auto add = [&](const char* stage, double seconds) {
            point.stages.push_back({stage, Phase::Preparation, {seconds}});
        };
        add("stiffness", prepared_.stiffness_seconds);
        if (is_self_checked(setting)) {
            const auto make = [](const tled::RestStiffness& k) { (void)k.approximate_lowest_eigenvalue(); };
            add("lowest frequency without factor", prepared_.seconds_of("frequency about", make));
            return;
        }
        add("factor", prepared_.seconds_of("factor", [](const tled::RestStiffness& k) { k.factorise(); }));
        if (!needs_frequency(setting)) return;
        const auto make = [](const tled::RestStiffness& k) { (void)k.lowest_eigenvalue(); };
        add("lowest frequency", prepared_.seconds_of("frequency", make));
    }

    /// What one run does, its engine made.
    std::function<Solved()> runner(const Setting& setting, Point& point, Observer& observer) {
        if (setting.physics.law == Law::Linear)
            return [this] {
                return Solved{prepared_.stiffness->linear_solution(prepared_.conditions), "factor of K0, float64",
                              "one triangular solve", 0, 0};
            };
        if (setting.solver == Solver::Newton)
            return [this, setting, &observer] {
                tled::NewtonOptions options;
                options.tolerance_mm = setting.tolerance_mm;
                const auto found = tled::newton_equilibrium(prepared_.rest, prepared_.conditions, options, observer);
                return Solved{found.displacement, "CPU float64, a factor per iteration", "Newton", found.iterations,
                              found.last_correction_mm};
            };
        const Clock clock;
        const std::shared_ptr<tled::Engine> engine = setting.processor == tled::Processor::Gpu
                                                         ? tled::make_gpu_engine(prepared_.rest, options_.gpu_index)
                                                         : tled::make_cpu_engine(prepared_.rest, setting.arithmetic);
        point.stages.push_back({"engine", Phase::Preparation, {clock.seconds()}});
        return [this, setting, engine, &observer] {
            constexpr int most_evaluations = 40000;  // relaxation to 0.001 mm takes some thousands
            tled::LoadPathOptions options;
            options.equilibrium.tolerance_mm = setting.tolerance_mm;
            options.equilibrium.max_steps = most_evaluations;
            options.equilibrium.method = method_of(setting.solver);
            options.equilibrium.rest = &prepared_.rest;
            const auto found = tled::equilibrium_along_load(*engine, *prepared_.stiffness, prepared_.conditions,
                                                            options, nullptr, observer);
            return Solved{found.displacement, engine->description(), tled::name_of(found.method),
                          found.force_evaluations, found.estimated_error_mm};
        };
    }

    void judge(const Setting& setting, const Matrix3Xd& displacement, Point& point, Observer& observer) {
        if (setting.physics.law != Law::Linear && point.elements <= options_.most_checked) {
            if (!prepared_.exact) {
                constexpr double exact_mm = 1e-7;
                tled::NewtonOptions options;
                options.tolerance_mm = exact_mm;
                options.start = displacement;
                prepared_.exact =
                    tled::newton_equilibrium(prepared_.rest, prepared_.conditions, options, observer).displacement;
            }
            point.algebraic_mm = length_of(displacement - *prepared_.exact).largest;
        }
        const Matrix3Xd found = meshed_.sampling->of(displacement);
        point.places = body_.samples + found;
        const Reference& own = reference(base().physics, observer);
        const Reference& same = reference(setting.physics, observer);
        point.model = length_of(same.displacement - own.displacement);
        point.numerical = length_of(found - same.displacement);
        point.reference_mm = same.uncertainty_mm;
    }

    /// Kept in memory and in the cache.
    const Reference& reference(const Physics& physics, Observer& observer) {
        char number[32];
        std::snprintf(number, sizeof number, "%g", physics.poissons_ratio);
        std::string key = name() + "-" + name_of(physics.law) + "-" + number + "-" + name_of(physics.hold) + "-" +
                          std::to_string(options_.reference_tetrahedra);
        std::replace(key.begin(), key.end(), ' ', '_');
        const auto known = references_.find(key);
        if (known != references_.end()) return known->second;
        const std::filesystem::path file = options_.cache / (key + ".h5");
        if (!options_.cache.empty() && std::filesystem::exists(file)) {
            Reference stored = read_reference(file);
            if (stored.displacement.cols() != body_.samples.cols())
                throw InvalidInput("'" + file.string() + "' holds " + std::to_string(stored.displacement.cols()) +
                                   " places for " + std::to_string(body_.samples.cols()) + " of the " + name() +
                                   "; delete it or give another --output");
            return references_[key] = std::move(stored);
        }
        Reference made = physics == base().physics
                             ? reference_of(body_, physics, options_.reference_tetrahedra, observer)
                             : changed_reference(body_, physics, reference(base().physics, observer), observer);
        if (!options_.cache.empty()) write_reference(made, file);
        return references_[key] = std::move(made);
    }

    Body body_;
    BodyOptions options_;
    Meshed meshed_;
    Prepared prepared_;
    std::map<std::string, Reference> references_;
};

}  // namespace

std::unique_ptr<Problem> body_problem(Body body, const BodyOptions& options) {
    return std::make_unique<BodyProblem>(std::move(body), options);
}

}  // namespace tissuewarp::study
