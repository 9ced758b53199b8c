/// Every program against the reference compiler of the GLSL standard.
#include "shaders/catalogue.hpp"
#include "tests/shaders/effect_chunks.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace tissuewarp::shaders {
namespace {

using namespace effect_chunks;

/// Output and exit status of glslangValidator on the composed text.
std::pair<std::string, int> glslang(const std::string& text, const std::string& options) {
    const std::filesystem::path path =
        std::filesystem::path(::testing::TempDir()) /
        (std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".comp");
    std::ofstream(path) << text;
    const std::string command = std::string(GLSLANG_VALIDATOR) + " " + options + " '" + path.string() + "' 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    std::string output;
    std::array<char, 4096> block{};
    while (const std::size_t n = std::fread(block.data(), 1, block.size(), pipe)) output.append(block.data(), n);
    const int status = pclose(pipe);
    std::filesystem::remove(path);
    return {output, status};
}

std::string lower(std::string text) {
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

TEST(Glslang, AcceptsEveryProgram) {
    for (const ProgramSource& source : every_program()) {
        const ComposedSource composed = compose(source);
        const auto [output, status] = glslang(composed.text, "-S comp");
        EXPECT_EQ(status, 0) << program_key(source) << "\n" << readable_log(output, composed.files);
    }
}

TEST(Glslang, AcceptsEveryRenderPass) {
    for (const ProgramSource& source : every_render_pass()) {
        const ComposedSource composed = compose(source);
        const auto [output, status] =
            glslang(composed.text, source.stage == ShaderStage::Vertex ? "-S vert" : "-S frag");
        EXPECT_EQ(status, 0) << program_key(source) << "\n" << readable_log(output, composed.files);
    }
}

TEST(Glslang, RefusesAWrongProgram) {
    const auto [output, status] = glslang(compose(impose_program()).text + "void f() { nonsense(); }\n", "-S comp");
    EXPECT_NE(status, 0);
    EXPECT_THAT(output, ::testing::HasSubstr("nonsense"));
}

/// Whether the word of an effect is left behind the preprocessor, which takes comments and flags away.
void expect_word(bool present, const std::string& word, const ProgramSource& source) {
    const auto [text, status] = glslang(compose(source).text, "-S comp -E");
    ASSERT_EQ(status, 0) << text;
    EXPECT_THAT(text, ::testing::HasSubstr("void main()"));
    EXPECT_EQ(lower(text).find(word) != std::string::npos, present) << word << " in " << program_key(source);
}

TEST(Glslang, NothingOfAnAbsentEffectIsLeftBehindThePreprocessor) {
    for (const EffectChunk<NodeEffects>& effect : on_nodes) {
        const bool in_residuals = effect.flag != &NodeEffects::contact;
        const bool in_patches = effect.flag != &NodeEffects::surface_force;
        for (const bool present : {false, true}) {
            const NodeEffects effects = present ? all_on_nodes : without(all_on_nodes, effect);
            for (const StoreResidual store : {StoreResidual::No, StoreResidual::Yes})
                expect_word(present, effect.word, node_step_program(effects, store));
            expect_word(present && in_residuals, effect.word, node_residual_program(effects, MaskConstrained::Yes));
            expect_word(present && in_patches, effect.word,
                        patch_step_program({Law::NeoHookeanIso}, effects, {}, whole_step));
        }
    }
    for (const bool present : {false, true}) {
        const NodeEffects effects = present ? all_on_nodes : without(all_on_nodes, turning);
        expect_word(present, turning.word, node_step_program(effects, StoreResidual::No));
        expect_word(present, turning.word, patch_step_program({Law::NeoHookeanIso}, effects, {}, whole_step));
    }
    for (const EffectChunk<SurfaceForces>& effect : on_surfaces) {
        expect_word(true, effect.word, surface_force_program(all_on_surfaces));
        expect_word(false, effect.word, surface_force_program(without(all_on_surfaces, effect)));
    }
}

TEST(Glslang, NothingOfAbsentTissueIsLeftInStepsOverPatches) {
    const PatchTissue plain{Law::NeoHookeanLnJ}, fibres{Law::TransverselyIsotropic}, viscous{Law::NeoHookeanLnJ, 2};
    for (const bool persists : {false, true}) {
        const PatchStages stages{.advances = true, .forces = true, .persists = persists};
        const auto expect = [&](bool present, const char* word, const PatchTissue& tissue) {
            expect_word(present, word, patch_step_program(tissue, {}, {}, stages));
        };
        for (const char* word : {"patch_tissue", "next_place", "begin_fan("}) {
            expect(false, word, plain);
            expect(true, word, fibres);
            expect(true, word, viscous);
        }
        expect(true, "fibre", fibres);
        for (const char* word : {"visc", "prony", "stresses"}) expect(true, word, viscous);
        for (const char* word : {"fibre", "visc", "prony", "stresses"}) expect(false, word, plain);
        for (const char* word : {"visc", "prony", "stresses"}) expect(false, word, fibres);
        expect(false, "fibre", viscous);
    }
}

}  // namespace
}  // namespace tissuewarp::shaders
