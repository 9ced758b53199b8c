#include "shaders/program.hpp"
#include "core/errors.hpp"
#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "tests/shaders/effect_chunks.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <numeric>
#include <set>

namespace tissuewarp::shaders {
namespace {

using namespace effect_chunks;
using ::testing::HasSubstr;

SourceLibrary doubling_library() {
    SourceLibrary library = embedded_sources();
    library["chunks/factor.glsl"] = "// Gives: twice(x).\nint twice(int x) { return 2 * x; }\n";
    library["kernels/double.comp"] =
        "layout(location = 0) uniform uint count;\n"
        "layout(location = 1) uniform float offset;\n"
        "layout(std430, binding = 3) buffer Values { int values[]; };\n"
        "void main() {\n"
        "    uint i = invocation_index();\n"
        "    if (i < count) values[i] = twice(values[i]) + int(offset);\n"
        "}\n";
    return library;
}

const ProgramSource doubling{"double", {"index", "factor"}, {{"WORKGROUP_SIZE", "64"}}, {}};

class ProgramTest : public ::testing::Test {
protected:
    Device device{-1, Debugging::On};
    CurrentContext current = device.make_current();
};

TEST_F(ProgramTest, RunsAKernelOverEveryIndexOnce) {
    const Program program(device, compose(doubling, doubling_library()));
    std::vector<int> values(1000);
    std::iota(values.begin(), values.end(), 0);
    Buffer<int> buffer(device, values, "values");
    buffer.bind(3);
    program.set(0, 999U);
    program.set(1, 1.0F);
    program.dispatch(999);
    const std::vector<int> result = buffer.download();
    for (int i = 0; i < 999; ++i) ASSERT_EQ(result[static_cast<std::size_t>(i)], 2 * i + 1);
    EXPECT_EQ(result[999], 999);
    check_errors("test");
}

TEST_F(ProgramTest, DispatchesMoreWorkgroupsThanARowHolds) {
    const ProgramSource narrow{"double", {"index", "factor"}, {{"WORKGROUP_SIZE", "1"}}, {}};
    const Program program(device, compose(narrow, doubling_library()));
    const std::size_t count = 70001;
    Buffer<int> buffer(device, std::vector<int>(count, 1), "values");
    buffer.bind(3);
    program.set(0, static_cast<std::uint32_t>(count));
    program.set(1, 0.0F);
    program.dispatch(count);
    EXPECT_THAT(buffer.download(), ::testing::Each(2));
}

TEST_F(ProgramTest, ListsItsStorageBlocksInTheOrderOfTheirBindings) {
    const Program program(device, compose(observe_elements_program()));
    std::vector<std::string> names;
    std::vector<int> bindings;
    for (const StorageBlock& block : program.storage_blocks()) {
        names.push_back(block.name);
        bindings.push_back(block.binding);
    }
    EXPECT_THAT(names, ::testing::ElementsAre("Displacement", "ElementNodes", "ElementRest", "Partial"));
    EXPECT_THAT(bindings, ::testing::ElementsAre(0, 3, 4, 6));
}

TEST_F(ProgramTest, KnowsItsWorkgroupSize) {
    EXPECT_EQ(Program(device, compose(doubling, doubling_library())).workgroup_size(), 64);
}

TEST_F(ProgramTest, ReportsAnErrorInAChunkByFileAndLine) {
    SourceLibrary library = doubling_library();
    library["chunks/factor.glsl"] = "// Line 1.\n// Line 2.\nint twice(int x) { return 2 * nonsense; }\n";
    try {
        const Program program(device, compose(doubling, library));
        FAIL() << "accepted";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), HasSubstr("chunks/factor.glsl:3"));
        EXPECT_THAT(error.what(), HasSubstr("nonsense"));
    }
}

TEST_F(ProgramTest, ReportsAnErrorInAKernelByFileAndLine) {
    SourceLibrary library = doubling_library();
    library["kernels/double.comp"] = "void main() {\n    int x = nonsense;\n}\n";
    try {
        const Program program(device, compose(doubling, library));
        FAIL() << "accepted";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), HasSubstr("kernels/double.comp:2"));
    }
}

bool is_over_elements_or_nodes(const ProgramSource& source) {
    for (const char* other : {"patch", "warp", "match"})
        if (source.kernel.starts_with(other)) return false;
    return true;
}

// A number of blocks or a binding beyond what drivers offer looks like a program that some refuse.
TEST_F(ProgramTest, EveryProgramOfTheCatalogueCompilesOnThisDeviceWithinTheLimits) {
    std::size_t most = 0;
    for (const ProgramSource& source : every_program()) {
        std::vector<StorageBlock> blocks;
        EXPECT_NO_THROW(blocks = Program(device, compose(source)).storage_blocks()) << program_key(source);
        for (const StorageBlock& block : blocks) EXPECT_LT(block.binding, 24) << block.name;
        if (is_over_elements_or_nodes(source)) most = std::max(most, blocks.size());
    }
    EXPECT_EQ(most, static_cast<std::size_t>(storage_blocks_of_passes));
}

