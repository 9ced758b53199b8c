/// Updates whose device fails on the way.
#include "registration/update.hpp"

#include "core/errors.hpp"
#include "tests/support/label_shapes.hpp"
#include "tled/engine.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd;

/// A device that has `runs` runs in it.
class Failing final : public tled::Engine {
public:
    Failing(const tled::RestState& rest, int runs) : engine_(tled::make_cpu_engine(rest)), runs_(runs) {}
    void set_conditions(const tled::NodalConditions& conditions) override { engine_->set_conditions(conditions); }
    void set_mass(const Matrix3Xd& mass) override { engine_->set_mass(mass); }
    void set_state(const Matrix3Xd& u, const Matrix3Xd& v) override { engine_->set_state(u, v); }
    void set_increment(const Matrix3Xd& v) override { engine_->set_increment(v); }
    void keep_state() override { engine_->keep_state(); }
    void return_to_kept_state() override { engine_->return_to_kept_state(); }
    void run(int steps, const tled::StepCoefficients& coefficients) override {
        if (--runs_ < 0) throw GpuUnavailable("the device has no memory left");
        engine_->run(steps, coefficients);
    }
    [[nodiscard]] Matrix3Xd displacement() const override { return engine_->displacement(); }
    [[nodiscard]] Matrix3Xd increment() const override { return engine_->increment(); }
    [[nodiscard]] Matrix3Xd residual() override { return engine_->residual(); }
    [[nodiscard]] Matrix3Xd internal_force() override { return engine_->internal_force(); }
    [[nodiscard]] tled::Observation observe() override { return engine_->observe(); }
    [[nodiscard]] tled::SmallestJacobian smallest_jacobian() override { return engine_->smallest_jacobian(); }
    [[nodiscard]] tled::CheckedDisplacement run_and_check(std::span<const tled::Steps> steps) override {
        for (const tled::Steps& each : steps) run(each.count, each.coefficients);
        return engine_->run_and_check({});
    }
    [[nodiscard]] bool admits_inversion() const override { return engine_->admits_inversion(); }
    [[nodiscard]] std::vector<tled::StepPass> step_passes() override { return engine_->step_passes(); }
    [[nodiscard]] std::string description() const override { return "a device that fails"; }
    [[nodiscard]] tled::Processor processor() const override { return engine_->processor(); }
    [[nodiscard]] double precision() const override { return engine_->precision(); }

private:
    std::unique_ptr<tled::Engine> engine_;
    int runs_;
};

struct Listener : Observer {
    std::vector<std::string> notes;
    void note(std::string_view message) override { notes.emplace_back(message); }
};

class UpdaterOnAFailingDevice : public ::testing::Test {
protected:
    std::shared_ptr<const PreparedModel> prepared = std::make_shared<const PreparedModel>(prepared_organ());
    Intraoperative seen{.labels = shapes::organ_labels({}, shapes::motion(5, {0, 0, 1}, {2, 1, 0}))};
    Listener listener;

    static PreparedModel prepared_organ() {
        PrepareOptions options;
        options.meshing.edge_length = 9;
        return prepare(shapes::organ_labels({}), options);
    }
    [[nodiscard]] Updater updater(Device device) const {
        UpdateOptions options;
        options.device = device;
        return {prepared, options, std::make_unique<Failing>(prepared->rest, 3)};
    }
};

TEST_F(UpdaterOnAFailingDevice, GoesOnWithTheProcessor) {
    UpdateOptions on_cpu;
    on_cpu.device = Device::Cpu;
    const Matrix3Xd expected = update(*prepared, seen, on_cpu).deformation.displacement;
    Updater failing = updater(Device::Auto);
    const UpdateResult first = failing.update(seen, listener);
    EXPECT_EQ(first.deformation.displacement, expected);
    EXPECT_NE(first.engine, "a device that fails");
    EXPECT_THAT(listener.notes, ::testing::Contains(::testing::HasSubstr("no memory left")));
    listener.notes.clear();
    EXPECT_EQ(failing.update(seen, listener).deformation.displacement, expected);
    EXPECT_THAT(listener.notes, ::testing::Not(::testing::Contains(::testing::HasSubstr("takes over"))));
}

TEST_F(UpdaterOnAFailingDevice, SaysSoWhereTheDeviceWasDemanded) {
    Updater failing = updater(Device::Gpu);
    EXPECT_THROW((void)failing.update(seen, listener), GpuUnavailable);
}

}  // namespace
}  // namespace tissuewarp::registration
