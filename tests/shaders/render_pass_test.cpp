#include "shaders/render_pass.hpp"
#include "core/errors.hpp"
#include "shaders/catalogue.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <map>
#include <numeric>

namespace tissuewarp::shaders {
namespace {

using ::testing::HasSubstr;
using Float4 = std::array<float, 4>;

/// Two passes: where each fragment is, into two targets; and twice the texel of a texture.
SourceLibrary small_library() {
    SourceLibrary library = embedded_sources();
    library["chunks/factor.glsl"] = "// Gives: twice(x).\nvec4 twice(vec4 x) { return 2.0 * x; }\n";
    library["render_pass/place.frag"] =
        "layout(location = 0) uniform float offset;\n"
        "layout(location = 0) out vec4 column;\n"
        "layout(location = 1) out vec4 row;\n"
        "void main() {\n"
        "    column = vec4(gl_FragCoord.x + offset, 1.0, 0.0, 0.0);\n"
        "    row = vec4(gl_FragCoord.y + offset, 2.0, 0.0, 0.0);\n"
        "}\n";
    library["render_pass/twice.frag"] =
        "layout(binding = 5) uniform sampler2D before;\n"
        "layout(location = 0) out vec4 after;\n"
        "void main() { after = twice(texelFetch(before, ivec2(gl_FragCoord.xy), 0)); }\n";
    return library;
}

const ProgramSource place{"place", {}, {}, {}, ShaderStage::Fragment};
const ProgramSource twice{"twice", {"factor"}, {}, {}, ShaderStage::Fragment};

class RenderPassTest : public ::testing::Test {
protected:
    Device device{-1, Debugging::On};
    CurrentContext current = device.make_current();
};

TEST_F(RenderPassTest, ShapesAreNearlySquareAndHoldTheList) {
    for (const std::size_t count : {0, 1, 2, 3, 10, 11, 750, 16464, 998250}) {
        const TextureShape shape = texture_shape(device, count, "values");
        EXPECT_GE(shape.texels(), count);
        EXPECT_GE(shape.width, shape.height);
        EXPECT_LE(shape.width, shape.height + 1);
    }
}

TEST_F(RenderPassTest, CoordinatesAreColumnAndRow) {
    const TextureShape shape{100, 90};
    EXPECT_EQ(shape.coordinates(0), 0u);
    EXPECT_EQ(shape.coordinates(99), 99u);
    EXPECT_EQ(shape.coordinates(100), 1u << 15);
    EXPECT_EQ(shape.coordinates(8999), 99u | 89u << 15);
}

TEST_F(RenderPassTest, AListBeyondTheDeviceIsRefusedInWords) {
    const auto side = static_cast<std::size_t>(device.limits().texture_size);
    EXPECT_NO_THROW(texture_shape(device, side * 2, "values"));
    try {
        texture_shape(device, (side + 1) * (side + 1), "corner forces");
        FAIL() << "accepted";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), HasSubstr("corner forces"));
        EXPECT_THAT(error.what(), HasSubstr(std::to_string(side + 1)));
    }
}

template <class T>
class TextureTest : public RenderPassTest {};
using Texels = ::testing::Types<std::uint32_t, std::array<std::uint32_t, 2>, std::array<std::uint32_t, 4>, Float4>;
TYPED_TEST_SUITE(TextureTest, Texels);

// 1003 entries leave the last row of 32 incomplete.
TYPED_TEST(TextureTest, IsZeroAtFirstAndGivesBackWhatWasWritten) {
    Texture<TypeParam> texture(this->device, 1003, "values");
    EXPECT_THAT(texture.download(), ::testing::AllOf(::testing::SizeIs(1003), ::testing::Each(TypeParam{})));
    std::vector<std::uint32_t> words(1003 * sizeof(TypeParam) / 4);
    std::iota(words.begin(), words.end(), 0x3f800000u);  // as floats: finite, all different
    std::vector<TypeParam> values(1003);
    std::memcpy(values.data(), words.data(), 4 * words.size());
    texture.upload(values);
    EXPECT_EQ(texture.download(), values);
}

TEST_F(RenderPassTest, ATextureRefusesAnotherNumberOfValues) {
    Texture<std::uint32_t> texture(device, 3, "values");
    EXPECT_THROW(texture.upload(std::vector<std::uint32_t>(2)), InvalidInput);
    EXPECT_THROW(texture.upload(std::vector<std::uint32_t>(4)), InvalidInput);
}

