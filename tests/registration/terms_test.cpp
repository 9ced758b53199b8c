/// Terms together, one of a kind that the library does not know.
#include "registration/engine_choice.hpp"
#include "registration/field.hpp"
#include "registration/register.hpp"
#include "registration/solver.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/anchors.hpp"
#include "registration/terms/ground.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"
#include "tests/registration/tether.hpp"
#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <thread>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd, Eigen::Vector3d;

PreparedModel organ(std::vector<int> anchors = {}) {
    PrepareOptions options;
    options.meshing.edge_length = 10;
    options.anchors = std::move(anchors);
    return prepare(shapes::organ_labels({}), options);
}

UpdateOptions on_cpu() {
    UpdateOptions options;
    options.device = Device::Cpu;
    return options;
}

detail::Terms tethered(const PreparedModel& prepared, const Vector3d& moving, const Vector3d& fixed, bool align) {
    const double energy = detail::strain_energy_unit(prepared, {});
    std::vector<std::unique_ptr<detail::Term>> terms;
    terms.push_back(std::make_unique<test::TetherTerm>(prepared, moving, fixed, 1e6));
    terms.push_back(std::make_unique<detail::GroundTerm>(prepared, energy, 5));
    return {std::move(terms), energy, align};
}

UpdateResult registered(const PreparedModel& prepared, detail::Terms& terms, bool align) {
    UpdateOptions options = on_cpu();
    options.align = align;
    options.tissue.load_shapes = 0;
    detail::LoadFinder loads(prepared, options.tissue);
    const auto engine = detail::make_engine(prepared, options, silent_observer());
    return detail::register_model(prepared, terms, loads, *engine, options, silent_observer());
}

// Nothing but the term's own pair of files and the list of terms knows of it.
TEST(Terms, AnUnknownKindOfDatumDrawsTheTissue) {
    const PreparedModel prepared = organ();
    const Vector3d moving(20, 5, 3), fixed(23, 6, 1);
    detail::Terms held = tethered(prepared, moving, fixed, false);
    const UpdateResult bent = registered(prepared, held, false);
    EXPECT_LT((PointTransform(bent.deformation)(moving) - fixed).norm(), 0.05);
    EXPECT_TRUE(bent.deformation.placement.isApprox(Eigen::Isometry3d::Identity()));
    EXPECT_GT(bent.deformation.displacement.colwise().norm().maxCoeff(), 2);
    EXPECT_TRUE(bent.doubts.empty());

    detail::Terms free = tethered(prepared, moving, fixed, true);
    const UpdateResult shifted = registered(prepared, free, true);
    EXPECT_LT((PointTransform(shifted.deformation)(moving) - fixed).norm(), 0.05);
    EXPECT_LT(shifted.deformation.displacement.colwise().norm().maxCoeff(), 0.4);  // nearly all of it is placement
}

TEST(Terms, SpringsComeInTheOrderOfTheirOrigins) {
    const PreparedModel prepared = organ({2});
    const Intraoperative seen{.labels = prepared.labels};
    const UpdateResult result = update(prepared, seen, on_cpu());
    EXPECT_TRUE(std::is_sorted(result.pulls.springs.begin(), result.pulls.springs.end(),
                               [](const PulledNode& a, const PulledNode& b) { return a.origin < b.origin; }));
    EXPECT_EQ(result.pulls.of(Origin::Support).size(), detail::anchored_nodes(prepared).size());
    EXPECT_EQ(result.pulls.of(Origin::Hold).size(), prepared.interfaces.nodes().size());
    EXPECT_FALSE(result.pulls.of(Origin::Datum).empty());
    EXPECT_TRUE(result.pulls.of(Origin::Prior).empty());
}

TEST(Terms, NothingToRegisterToIsSaid) {
    EXPECT_THROW(update(organ(), {}, on_cpu()), InvalidInput);
}

// Where no step has an equilibrium, each is half of the one before; the start is as it was.
TEST(Solver, HalvesTheStepFourTimes) {
    const PreparedModel prepared = organ();
    UpdateOptions options = on_cpu();
    options.equilibrium.max_steps = 1;
    options.equilibrium.tolerance_mm = 1e-9;
    const auto engine = detail::make_engine(prepared, options, silent_observer());
    detail::Solver solver(prepared, *engine, options, true);
    std::vector<double> steps;
    const auto conditions = [&](double most_step_mm) {
        steps.push_back(most_step_mm);
        tled::Conditions pulled;
        const Eigen::Matrix3d stiffness = 1e3 * Eigen::Matrix3d::Identity();
        for (int node = 0; node < 8; ++node) pulled.springs.push_back({node, stiffness, Vector3d(most_step_mm, 0, 0)});
        return tled::nodal_conditions(pulled, prepared.rest.node_count);
    };
    const Matrix3Xd start = Matrix3Xd::Zero(3, prepared.rest.node_count);
    EXPECT_THROW((void)solver.solve(conditions, start, silent_observer()), SolverFailure);
    EXPECT_EQ(steps, (std::vector<double>{6, 3, 1.5, 0.75, 0.375}));
}

// What an observer is told, it is told by the thread that called: it may draw, and needs no lock.
TEST(Updater, ProgressComesOnTheCallersThread) {
    struct Caller : Observer {
        std::thread::id thread = std::this_thread::get_id();
        std::set<std::string, std::less<>> stages;
        int elsewhere = 0;
        void progress(std::string_view stage, double) override {
            stages.emplace(stage);
            elsewhere += std::this_thread::get_id() != thread;
        }
        bool cancel_requested() override {
            elsewhere += std::this_thread::get_id() != thread;
            return false;
        }
    } caller;
    const imaging::Volume labels = shapes::organ_labels({});
    PrepareOptions options;
    options.meshing.edge_length = 10;
    const PreparedModel prepared = prepare(labels, options, caller);
    const UpdateResult result = update(prepared, {.labels = labels}, on_cpu(), caller);
    (void)uncertainty(prepared, result, {}, caller);
    EXPECT_EQ(caller.elsewhere, 0);
    for (const char* stage : {"meshing", "rest stiffness", "rigid alignment", "registration", "error estimate"})
        EXPECT_TRUE(caller.stages.contains(stage)) << stage;
}

// The updater shares the model: it lives as long as the updater needs it.
TEST(Updater, OutlivesTheCallersModel) {
    const imaging::Volume labels = shapes::organ_labels({});
    std::optional<Updater> updater;
    {
        auto model = std::make_shared<const PreparedModel>(organ());
        updater.emplace(model, on_cpu());
    }
    EXPECT_LT(updater->update({.labels = labels}).deformation.displacement.colwise().norm().maxCoeff(), 0.1);
    Updater of_temporary(organ(), on_cpu());
    EXPECT_LT(of_temporary.update({.labels = labels}).deformation.displacement.colwise().norm().maxCoeff(), 0.1);
}

TEST(Updater, ModelsThatGotTheirImageTooLateAreRefused) {
    const auto model = std::make_shared<PreparedModel>(organ());
    Updater updater(model, on_cpu());
    imaging::Volume image = model->labels.as(CV_32F).clone();
    for (std::int64_t n = 0; n < image.geometry.voxel_count(); ++n)
        image.data<float>()[n] += std::sin(0.37F * float(n));
    prepare_image(*model, image);
    EXPECT_THROW((void)updater.update({.image = image}), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
