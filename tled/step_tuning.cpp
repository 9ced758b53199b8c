#include "tled/step_tuning.hpp"

#include "core/errors.hpp"
#include "shaders/device.hpp"
#include "tled/critical_step.hpp"
#include "tled/detail/gpu_patches.hpp"
#include "tled/detail/step_shapes.hpp"
#include "tled/step_shape_cache.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <span>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;

constexpr int workgroups[] = {128, 320, 512, 640, 768};

/// The largest up to `most` that a patch can occupy: about one invocation for each tetrahedron and node.
int useful_workgroup(int most, int patch_tets) {
    int useful = workgroups[0];
    for (const int workgroup : workgroups)
        if (workgroup <= most && workgroup <= 1.3 * patch_tets) useful = workgroup;
    return useful;
}

/// Workgroups beyond the number of patches are not started.
bool steps_alike(GpuStepShape a, GpuStepShape b, int element_count) {
    for (GpuStepShape* shape : {&a, &b})
        if (shape->patch_tets > 0)
            shape->at_once = std::min(shape->at_once, (element_count - 1) / shape->patch_tets + 1);
    return a == b;
}

/// The next smaller and the next larger of rising values.
std::vector<int> neighbours(std::span<const int> values, int value) {
    std::vector<int> found;
    const auto at = std::lower_bound(values.begin(), values.end(), value);
    if (at != values.begin()) found.push_back(*std::prev(at));
    const auto above = at != values.end() && *at == value ? std::next(at) : at;
    if (above != values.end()) found.push_back(*above);
    return found;
}

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// What the steps compute: where they start, what is held, and how long they are.
struct TunedScene {
    NodalConditions conditions;
    Matrix3Xd start;
    StepCoefficients coefficients;
};

/// Stretched evenly and little, so that no element is near inversion whatever the mesh; damped as in the benchmarks.
TunedScene tuned_scene(const RestState& rest) {
    constexpr double stretch = 0.02, held = 0.05;   // of the longest side
    constexpr double safety = 0.9, damping = 0.01;  // of the elements' bound; α Δt/2
    const Eigen::Vector3d low = rest.position.rowwise().minCoeff(), size = rest.position.rowwise().maxCoeff() - low;
    int axis = 0;
    const double length = size.maxCoeff(&axis);
    TunedScene scene{nodal_conditions({}, rest.node_count), Matrix3Xd::Zero(3, rest.node_count), {}};
    for (int a = 0; a < rest.node_count; ++a) {
        const double along = (rest.position(axis, a) - low[axis]) / length;
        scene.start(axis, a) = stretch * length * along;
        if (along < held || along > 1 - held) scene.conditions.constrained.col(a).setConstant(true);
    }
    scene.conditions.imposed = scene.conditions.constrained.select(scene.start, Matrix3Xd::Zero(3, rest.node_count));
    const double density = rest.lumped_mass.sum() / rest.volume.sum();
    const double step = safety * element_step_bounds(rest, density).minCoeff();
    scene.coefficients = {(1 - damping) / (1 + damping), step * step / (1 + damping), step};
    return scene;
}

/// One shape on the scene.
class TimedShape {
public:
    TimedShape(const TunedScene& scene, std::unique_ptr<Engine> engine) : scene_(scene), engine_(std::move(engine)) {
        engine_->set_conditions(scene_.conditions);
    }

    Matrix3Xd after(int steps) {
        restart();
        engine_->run(steps, scene_.coefficients);
        return engine_->displacement();
    }

    /// Seconds per step, median.
    double time(const TuningEffort& effort, Observer& observer, double fraction) {
        const int steps = steps_of_a_run(effort.run_seconds);
        for (const double begin = now(); now() - begin < effort.warm_up_seconds;) {
            observer.checkpoint("warm-up", fraction);
            seconds(steps);
        }
        std::vector<double> runs;
        for (int i = 0; i < std::max(1, effort.runs); ++i) {
            observer.checkpoint("runs", fraction);
            runs.push_back(seconds(steps) / steps);
        }
        std::sort(runs.begin(), runs.end());
        return (runs[(runs.size() - 1) / 2] + runs[runs.size() / 2]) / 2;
    }

private:
    void restart() { engine_->set_state(scene_.start, Matrix3Xd::Zero(3, scene_.start.cols())); }

