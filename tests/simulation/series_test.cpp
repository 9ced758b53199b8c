/// Files of a run, what its plan says, and what its effects change.

#include "simulation/series_io.hpp"

#include "core/detail/hdf5.hpp"
#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "simulation/ablation.hpp"
#include "simulation/plan.hpp"
#include "simulation/series_frame.hpp"
#include "tests/simulation/cube.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace tissuewarp::simulation {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

std::string text_of(const fs::path& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
}

Scene cut_cube() {
    Scene scene = test::cube();
    test::stand_freely(scene);
    scene.sets["upper half"].half_space = HalfSpace{{0, 0, 50}, {0, 0, -1}};
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    scene.resections.push_back({"upper half", 0.75});
    scene.probes = {{"a \"low\" one", {50, 50, 25}}, {"high", {50, 50, 75}}};
    scene.solve.frames = 2;
    return scene;
}

TEST(Series, HoldsEveryFrameInEveryFormat) {
    const fs::path folder = fs::temp_directory_path() / ("tissuewarp-series-" + std::to_string(::getpid()));
    fs::create_directories(folder);
    const BuiltScene built = build(cut_cube());
    SeriesWriter series(built, folder);
    std::vector<Eigen::Matrix3Xd> frames;
    simulate(built, [&](const Frame& frame) {
        series.add(frame);
        frames.push_back(frame.displacement);
    });
    series.finish();
    ASSERT_EQ(frames.size(), 3u);
    EXPECT_EQ(meshing::read_vtu(folder / "frame_0001.vtu").tet_count(), built.stages[0].rest.element_count());
    EXPECT_EQ(meshing::read_vtu(folder / "frame_0002.vtu").tet_count(), built.stages[1].rest.element_count());
    const std::string collection = text_of(folder / "frames.pvd");
    EXPECT_THAT(collection, HasSubstr("timestep=\"0.5\" part=\"0\" file=\"frame_0001.vtu\""));
    const std::string probes = text_of(folder / "probes.csv");
    EXPECT_THAT(probes, HasSubstr("\n0,\"a \"\"low\"\" one\",50,50,25,0,0,0\n"));
    EXPECT_THAT(probes, HasSubstr("\n1,\"high\",50,50,75,nan,nan,nan\n"));

    const Hdf5Input record(folder / "displacement.h5", "tissuewarp simulation", 1, 1);
    EXPECT_EQ(record.columns<double>("mesh/nodes", 3), built.mesh.nodes);
    EXPECT_EQ(record.vector<double>("time", 3), Eigen::Vector3d(0, 0.5, 1));
    EXPECT_EQ(record.vector<int>("stage", 3), Eigen::Vector3i(0, 0, 1));
    EXPECT_EQ(record.vector<int>("remaining/1").size(), built.stages[1].rest.element_count());
    const auto left = static_cast<hsize_t>(built.stages[1].rest.element_count());
    EXPECT_NO_THROW(record.require_shape("remaining_mesh/1/tetrahedra", {left, 4}));
    EXPECT_NO_THROW(record.require_shape("remaining_mesh/1/labels", {left}));
    const std::string description = text_of(folder / "frames.xdmf");
    EXPECT_THAT(description, HasSubstr("displacement.h5:/mesh/tetrahedra"));
    EXPECT_THAT(description, HasSubstr("displacement.h5:/remaining_mesh/1/tetrahedra"));
    EXPECT_NO_THROW(record.require_shape("displacement", {3, static_cast<hsize_t>(built.mesh.node_count()), 3}));
    fs::remove_all(folder);
}

TEST(Series, GivesAFrameBack) {
    const fs::path folder = fs::temp_directory_path() / ("tissuewarp-frame-" + std::to_string(::getpid()));
    fs::create_directories(folder);
    const fs::path file = folder / "displacement.h5";
    const BuiltScene built = build(cut_cube());
    SeriesWriter series(built, folder);
    std::vector<Eigen::Matrix3Xd> frames;
    simulate(built, [&](const Frame& frame) {
        series.add(frame);
        frames.push_back(frame.displacement);
    });
    series.finish();
    const SeriesFrame whole = read_frame(file, 1), cut = read_frame(file);
    EXPECT_EQ(whole.mesh.nodes, built.mesh.nodes);
    EXPECT_EQ(whole.displacement, frames[1]);
    EXPECT_EQ(whole.time, 0.5);
    EXPECT_EQ(whole.gone.tet_count(), 0);
    EXPECT_EQ(cut.index, 2);
    EXPECT_EQ(cut.mesh.tets, built.stages[1].model.mesh.tets);
    EXPECT_EQ(cut.displacement, frames[2]);
    EXPECT_EQ(cut.mesh.tet_count() + cut.gone.tet_count(), built.mesh.tet_count());
    EXPECT_GE(cut.gone.nodes.row(2).minCoeff(), 50.0) << "the upper half";
    for (const int absent : {-2, 3}) EXPECT_THROW(read_frame(file, absent), InvalidInput);
    EXPECT_THROW(read_frame(folder / "probes.csv"), IoError);
    fs::remove_all(folder);
}