TEST_F(ProgramTest, TheCacheCompilesOnce) {
    ProgramCache cache(device);
    const Program& first = cache.get(impose_program());
    EXPECT_EQ(&cache.get(impose_program()), &first);
    EXPECT_EQ(cache.size(), 1U);
    EXPECT_NE(&cache.get(element_volume_program()), &first);
    EXPECT_EQ(cache.size(), 2U);
}

TEST_F(ProgramTest, StorageBlocksOfAbsentEffectsAreNotBound) {
    const auto names = [&](const ProgramSource& source) {
        const Program program(device, compose(source));
        std::set<std::string> found;
        for (const StorageBlock& block : program.storage_blocks()) found.insert(block.name);
        return found;
    };
    const auto step_with = [&](const NodeEffects& effects) {
        return names(node_step_program(effects, StoreResidual::No));
    };
    const auto patches_with = [&](const NodeEffects& effects) {
        return names(patch_step_program({Law::NeoHookeanIso}, effects, {}, whole_step));
    };
    const std::set<std::string> bare{"Displacement", "Increment", "InverseMass", "NodeIncidence", "CornerForce"};
    EXPECT_EQ(step_with({}), bare);
    const std::set<std::string> full = step_with(all_on_nodes), full_patches = patches_with(all_on_nodes);
    for (const EffectChunk<NodeEffects>& effect : on_nodes) {
        NodeEffects alone;
        alone.*effect.flag = true;
        std::set<std::string> expected = bare;
        expected.insert(effect.block);
        EXPECT_EQ(step_with(alone), expected);
        const auto less = [&](std::set<std::string> all) {
            all.erase(effect.block);
            return all;
        };
        EXPECT_EQ(step_with(without(all_on_nodes, effect)), less(full)) << effect.block;
        EXPECT_EQ(patches_with(without(all_on_nodes, effect)), less(full_patches)) << effect.block;
    }
    EXPECT_EQ(step_with(without(all_on_nodes, turning)), full) << "turning has no block of its own";
    EXPECT_EQ(patches_with(without(all_on_nodes, turning)), full_patches);
    for (const EffectChunk<SurfaceForces>& effect : on_surfaces)
        EXPECT_THAT(names(surface_force_program(without(all_on_surfaces, effect))),
                    ::testing::ElementsAre("Displacement", "SurfaceEffects", "SurfaceForce"));
}

// Sixteen blocks are what NVIDIA's drivers offer a compute shader: one more, and no scene would run over patches there.
TEST_F(ProgramTest, StepsOverPatchesBindTissueOnceAndSixteenBlocksAtMost) {
    const auto names = [&](const PatchTissue& tissue, const NodeEffects& effects, const PatchStages& stages) {
        const Program program(device, compose(patch_step_program(tissue, effects, {}, stages)));
        std::vector<std::string> found;
        for (const StorageBlock& block : program.storage_blocks()) found.push_back(block.name);
        return found;
    };
    const PatchStages step{.advances = true, .forces = true};
    const std::vector<std::string> plain = names({Law::NeoHookeanLnJ}, {}, step);
    EXPECT_THAT(plain, ::testing::UnorderedElementsAre("PatchHead", "PatchRest", "PatchState", "PatchForces",
                                                       "PatchSources", "PatchLargest", "MaterialParameters"));
    std::vector<std::string> with_tissue = plain;
    with_tissue.emplace_back("PatchTissue");
    for (const PatchTissue& tissue :
         {PatchTissue{Law::TransverselyIsotropic}, {Law::NeoHookeanLnJ, 2}, {Law::TransverselyIsotropic, 2}})
        EXPECT_THAT(names(tissue, {}, step), ::testing::UnorderedElementsAreArray(with_tissue));
    const PatchStages everything{.advances = true, .volumes = true, .forces = true, .averages = true, .persists = true};
    NodeEffects effects = all_on_nodes;
    effects.surface_force = false;
    EXPECT_EQ(names({Law::TransverselyIsotropic, 2}, effects, everything).size(), 16U);
    EXPECT_EQ(names({Law::NeoHookeanLnJ}, effects, everything).size(), 15U);
}

TEST_F(ProgramTest, AMisuseOfOpenGLBecomesAnException) {
    const Program program(device, compose(doubling, doubling_library()));
    program.set(77, 1.0F);
    try {
        check_errors("the test's misuse");
        FAIL() << "unnoticed";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), HasSubstr("the test's misuse: GL_INVALID_OPERATION ("));
    }
    EXPECT_NO_THROW(check_errors("afterwards"));
}

}  // namespace
}  // namespace tissuewarp::shaders
