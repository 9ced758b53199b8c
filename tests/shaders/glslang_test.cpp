/// Every program against the reference compiler of the GLSL standard.
#include "shaders/catalogue.hpp"

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

TEST(Glslang, NothingOfAnAbsentEffectIsLeftBehindThePreprocessor) {
    for (const StoreResidual store : {StoreResidual::No, StoreResidual::Yes}) {
        const auto [bare, status] = glslang(compose(node_step_program({}, store)).text, "-S comp -E");
        ASSERT_EQ(status, 0) << bare;
        EXPECT_THAT(bare, ::testing::HasSubstr("gathered_force"));
        EXPECT_THAT(lower(bare), ::testing::Not(::testing::HasSubstr("spring")));
        EXPECT_THAT(lower(bare), ::testing::Not(::testing::HasSubstr("external")));
    }
    const auto [full, status] = glslang(compose(node_step_program({true, true}, StoreResidual::No)).text, "-S comp -E");
    ASSERT_EQ(status, 0) << full;
    EXPECT_THAT(full, ::testing::HasSubstr("spring_force"));
    EXPECT_THAT(full, ::testing::HasSubstr("external_force"));
}

TEST(Glslang, NothingOfAbsentTissueIsLeftInStepsOverPatches) {
    for (const bool persists : {false, true}) {
        const PatchStages stages{.advances = true, .forces = true, .persists = persists};
        const auto [bare, status] =
            glslang(compose(patch_step_program({Law::NeoHookeanLnJ}, {}, {}, stages)).text, "-S comp -E");
        ASSERT_EQ(status, 0) << bare;
        EXPECT_THAT(bare, ::testing::HasSubstr("add_fan"));
        for (const char* trace : {"fibre", "visc", "prony", "tissue", "place", "stresses"})
            EXPECT_THAT(lower(bare), ::testing::Not(::testing::HasSubstr(trace)));
        const auto [full, full_status] =
            glslang(compose(patch_step_program({Law::TransverselyIsotropic, 2}, {}, {}, stages)).text, "-S comp -E");
        ASSERT_EQ(full_status, 0) << full;
        for (const char* trace : {"fibre", "visc", "prony", "tissue", "place"})
            EXPECT_THAT(lower(full), ::testing::HasSubstr(trace));
    }
}

}  // namespace
}  // namespace tissuewarp::shaders
