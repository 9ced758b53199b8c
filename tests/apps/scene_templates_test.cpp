/// Every scene of data/scenes runs, at a small size, and does what its first line says.

#include "apps/scene_templates.hpp"

#include "apps/scene_file.hpp"
#include "core/errors.hpp"
#include "simulation/presets.hpp"
#include "simulation/run.hpp"
#include "tests/support/folders.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace tissuewarp::apps {
namespace {

using simulation::Scene;

Scene small(const std::string& name) {
    Scene scene = read_scene(tissuewarp::test::source_folder() / "data/scenes" / (name + ".toml"));
    if (auto* box = std::get_if<simulation::BoxGeometry>(&scene.geometry))
        for (int& cells : box->cells) cells = (cells + 1) / 2;
    if (auto* volume = std::get_if<simulation::LabelledVolume>(&scene.geometry)) volume->edge_length *= 1.7;
    if (auto* shapes = std::get_if<simulation::ShapeGeometry>(&scene.geometry)) shapes->edge_length *= 1.6;
    scene.solve.device = simulation::Device::Cpu;
    return scene;
}

/// Displacements of the probes in the last frame, mm.
Eigen::Matrix3Xd last_probes(const Scene& scene) {
    const simulation::BuiltScene built = simulation::build(scene);
    Eigen::Matrix3Xd probes;
    const simulation::RunSummary run = simulation::simulate(
        built, [&](const simulation::Frame& frame) { probes = simulation::probe_displacements(built, frame); });
    EXPECT_EQ(run.frames, scene.solve.frames + 1);
    EXPECT_GT(run.min_jacobian, 0.25);  // 0.28 in the breast
    return probes;
}

TEST(SceneTemplates, CubeSags) {
    EXPECT_NEAR(last_probes(small("cube"))(2, 0), -11.5, 1.1);
}

TEST(SceneTemplates, BrainSettlesTowardsGravity) {
    const Eigen::Matrix3Xd probes = last_probes(small("brain-shift"));
    EXPECT_NEAR(probes(0, 0), 2.06, 0.2) << "the cortex below the craniotomy, mm to the left";
    EXPECT_NEAR(probes.colwise().norm().maxCoeff(), 3.52, 0.35);
}

TEST(SceneTemplates, LiverGivesWayToTheGas) {
    EXPECT_NEAR(last_probes(small("liver"))(1, 0), 12.5, 1.2) << "to the back";
}

TEST(SceneTemplates, BreastSinksToTheBack) {
    const Eigen::Matrix3Xd probes = last_probes(small("breast"));
    EXPECT_NEAR(probes(1, 0), 8.4, 0.8);
}

TEST(SceneTemplates, SpatulaPushesTissueAside) {
    const Eigen::Matrix3Xd probes = last_probes(small("retraction"));
    EXPECT_NEAR(probes(2, 0), -5.6, 0.5);
}

TEST(SceneTemplates, CavityChangesItsWalls) {
    Scene scene = small("resection");
    const Eigen::Matrix3Xd with = last_probes(scene);
    EXPECT_TRUE(std::isnan(with(0, 1))) << "the tumour is gone";
    scene.resections.clear();
    EXPECT_NEAR((with - last_probes(scene)).col(0).norm(), 0.59, 0.06);
}

TEST(Presets, StandInTheManualWithTheirSources) {
    std::ostringstream manual;
    manual << std::ifstream(tissuewarp::test::source_folder() / "docs/manual/simulate.md").rdbuf();
    for (const simulation::Preset& preset : simulation::presets()) {
        EXPECT_NE(manual.str().find('`' + preset.name + '`'), std::string::npos) << preset.name;
        EXPECT_NO_THROW(tled::require_valid(preset.material, preset.name));
        EXPECT_GT(tled::poisson_ratio(preset.material), 0.4) << preset.name << ": kPa and kPa";
        EXPECT_FALSE(preset.source.empty());
    }
    EXPECT_THROW((void)simulation::preset("brain"), InvalidInput);
}

TEST(SceneTemplates, AreWrittenAsTheyAre) {
    const auto names = scene_template_names();
    EXPECT_EQ(names, (std::vector<std::string>{"brain-shift", "breast", "cube", "liver", "resection", "retraction"}));
    for (const std::string& name : names) {
        const SceneTemplate scene = scene_template(name, "beside.nii.gz");
        EXPECT_NE(scene.text.find("[geometry]"), std::string::npos);
        EXPECT_EQ(scene.labels.empty(), name != "brain-shift");
        EXPECT_EQ(scene.text.find("beside.nii.gz") == std::string::npos, scene.labels.empty()) << name;
        EXPECT_EQ(scene.text.find("../"), std::string::npos) << name;
    }
    EXPECT_THROW((void)scene_template("brainshift", "beside.nii.gz"), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::apps
