/// What the CPU engine alone promises: the same on every instruction set and the same bits on any number of threads.
#include "tests/tled/engine_scene.hpp"

#include <gmock/gmock.h>
#include <hwy/highway.h>
#include <oneapi/tbb/global_control.h>

#include <string>
#include <vector>

namespace tissuewarp::tled {
namespace {

using namespace scene;

/// While it lives, `target` is the widest instruction set that Highway chooses; wider sets have lower bits.
class WidestTarget {
public:
    explicit WidestTarget(std::int64_t target) {
        hwy::DisableTargets(target - 1);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    }
    ~WidestTarget() {
        hwy::DisableTargets(0);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    }
    WidestTarget(const WidestTarget&) = delete;
    WidestTarget& operator=(const WidestTarget&) = delete;
};

std::vector<std::int64_t> targets() {
    std::vector<std::int64_t> result;
    for (std::int64_t rest = hwy::SupportedTargets() & HWY_TARGETS; rest != 0; rest &= rest - 1)
        result.push_back(rest & -rest);
    return result;
}

class CpuEngines : public ::testing::TestWithParam<std::tuple<Element, Laws>> {
protected:
    Model model = cube(5, std::get<0>(GetParam()), std::get<1>(GetParam()));
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;
    Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
};

INSTANTIATE_TEST_SUITE_P(All, CpuEngines,
                         ::testing::Combine(::testing::Values(Element::T4, Element::AveragedPressureT4),
                                            ::testing::Values(Laws::LnJ, Laws::Iso, Laws::Stable, Laws::ArrudaBoyce,
                                                              Laws::Ogden, Laws::Fibres)),
                         [](const auto& each) {
                             return std::string(name_of(std::get<0>(each.param))) + name_of(std::get<1>(each.param));
                         });

TEST_P(CpuEngines, EveryInstructionSetGivesTheReferencesForce) {
    const Matrix3Xd u = wavy(X).cast<float>().cast<double>(), expected = internal_force(rest, u);
    for (const std::int64_t target : targets())
        for (const Scalar scalar : {Scalar::Float32, Scalar::Float64}) {
            const WidestTarget widest(target);
            const auto engine = make_cpu_engine(rest, scalar);
            ASSERT_THAT(engine->description(), ::testing::HasSubstr(hwy::TargetName(target)));
            engine->set_state(u, zero);
            const double tolerance = scalar == Scalar::Float32 ? 1e-5 : 1e-12;
            EXPECT_LT(largest(engine->internal_force() - expected), tolerance * largest(expected));
        }
}

// A failure looks like: sums whose order depends on which thread comes first.
TEST_P(CpuEngines, StepsHaveTheSameBitsOnAnyNumberOfThreads) {
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    const auto engine = make_cpu_engine(rest);
    engine->set_conditions(conditions);
    const auto run = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        engine->set_state(wavy(X, 0.3), zero);
        engine->run(50, stable_coefficients(model, rest));
        return engine->displacement();
    };
    const Matrix3Xd alone = run(1);
    EXPECT_EQ(run(2), alone);
    EXPECT_EQ(run(7), alone);
}

// The float32 logarithm of the CPU's laws, on both sides of the powers of two where its argument is split. A failure
// looks like: a pressure that is wrong for compressed or much expanded tissue only.
TEST(CpuEngine, PressureOfAUniformExpansionIsTheReferences) {
    const Model model = cube(2, Element::T4, Laws::LnJ);
    const RestState rest = rest_state(model);
    const auto engine = make_cpu_engine(rest);
    for (double J = 0.05; J < 20; J *= 1.07) {
        const Matrix3Xd u = ((std::cbrt(J) - 1) * model.mesh.nodes).cast<float>().cast<double>();
        engine->set_state(u, Matrix3Xd::Zero(3, rest.node_count));
        const Matrix3Xd expected = internal_force(rest, u);
        EXPECT_LT(largest(engine->internal_force() - expected), 2e-5 * largest(expected)) << J;
    }
}

// The power of J that the isochoric law takes from the bits of a float32. Poisson's ratio 0: at the default of soft
// tissue the pressure would hide an error of the shear stress. A failure looks like: stiffness that jumps with the
// volume.
TEST(CpuEngine, ShearStressOfExpandedTissueIsTheReferences) {
    Model model = cube(2, Element::T4, Laws::Iso);
    model.materials = {{1, neo_hookean_iso(3.0, 0.0)}, {2, neo_hookean_iso(6.0, 0.0)}};
    const RestState rest = rest_state(model);
    Matrix3d stretch = Eigen::Vector3d(1.3, 1.0, 1 / 1.3).asDiagonal();
    stretch(0, 1) = 0.2;
    for (const std::int64_t target : targets()) {
        const WidestTarget widest(target);
        const auto engine = make_cpu_engine(rest);
        for (double J = 0.05; J < 20; J *= 1.07) {
            const Matrix3d H = std::cbrt(J) * stretch - Matrix3d::Identity();
            const Matrix3Xd u = (H * model.mesh.nodes).cast<float>().cast<double>();
            engine->set_state(u, Matrix3Xd::Zero(3, rest.node_count));
            const Matrix3Xd expected = internal_force(rest, u);
            EXPECT_LT(largest(engine->internal_force() - expected), 2e-5 * largest(expected)) << J;
        }
    }
}

}  // namespace
}  // namespace tissuewarp::tled