    /// The download that waits for the device is timed again alone and taken off.
    double seconds(int steps) {
        restart();
        (void)engine_->displacement();  // waits for the uploads
        const double begin = now();
        engine_->run(steps, scene_.coefficients);
        (void)engine_->displacement();
        const double middle = now();
        (void)engine_->displacement();
        return std::max(1e-9, (middle - begin) - (now() - middle));
    }

    /// So many that they take about `wanted` seconds: few steps say little, because they wait for the launch.
    int steps_of_a_run(double wanted) {
        constexpr int least = 5, most = 100000;
        int steps = least;
        for (;;) {
            const double taken = seconds(steps);
            if (taken > 0.7 * wanted || steps >= most) return steps;
            steps = std::min(most, static_cast<int>(steps * std::clamp(wanted / taken, 1.5, 20.0)) + 1);
        }
    }

    const TunedScene& scene_;
    std::unique_ptr<Engine> engine_;
};

/// Empty where the displacement is right.
std::string fault_of(const Matrix3Xd& u, const std::optional<Matrix3Xd>& expected, const TuningEffort& effort) {
    if (!u.allFinite()) return "its displacements are not finite";
    if (!expected) return "";
    const double difference = (u - *expected).cwiseAbs().maxCoeff() / expected->cwiseAbs().maxCoeff();
    if (difference <= effort.accepted_difference) return "";
    return "after " + std::to_string(effort.compared_steps) + " steps its displacements differ by " +
           std::to_string(difference) + " of the largest, more than " + std::to_string(effort.accepted_difference);
}

}  // namespace

GpuStepShape suggested_gpu_step_shape(int element_count, Element element, int multiprocessors) {
    // Patches in multiples of the multiprocessors, so that none of these idles; larger ones lose less at their surfaces
    // as long as their nodes fit into shared memory, of which a regular mesh has more than others; patches that do not
    // are made smaller. One workgroup of 640 always fits on a multiprocessor; two smaller ones may be faster, but
    // whether they fit depends on how many registers the compiler takes. From a few patches each on, memory is what
    // limits, and going round and round in one dispatch gains nothing: 2 were measured to be the faster, 4 and 6 the
    // slower. There averaged pressure takes patches that fit whole: of those that are split some workgroups get two.
    constexpr int largest_patch = detail::largest_patch_tets(Element::T4), few_each = 3;
    if (multiprocessors <= 0) multiprocessors = detail::default_multiprocessors;
    const int of_each = element_count / multiprocessors;
    const auto shared_out = [&](int patches) {
        return std::max(detail::least_patch_tets, (element_count + patches - 1) / patches);
    };
    const auto multiple = [&](int patches, int tets) { return patches * ((element_count - 1) / (patches * tets) + 1); };
    if (of_each < 150) return {shared_out(multiprocessors), 1, 128, 4 * multiprocessors};
    if (of_each < 900) return {shared_out(multiprocessors), 2, 512, multiprocessors};
    if (of_each < detail::largest_patch_tets(element)) return {shared_out(multiprocessors), 5, 640, multiprocessors};
    const int patches = multiple(multiprocessors, largest_patch);
    if (patches <= few_each * multiprocessors) return {shared_out(patches), 5, 640, multiprocessors};
    return {shared_out(multiple(multiprocessors, detail::largest_patch_tets(element))), 5, 768, 0};
}

