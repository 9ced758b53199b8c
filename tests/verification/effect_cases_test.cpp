/// Every effect against its verification case, on the engines.
#include "tests/verification/effect_cases.hpp"

#include <gtest/gtest.h>

#include <cctype>
#include <tuple>

namespace tissuewarp::verification {
namespace {

struct NamedEngine {
    const char* name;
    MakeEngine make;
};
const NamedEngine float64{
    "CpuFloat64", [](const tled::RestState& rest) { return tled::make_cpu_engine(rest, tled::Scalar::Float64); }};
const NamedEngine float32{
    "CpuFloat32", [](const tled::RestState& rest) { return tled::make_cpu_engine(rest, tled::Scalar::Float32); }};

void PrintTo(const NamedEngine& engine, std::ostream* out) {
    *out << engine.name;
}

class Effects : public ::testing::TestWithParam<std::tuple<NamedEngine, EffectCase>> {};
std::string name_of(const ::testing::TestParamInfo<Effects::ParamType>& each) {
    const auto& [engine, effect] = each.param;
    std::string name = std::string(engine.name) + "_" + effect.effect + "_" + effect.quantity;
    for (char& c : name)
        if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
    return name;
}
INSTANTIATE_TEST_SUITE_P(All, Effects,
                         ::testing::Combine(::testing::Values(float64, float32), ::testing::ValuesIn(effect_cases())),
                         name_of);

TEST_P(Effects, AnswersAsTheReference) {
    const auto& [engine, effect] = GetParam();
    EXPECT_NEAR(effect.measure(engine.make), effect.reference, effect.bound)
        << effect.scene << ", " << effect.quantity << " (" << effect.unit << "), from " << effect.source;
}

}  // namespace
}  // namespace tissuewarp::verification
