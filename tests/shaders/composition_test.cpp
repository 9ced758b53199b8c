/// Composition of GLSL: text only, no device.
#include "core/errors.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program_source.hpp"
#include "tests/shaders/effect_chunks.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <regex>
#include <set>

namespace tissuewarp::shaders {
namespace {

using ::testing::HasSubstr;
using namespace effect_chunks;

const SourceLibrary library{
    {"kernels/k.comp", "//! define WITH_A\n#if WITH_A\nint x = a();\n#endif\nvoid main() {}\n"},
    {"chunks/a.glsl", "//! define SIZE\nint a() { return SIZE; }"},
    {"chunks/b.glsl", "int b() { return 2; }\n"},
};

/// Compute programs and the stages of render passes.
std::vector<ProgramSource> every_stage() {
    std::vector<ProgramSource> all = every_program();
    for (const ProgramSource& source : every_render_pass()) all.push_back(source);
    return all;
}

TEST(Composition, PutsVersionDefinesChunksAndKernelInOrder) {
    const ComposedSource composed = compose({"k", {"a", "b"}, {{"WITH_A", "1"}, {"SIZE", "3"}}, {}}, library);
    EXPECT_EQ(composed.text,
              "#version 450 core\n#define SIZE 3\n#define WITH_A 1\n"
              "#line 10001 1\n//! define SIZE\nint a() { return SIZE; }\n"
              "#line 20001 2\nint b() { return 2; }\n"
              "#line 30001 3\n//! define WITH_A\n#if WITH_A\nint x = a();\n#endif\nvoid main() {}\n");
    EXPECT_THAT(composed.files, ::testing::ElementsAre("prolog", "chunks/a.glsl", "chunks/b.glsl", "kernels/k.comp"));
}

TEST(Composition, PutsExtensionsBehindTheVersion) {
    const ComposedSource composed = compose({"k", {}, {{"WITH_A", "0"}}, {"GL_KHR_shader_subgroup_basic"}}, library);
    EXPECT_TRUE(composed.text.starts_with(
        "#version 450 core\n#extension GL_KHR_shader_subgroup_basic : require\n#define WITH_A 0\n"));
}

TEST(Composition, RefusesAFlagWithoutAValue) {
    EXPECT_THROW(compose({"k", {}, {}, {}}, library), InvalidInput);
    EXPECT_THROW(compose({"k", {"a"}, {{"WITH_A", "1"}}, {}}, library), InvalidInput);
}

TEST(Composition, RefusesAValueThatNoFileDeclares) {
    try {
        compose({"k", {"b"}, {{"WITH_A", "0"}, {"WITH_AA", "1"}}, {}}, library);
        FAIL() << "accepted";
    } catch (const InvalidInput& error) {
        EXPECT_THAT(error.what(), HasSubstr("WITH_AA"));
    }
}

TEST(Composition, RefusesAnUnknownFileByName) {
    try {
        compose({"k", {"nowhere"}, {{"WITH_A", "0"}}, {}}, library);
        FAIL() << "accepted";
    } catch (const InvalidInput& error) {
        EXPECT_THAT(error.what(), HasSubstr("chunks/nowhere.glsl"));
    }
}

TEST(Composition, KeyTellsProgramsApart) {
    std::set<std::string> keys;
    std::set<std::string> texts;
    const std::vector<ProgramSource> all = every_stage();
    for (const ProgramSource& source : all) {
        keys.insert(program_key(source));
        texts.insert(compose(source).text);
    }
    EXPECT_EQ(keys.size(), all.size());
    EXPECT_EQ(texts.size(), all.size());
    EXPECT_EQ(program_key(impose_program()), program_key(impose_program()));
}

TEST(Composition, LogsOfAllDriversAreMadeReadable) {
    const std::vector<std::string> files{"prolog", "chunks/a.glsl", "kernels/k.comp"};
    EXPECT_EQ(readable_log("1:10023(5): error: no function\n", files), "chunks/a.glsl:23: error: no function\n");
    EXPECT_EQ(readable_log("0:10023(5): error: source forgotten", files),
              "chunks/a.glsl:23: error: source forgotten\n");
    EXPECT_EQ(readable_log("2(20007) : error C1008: undefined variable", files),
              "kernels/k.comp:7 : error C1008: undefined variable\n");
    EXPECT_EQ(readable_log("ERROR: 1:10004: '' : syntax error", files), "ERROR: chunks/a.glsl:4: '' : syntax error\n");
    EXPECT_EQ(readable_log("0:4(1): error: in the prolog", files), "0:4(1): error: in the prolog\n");
    EXPECT_EQ(readable_log("9:90004(1): error: beyond the table", files), "9:90004(1): error: beyond the table\n");
    EXPECT_EQ(readable_log("no position here", files), "no position here\n");
}

TEST(Composition, EveryKernelAndChunkIsUsedByAProgram) {
    std::set<std::string> used;
    for (const ProgramSource& source : every_stage())
        for (const std::string& file : compose(source).files) used.insert(file);
    for (const auto& [name, text] : embedded_sources()) EXPECT_TRUE(used.contains(name)) << name;
}

TEST(Composition, EveryEmbeddedFileOpensWithItsContract) {
    EXPECT_GE(embedded_sources().size(), 18U);
    for (const auto& [name, text] : embedded_sources()) EXPECT_TRUE(text.starts_with("//")) << name;
}

/// Whether an effect's file, its storage block and its flag are all there, or none of them; any mixture fails.
template <class Flags>
void expect_effect(bool present, const EffectChunk<Flags>& effect, const ProgramSource& source) {
    const ComposedSource composed = compose(source);
    SCOPED_TRACE(source.kernel + (present ? " with " : " without ") + effect.file);
    EXPECT_EQ(std::count(composed.files.begin(), composed.files.end(), effect.file), present ? 1 : 0);
    EXPECT_THAT(composed.text, HasSubstr(std::string("#define ") + effect.name + (present ? " 1\n" : " 0\n")));
    const bool shared = effect.block == std::string("SurfaceEffects") || effect.name == std::string("HAS_TURNING");
    EXPECT_EQ(composed.text.find(std::string("buffer ") + effect.block + " ") != std::string::npos, present || shared);
}

TEST(Composition, ChunksOfAbsentEffectsAreAbsent) {
    for (const EffectChunk<NodeEffects>& effect : on_nodes) {
        const bool in_residuals = effect.flag != &NodeEffects::contact;
        const bool in_patches = effect.flag != &NodeEffects::surface_force;
        for (const bool present : {false, true}) {
            const NodeEffects effects = present ? all_on_nodes : without(all_on_nodes, effect);
            expect_effect(present, effect, node_step_program(effects, StoreResidual::Yes));
            if (in_residuals) expect_effect(present, effect, node_residual_program(effects, MaskConstrained::Yes));
            if (in_patches)
                expect_effect(present, effect, patch_step_program({Law::NeoHookeanIso}, effects, {}, whole_step));
        }
    }
    for (const bool present : {false, true}) {
        const NodeEffects effects = present ? all_on_nodes : without(all_on_nodes, turning);
        expect_effect(present, turning, node_step_program(effects, StoreResidual::Yes));
        expect_effect(present, turning, patch_step_program({Law::NeoHookeanIso}, effects, {}, whole_step));
    }
    for (const EffectChunk<SurfaceForces>& effect : on_surfaces) {
        expect_effect(true, effect, surface_force_program(all_on_surfaces));
        expect_effect(false, effect, surface_force_program(without(all_on_surfaces, effect)));
    }
}

// Elastic tissue without fibres pays for neither.
TEST(Composition, StepsOverPatchesHoldNoTraceOfAbsentTissue) {
    const PatchStages stages{.advances = true, .forces = true};
    const ComposedSource plain = compose(patch_step_program({Law::NeoHookeanLnJ}, {}, {}, stages));
    for (const std::string& file : plain.files) {
        EXPECT_THAT(file, ::testing::Not(HasSubstr("fibre")));
        EXPECT_THAT(file, ::testing::Not(HasSubstr("viscosity")));
        EXPECT_THAT(file, ::testing::Not(HasSubstr("patch.tissue")));
        EXPECT_THAT(file, ::testing::Not(HasSubstr("patch.stresses")));
    }
    EXPECT_THAT(plain.text, HasSubstr("#define HAS_FIBRES 0\n"));
    EXPECT_THAT(plain.text, HasSubstr("#define HAS_VISCOSITY 0\n"));
    const auto files = [&](const PatchTissue& tissue) {
        return compose(patch_step_program(tissue, {}, {}, stages)).files;
    };
    using ::testing::Contains;
    EXPECT_THAT(files({Law::TransverselyIsotropic}), Contains("chunks/patch.fibre.glsl"));
    EXPECT_THAT(files({Law::TransverselyIsotropic}), ::testing::Not(Contains("chunks/patch.viscosity.glsl")));
    EXPECT_THAT(files({Law::NeoHookeanLnJ, 1}), Contains("chunks/patch.viscosity.glsl"));
    EXPECT_THAT(files({Law::NeoHookeanLnJ, 1}), ::testing::Not(Contains("chunks/patch.fibre.glsl")));
}

TEST(Composition, AStepInWhichStressesRestNeitherComputesNorWritesThem) {
    PatchStages stages{.advances = true, .forces = true};
    const auto text = [&] { return compose(patch_step_program({Law::NeoHookeanLnJ, 2}, {}, {}, stages)).text; };
    for (const char* word : {"keep_stress(", "advance_stresses(", "second_stress("})
        EXPECT_THAT(text(), HasSubstr(word));
    stages.rests = true;
    for (const char* word : {"keep_stress(", "void advance_stresses("})
        EXPECT_THAT(text(), ::testing::Not(HasSubstr(word)));
    EXPECT_THAT(text(), HasSubstr("#define MOVES_STRESSES 0\n"));
    EXPECT_THAT(text(), HasSubstr("readonly buffer PatchTissue"));
}

// Room that no program uses would take other workgroups' place.
TEST(Composition, ViscousStressesStayInSharedMemoryOnlyWhereOnePatchDoes) {
    const auto stays = [](const PatchSizes& sizes, bool persists) {
        const PatchStages stages{.advances = true, .forces = true, .persists = persists};
        return compose(patch_step_program({Law::NeoHookeanLnJ, 1}, {}, sizes, stages)).text.find("stresses_here") !=
               std::string::npos;
    };
    EXPECT_TRUE(stays({.places = 64}, true));
    EXPECT_FALSE(stays({.places = 0}, true));
    EXPECT_FALSE(stays({.places = 64}, false));
    EXPECT_FALSE(stays({.each_has_one = false, .places = 64}, true));
}

// NVIDIA's compiler evaluates a call within matrix arithmetic once for each column where the function branches
// (shaders/README.md, traps): three times the law, which nothing but time shows.
TEST(Composition, ALawIsCalledOutsideOfArithmetic) {
    const std::regex call(R"((\S)\s*\bstress\((?:[^()]|\([^()]*(?:\([^()]*\))?[^()]*\))*\)\s*(\S))");
    int calls = 0;
    for (const ProgramSource& source : every_stage()) {
        const std::string text = compose(source).text;
        for (std::sregex_iterator each(text.begin(), text.end(), call), end; each != end; ++each) {
            const char before = (*each)[1].str()[0], after = (*each)[2].str()[0];
            if (after == '{') continue;  // the definition
            EXPECT_TRUE(std::string("=,n").find(before) != std::string::npos &&
                        std::string(",;)").find(after) != std::string::npos)
                << source.kernel << ": " << each->str();
            ++calls;
        }
    }
    EXPECT_GT(calls, 100);
}

// It sums within a warp before every addition whose result nothing takes (shaders/README.md, traps), which again only
// time shows.
TEST(Composition, AdditionsToSumsOfAPatchReturnThem) {
    const std::regex addition(R"((\S)\s*\batomicAdd\()");
    int additions = 0;
    for (const ProgramSource& source : every_stage()) {
        if (source.kernel != "patch_step") continue;
        const std::string text = compose(source).text;
        for (std::sregex_iterator each(text.begin(), text.end(), addition), end; each != end; ++each) {
            EXPECT_EQ((*each)[1].str(), "=") << text.substr(static_cast<std::size_t>(each->position()), 80);
            ++additions;
        }
    }
    EXPECT_GT(additions, 100);
}

}  // namespace
}  // namespace tissuewarp::shaders