std::vector<GpuStepShape> candidate_gpu_step_shapes(int element_count, Element element, int multiprocessors) {
    constexpr int fans[] = {1, 2, 5};
    constexpr int small = 300;  // tetrahedra of a patch: twice as many may lose less at its surface than they cost
    // Patches on a multiprocessor at the same time and the invocations for which it then has registers
    // (docs/decisions/gpu_patches.md).
    constexpr struct { int patches, workgroup; } sides[] = {{1, 640}, {2, 256}, {2, 320}, {4, 128}};
    const GpuStepShape suggested = suggested_gpu_step_shape(element_count, element, multiprocessors);
    const int m = multiprocessors > 0 ? multiprocessors : detail::default_multiprocessors;
    std::vector<GpuStepShape> shapes{{}, suggested};
    const auto add = [&](const GpuStepShape& shape) {
        const auto same = [&](const GpuStepShape& other) { return steps_alike(shape, other, element_count); };
        if (std::none_of(shapes.begin(), shapes.end(), same)) shapes.push_back(shape);
    };
    const auto varied = [&](int GpuStepShape::*knob, int value) {
        GpuStepShape shape = suggested;
        shape.*knob = value;
        add(shape);
    };
    for (const int fan : neighbours(fans, suggested.longest_fan)) varied(&GpuStepShape::longest_fan, fan);
    for (const int workgroup : neighbours(workgroups, suggested.workgroup)) varied(&GpuStepShape::workgroup, workgroup);
    varied(&GpuStepShape::at_once, suggested.at_once > 0 ? 0 : m);
    if (suggested.patch_tets < small)
        for (const int fan : fans) add({2 * suggested.patch_tets, fan, suggested.workgroup, suggested.at_once});
    for (const auto& side : sides) {
        // As many rounds of patches as their tetrahedra need room for.
        const int at_once = side.patches * m, room = detail::largest_patch_tets(element) / side.patches;
        const int rounds = (element_count - 1) / (at_once * room) + 1;
        const int tets = (element_count - 1) / (at_once * rounds) + 1;
        if (tets < detail::least_patch_tets) continue;
        add({tets, suggested.longest_fan, useful_workgroup(side.workgroup, tets), at_once});
        if (side.patches == 1) add({tets, suggested.longest_fan, useful_workgroup(768, tets), 0});
    }
    return shapes;
}

std::vector<StepShapeTiming> timed_gpu_step_shapes(const RestState& rest, const std::vector<GpuStepShape>& shapes,
                                                   const StepShapeEngine& make_engine, const TuningEffort& effort,
                                                   Observer& observer) {
    const TunedScene scene = tuned_scene(rest);
    std::vector<StepShapeTiming> timings;
    std::optional<Matrix3Xd> expected;
    for (const GpuStepShape& shape : shapes) {
        const double fraction = double(timings.size()) / double(shapes.size());
        observer.checkpoint("shape " + name_of(shape), fraction);
        StepShapeTiming timing{shape, 0, ""};
        try {
            TimedShape timed(scene, make_engine(shape));
            Matrix3Xd displacement = timed.after(effort.compared_steps);
            timing.fault = fault_of(displacement, expected, effort);
            if (timing.fault.empty()) {
                if (!expected) expected = std::move(displacement);
                timing.seconds_per_step = timed.time(effort, observer, fraction);
            }
        } catch (const GpuUnavailable& reason) {
            timing.fault = reason.what();
        } catch (const InvalidInput& reason) {
            timing.fault = reason.what();
        }
        if (!timing.fault.empty()) observer.note("shape " + name_of(shape) + " is out: " + timing.fault);
        timings.push_back(std::move(timing));
    }
    if (!expected)
        throw GpuUnavailable("no shape of GPU steps is left of " + std::to_string(shapes.size()) +
                             (timings.empty() ? "" : ": " + timings.back().fault) + "; take the CPU engine");
    std::stable_sort(timings.begin(), timings.end(), [](const StepShapeTiming& a, const StepShapeTiming& b) {
        if (a.fault.empty() != b.fault.empty()) return a.fault.empty();
        return a.seconds_per_step < b.seconds_per_step;
    });
    return timings;
}

std::vector<StepShapeTiming> tuned_gpu_step_shape(const RestState& rest, int device, Observer& observer,
                                                  const TuningEffort& effort) {
    int multiprocessors = 0;
    TuningEffort spent = effort;
    {
        const shaders::Device on(device);
        if (!detail::GpuPatches::suit(rest, on))
            throw InvalidInput("this scene takes two passes on " + on.renderer() +
                               " whatever the shape: patches know tetrahedra of one law; "
                               "there is nothing to tune");
        multiprocessors = on.limits().multiprocessors;
        if (!on.hardware()) spent.warm_up_seconds = 0;
    }
    return timed_gpu_step_shapes(
        rest, candidate_gpu_step_shapes(rest.element_count(), element_of(rest), multiprocessors),
        [&](const GpuStepShape& shape) { return make_gpu_engine(rest, device, shape); }, spent, observer);
}

}  // namespace tissuewarp::tled