TEST_F(RenderPassTest, DrawsEveryTexelOfEveryTarget) {
    const Texture<Float4> column(device, 1003, "columns"), row(device, 1003, "rows");
    const Framebuffer target(device, {&column, &row});
    const FragmentProgram program(device, compose(place, small_library()));
    program.set(0, 10.0F);
    program.draw(target);
    check_errors("test");
    const std::vector<Float4> columns = column.download(), rows = row.download();
    for (std::size_t i = 0; i < columns.size(); ++i) {
        ASSERT_EQ(columns[i], (Float4{static_cast<float>(i % 32) + 10.5F, 1, 0, 0})) << i;
        ASSERT_EQ(rows[i], (Float4{static_cast<float>(i / 32) + 10.5F, 2, 0, 0})) << i;
    }
}

// Without a barrier of ours each pass sees what the one before it wrote, values above 1 included.
TEST_F(RenderPassTest, PassesFollowEachOther) {
    Texture<Float4> a(device, 40000, "values");
    const Texture<Float4> b(device, 40000, "values");
    const Framebuffer to_a(device, {&a}), to_b(device, {&b});
    const FragmentProgram program(device, compose(twice, small_library()));
    a.upload(std::vector<Float4>(40000, Float4{1, -3, 0.5F, 0.25F}));
    for (int i = 0; i < 5; ++i) {
        a.bind(5);
        program.draw(to_b);
        b.bind(5);
        program.draw(to_a);
    }
    EXPECT_THAT(a.download(), ::testing::Each(Float4{1024, -3072, 512, 256}));
}

TEST_F(RenderPassTest, AProgramNamesItsSamplers) {
    const FragmentProgram program(device, compose(node_step_pass()));
    std::vector<std::string> names;
    for (const Sampler& sampler : program.samplers()) names.push_back(sampler.name);
    EXPECT_THAT(
        names, ::testing::ElementsAre("displacement", "increment", "inverse_mass", "node_elements", "force_coordinates",
                                      "corner_force_0", "corner_force_1", "corner_force_2", "corner_force_3"));
}

// Textures are bound once for both passes: a unit that they share for two names would serve one of them wrongly.
TEST_F(RenderPassTest, AUnitServesOneTextureInAllPasses) {
    std::map<int, std::string> texture_of_unit;
    for (const ProgramSource& source : {element_forces_pass(Law::NeoHookeanIso), node_step_pass()}) {
        const FragmentProgram program(device, compose(source));
        for (const Sampler& sampler : program.samplers())
            EXPECT_EQ(texture_of_unit.emplace(sampler.unit, sampler.name).first->second, sampler.name);
    }
    EXPECT_EQ(texture_of_unit.size(), 14u);
}

TEST_F(RenderPassTest, EveryRenderPassOfTheCatalogueCompilesOnThisDevice) {
    for (const ProgramSource& source : every_render_pass()) {
        if (source.stage != ShaderStage::Fragment) continue;
        EXPECT_NO_THROW(FragmentProgram(device, compose(source)));
    }
}

TEST_F(RenderPassTest, ReportsAnErrorByFileAndLine) {
    SourceLibrary library = small_library();
    library["chunks/factor.glsl"] = "// Line 1.\nvec4 twice(vec4 x) { return nonsense; }\n";
    try {
        const FragmentProgram program(device, compose(twice, library));
        FAIL() << "accepted";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), HasSubstr("refuses render_pass/twice.frag"));
        EXPECT_THAT(error.what(), HasSubstr("chunks/factor.glsl:2"));
    }
}

TEST_F(RenderPassTest, RefusesTargetsThatDoNotFitTogether) {
    const Texture<Float4> small(device, 10, "small values"), large(device, 1000, "large values");
    EXPECT_THROW(Framebuffer(device, {}), InvalidInput);
    EXPECT_THROW(Framebuffer(device, std::vector<const TextureStorage*>(9, &small)), InvalidInput);
    try {
        const Framebuffer target(device, {&small, &large});
        FAIL() << "accepted";
    } catch (const InvalidInput& error) {
        EXPECT_THAT(error.what(), HasSubstr("small values"));
        EXPECT_THAT(error.what(), HasSubstr("large values"));
    }
}

}  // namespace
}  // namespace tissuewarp::shaders