TEST(Series, RefusesAFolderThatIsNotThere) {
    const BuiltScene built = build(test::cube());
    EXPECT_THROW(SeriesWriter(built, "/nowhere/at/all"), IoError);
}

const PlannedEffect* find(const Plan& plan, const std::string& name) {
    for (const PlannedEffect& effect : plan.effects)
        if (effect.name == name) return &effect;
    return nullptr;
}

TEST(Plan, NamesTheEffectsOfTheSceneAndNoOther) {
    Scene scene = test::cube();
    const Plan plain = plan_of(build(scene));
    ASSERT_EQ(plain.effects.size(), 1u);
    EXPECT_EQ(plain.effects[0].name, "fixed");
    EXPECT_EQ(plain.effects[0].detail, "25 nodes");
    EXPECT_EQ(plain.tetrahedra, 6 * 64);
    EXPECT_EQ(plain.outer_faces, 6 * 32);
    EXPECT_GT(plain.cpu.flops, 100 * plain.tetrahedra) << "F, P and forces of a tetrahedron";
    EXPECT_EQ(plain.time_step, 0) << "an equilibrium has none";

    scene.gravity = Gravity{Eigen::Vector3d(0, 0, -1), {0, 0, -1}, 9810.0, {}};
    scene.fluid = FluidLevel{1e-6, 90, 30, {}};
    scene.pressures.push_back({"above", 0.4, {}});
    scene.contacts.push_back({});
    scene.contacts[0].body = HalfSpace{{0, 0, -1}, {0, 0, 1}};
    scene.solve.kind = Solve::Kind::Dynamics;
    const Plan full = plan_of(build(scene));
    EXPECT_EQ(full.effects.size(), 5u);
    EXPECT_EQ(find(full, "pressure")->detail, "32 faces");
    EXPECT_EQ(find(full, "contact")->detail, "98 nodes with 1 body");
    EXPECT_EQ(find(full, "membrane"), nullptr);
    EXPECT_EQ(full.cpu.bytes, plain.cpu.bytes) << "elements do not know of them";
    EXPECT_GT(full.memory, plain.memory);
    EXPECT_NEAR(full.time_step, 7.03e-3, 0.7e-3);
}

TEST(Ablation, SaysWhatEachEffectChanges) {
    Scene scene = test::cube();
    test::stand_freely(scene);
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    scene.springs.push_back({"above", 0.0, 1e-3, Springs::Along::AllDirections});
    scene.probes = {{"top", {50, 50, 100}}};
    const Ablation ablation = ablate(scene);
    ASSERT_EQ(ablation.changes.size(), 2u);
    EXPECT_EQ(ablation.changes[0].effect, "springs on 'above'");
    EXPECT_LT(ablation.changes[0].nodes_max_mm, 1.7e-4) << "far too soft to matter";
    EXPECT_EQ(ablation.changes[1].effect, "gravity");
    EXPECT_NEAR(ablation.changes[1].probes_mean_mm, 14.7, 1.5);
    EXPECT_GE(ablation.changes[1].nodes_max_mm, ablation.changes[1].probes_max_mm);
    EXPECT_GT(ablation.changes[1].nodes_max_mm, ablation.changes[1].nodes_mean_mm);
}

TEST(Ablation, SaysWhatASceneCannotDoWithout) {
    Scene scene = test::cube();
    scene.fixed.clear();
    scene.springs.push_back({"below", 1.0, 0.0, Springs::Along::AllDirections});
    const Ablation ablation = ablate(scene);
    ASSERT_EQ(ablation.changes.size(), 1u);
    EXPECT_THAT(ablation.changes[0].failure, HasSubstr("holds"));
}

}  // namespace
}  // namespace tissuewarp::simulation
