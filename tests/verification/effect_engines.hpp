#pragma once
/// The engines that every effect is verified on.

#include "tests/verification/effect_cases.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cctype>
#include <string>
#include <tuple>

namespace tissuewarp::verification {

struct NamedEngine {
    std::string name;
    MakeEngine make;
};
inline void PrintTo(const NamedEngine& engine, std::ostream* out) {
    *out << engine.name;
}

inline const std::array<NamedEngine, 3> all_engines{
    NamedEngine{"CpuFloat64",
                [](const tled::RestState& rest) { return tled::make_cpu_engine(rest, tled::Scalar::Float64); }},
    NamedEngine{"CpuFloat32",
                [](const tled::RestState& rest) { return tled::make_cpu_engine(rest, tled::Scalar::Float32); }},
    NamedEngine{"Gpu", [](const tled::RestState& rest) { return tled::make_gpu_engine(rest); }}};

class Effects : public ::testing::TestWithParam<std::tuple<NamedEngine, EffectCase>> {};

inline std::string name_of_effect(const ::testing::TestParamInfo<Effects::ParamType>& each) {
    const auto& [engine, effect] = each.param;
    std::string name = engine.name + "_" + effect.effect + "_" + effect.quantity;
    for (char& c : name)
        if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
    return name;
}

}  // namespace tissuewarp::verification
