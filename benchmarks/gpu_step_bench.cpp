// Time of a step on the GPU, and how far its float32 strays from the float64 CPU engine. The cube of
// benchmarks/stretched_cube.hpp.
//     gpu_step_bench [--list] [--device N] [--cells 14,24,55,128] [--steps N] [--repeats N] [--compare-limit ELEMENTS]
//                    [--element t4|averaged] [--law lnj|iso] [--mesh FILE.vtu] [--shapes
//                    TETS:FAN:WORKGROUP[:AT_ONCE],…]
//                    [--render-passes] [--stretch 0.2] [--tissue [--only TEXT]]
// Without options: on hardware 14, 24, 55 and 128 cells an edge and 1000 steps, on a software rasteriser 14 and 24
// cells and 50 steps; five repeats, the median is printed; both elements, both laws. The float64 engine runs the same
// steps where the mesh has no more than --compare-limit elements (1 100 000, with --tissue 100 000). A mesh file of
// about that cube is measured after those of --cells. Shapes are those of tled::GpuStepShape, 0:0:0 the two passes;
// without them the suggested one. --render-passes adds the fragment shaders of 2007 for T4.
// --tissue times what fibres and viscosity cost instead: for each element all tissues of the cube in turn, with the
// ratio to plain neo-Hookean in the same shape, in the suggested shape and in others of its patches; 14, 24, 40 and 55
// cells. --only takes plain iso and the tissues whose names hold TEXT.

#include "benchmarks/stretched_cube.hpp"
#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"
#include "shaders/device.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/render_pass/render_pass_engine.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

using namespace tissuewarp;
using namespace tissuewarp::stretched_cube;
using Eigen::Matrix3Xd;

namespace {

struct Options {
    int device = -1;
    std::vector<int> cells;
    int steps = 0;
    int repeats = 5;
    int compare_limit = 0;     // 0: 1 100 000, with --tissue 100 000
    std::string element, law;  // empty: both
    std::string mesh;
    double stretch = default_stretch;
    std::vector<tled::GpuStepShape> shapes;  // empty: the suggested one
    bool render_passes = false;
    bool tissue = false;
    std::string only;  // with --tissue
};

void set_start(tled::Engine& engine, const Scene& scene) {
    engine.set_conditions(scene.conditions);
    engine.set_state(scene.start, Matrix3Xd::Zero(3, scene.start.cols()));
}

/// The render passes have their conditions from construction.
void set_start(tled::RenderPassEngine& engine, const Scene& scene) {
    engine.set_state(scene.start, Matrix3Xd::Zero(3, scene.start.cols()));
}

/// Seconds per step: the download that waits for the device is timed again alone and taken off.
template <class AnyEngine>
double timed_steps(AnyEngine& engine, int steps, const tled::StepCoefficients& step, Matrix3Xd& result) {
    const double begin = now();
    engine.run(steps, step);
    result = engine.displacement();
    const double middle = now();
    result = engine.displacement();
    return ((middle - begin) - (now() - middle)) / steps;
}

double difference_to_float64(const Scene& scene, const tled::RestState& rest, const Matrix3Xd& found, int steps) {
    const auto cpu = tled::make_cpu_engine(rest, tled::Scalar::Float64);
    set_start(*cpu, scene);
    cpu->run(steps, coefficients(rest));
    const Matrix3Xd exact = cpu->displacement();
    return (found - exact).cwiseAbs().maxCoeff() / exact.cwiseAbs().maxCoeff();
}

/// A device at rest takes most of a second to reach its clock under load.
constexpr double warm_up_seconds = 1;

/// One row of the table: an engine that took `start_seconds` to make.
template <class AnyEngine>
void report(AnyEngine& engine, double start_seconds, const Scene& scene, const tled::RestState& rest,
            const std::string& name, const std::string& mesh, const Options& options) {
    const tled::StepCoefficients step = coefficients(rest);
    Matrix3Xd result;
    set_start(engine, scene);
    for (const double start = now(); now() - start < warm_up_seconds;) timed_steps(engine, options.steps, step, result);
    std::vector<double> seconds;
    for (int repeat = 0; repeat < options.repeats; ++repeat) {
        set_start(engine, scene);
        seconds.push_back(timed_steps(engine, options.steps, step, result));
    }
    const double per_step = median(seconds);
    std::printf("| %-28s | %-8s | %9d | %9.2f | %9.1f | %6.2f | %6.3f ", name.c_str(), mesh.c_str(),
                rest.element_count(), per_step * 1e6, per_step / rest.element_count() * 1e12, start_seconds,
                tled::jacobians(rest, result).minCoeff());
    if (!result.allFinite())
        std::printf("| not finite |\n");
    else if (rest.element_count() > options.compare_limit)
        std::printf("| – |\n");
    else
        std::printf("| %.1e |\n", difference_to_float64(scene, rest, result, options.steps));
    std::fflush(stdout);
}

tled::GpuStepShape suggested_shape(const tled::RestState& rest, const Options& options) {
    return tled::suggested_gpu_step_shape(rest.element_count(), tled::element_of(rest),
                                          shaders::Device(options.device).limits().multiprocessors);
}

void report_engines(const Scene& scene, const tled::RestState& rest, const std::string& name, const std::string& mesh,
                    const Options& options) {
    std::vector<tled::GpuStepShape> shapes = options.shapes;
    if (shapes.empty()) shapes = {suggested_shape(rest, options)};
    for (const tled::GpuStepShape& shape : shapes) {
        const double begin = now();
        const auto gpu = tled::make_gpu_engine(rest, options.device, shape);
        report(*gpu, now() - begin, scene, rest, name + ", " + name_of(shape), mesh, options);
    }
    if (!options.render_passes || rest.pressure.count() > 0) return;
    const double begin = now();
    tled::RenderPassEngine passes(rest, scene.conditions, rest.lumped_mass.transpose().replicate(3, 1), options.device);
    report(passes, now() - begin, scene, rest, name + ", 2007", mesh, options);
}

void measure(const meshing::TetMesh& mesh, const std::string& mesh_name, const Options& options) {
    const Scene scene = stretched(mesh, options.stretch);
    for (const Variant& variant : variants(scene, options.element, options.law))
        report_engines(scene, variant.rest, variant.name, mesh_name, options);
}

/// The shapes in which tissue is timed: what more registers and shared memory for tissue ask for may differ.
std::vector<tled::GpuStepShape> tissue_shapes(const tled::RestState& rest, const Options& options) {
    if (!options.shapes.empty()) return options.shapes;
    const tled::GpuStepShape suggested = suggested_shape(rest, options);
    std::vector<tled::GpuStepShape> shapes{suggested};
    for (const int workgroup : {384, 512}) {
        shapes.push_back(suggested);
        shapes.back().workgroup = workgroup;
    }
    shapes.push_back(suggested);
    shapes.back().at_once = 0;
    if (rest.element_count() <= options.compare_limit) shapes.emplace_back();  // two passes
    std::vector<tled::GpuStepShape> different;
    for (const tled::GpuStepShape& shape : shapes)
        if (std::find(different.begin(), different.end(), shape) == different.end()) different.push_back(shape);
    return different;
}

/// Rows of one shape: all tissues in turn.
void report_tissues(const std::vector<Variant>& variants, const Scene& scene, const tled::GpuStepShape& shape,
                    const std::string& mesh, const Options& options) {
    std::vector<std::unique_ptr<tled::Engine>> engines;
    std::vector<Matrix3Xd> results(variants.size());
    std::vector<std::function<double()>> runs;
    for (std::size_t i = 0; i < variants.size(); ++i) {
        engines.push_back(tled::make_gpu_engine(variants[i].rest, options.device, shape));
        runs.emplace_back([&, i] {
            set_start(*engines[i], scene);
            return timed_steps(*engines[i], options.steps, coefficients(variants[i].rest), results[i]);
        });
    }
    for (const double start = now(); now() - start < warm_up_seconds;) in_turn(runs, 1);
    const std::vector<std::vector<double>> seconds = in_turn(runs, options.repeats);
    for (std::size_t i = 0; i < variants.size(); ++i) {
        const tled::RestState& rest = variants[i].rest;
        std::vector<double> ratios;
        for (std::size_t turn = 0; turn < seconds[i].size(); ++turn)
            ratios.push_back(seconds[i][turn] / seconds[0][turn]);
        const double per_step = median(seconds[i]);
        std::printf("| %-16s | %-8s | %9d | %-36s | %9.2f | %9.1f | %5.2f ", variants[i].name.c_str(), mesh.c_str(),
                    rest.element_count(),
                    engines[i]->description().substr(engines[i]->description().rfind(',') + 2).c_str(), per_step * 1e6,
                    per_step / rest.element_count() * 1e12, median(ratios));
        if (rest.element_count() > options.compare_limit)
            std::printf("| – |\n");
        else
            std::printf("| %.1e |\n", difference_to_float64(scene, rest, results[i], options.steps));
    }
    std::fflush(stdout);
}

void measure_tissue(const meshing::TetMesh& mesh, const std::string& mesh_name, const Options& options) {
    const Scene scene = stretched(mesh, options.stretch);
    for (const char* element : {"t4", "averaged"}) {
        if (!options.element.empty() && options.element != element) continue;
        std::vector<Variant> variants = tissues(scene, element);
        variants.erase(
            std::remove_if(variants.begin() + 1, variants.end(),
                           [&](const Variant& each) { return each.name.find(options.only) == each.name.npos; }),
            variants.end());
        std::fprintf(stderr, "%s: time step %.1f us\n", element, 1e6 * coefficients(variants.front().rest).time_step);
        for (const tled::GpuStepShape& shape : tissue_shapes(variants.front().rest, options)) try {
                report_tissues(variants, scene, shape, std::string(element) + " " + mesh_name, options);
            } catch (const GpuUnavailable& reason) {  // of this shape: the others may still run
                std::printf("| | %s | | %s | %s |\n", mesh_name.c_str(), name_of(shape).c_str(), reason.what());
            }
    }
}

void list_devices() {
    const auto devices = shaders::list_devices();
    if (devices.empty()) std::printf("no EGL device\n");
    for (const shaders::DeviceInfo& device : devices)
        std::printf("%d: %s, %s%s%s\n", device.index, device.name.c_str(), device.hardware ? "hardware" : "software",
                    device.problem.empty() ? "" : ", unusable: ", device.problem.c_str());
}

void print_head(const Options& options) {
    std::printf("%d steps, median of %d runs\n\n", options.steps, options.repeats);
    if (options.tissue)
        std::printf(
            "| tissue | mesh | elements | steps | µs/step | ps/element-step | over iso | largest difference to float64 "
            "/ "
            "largest displacement |\n|---|---|---|---|---|---|---|---|\n");
    else
        std::printf(
            "| element, law, engine | mesh | elements | µs/step | ps/element-step | start s | min J | largest "
            "difference "
            "to float64 / largest displacement |\n|---|---|---|---|---|---|---|---|\n");
}

Options parsed(int argc, char** argv) {
    Options options;
    for (int i = 1; i < argc; ++i) {
        const std::string name = argv[i];
        if (name == "--render-passes" || name == "--tissue") {
            (name == "--tissue" ? options.tissue : options.render_passes) = true;
            continue;
        }
        if (++i == argc) throw InvalidInput(name + " needs a value");
        const std::string value = argv[i];
        if (name == "--device")
            options.device = std::stoi(value);
        else if (name == "--steps")
            options.steps = std::stoi(value);
        else if (name == "--repeats")
            options.repeats = std::max(1, std::stoi(value));
        else if (name == "--compare-limit")
            options.compare_limit = std::stoi(value);
        else if (name == "--element")
            options.element = value;
        else if (name == "--law")
            options.law = value;
        else if (name == "--mesh")
            options.mesh = value;
        else if (name == "--only")
            options.only = value;
        else if (name == "--stretch")
            options.stretch = std::stod(value);
        else if (name == "--shapes") {
            std::istringstream list(value);
            tled::GpuStepShape shape;
            char colon = 0;
            for (std::string one; std::getline(list, one, ',');) {
                shape.at_once = 0;
                std::istringstream(one) >> shape.patch_tets >> colon >> shape.longest_fan >> colon >> shape.workgroup >>
                    colon >> shape.at_once;
                options.shapes.push_back(shape);
            }
        } else if (name == "--cells") {
            std::istringstream list(value);
            for (std::string cells; std::getline(list, cells, ',');) options.cells.push_back(std::stoi(cells));
        } else
            throw InvalidInput("unknown option " + name + "; the head of gpu_step_bench.cpp lists them");
    }
    return options;
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc > 1 && std::strcmp(argv[1], "--list") == 0) {
        list_devices();
        return 0;
    }
    Options options = parsed(argc, argv);
    bool hardware = false;
    {
        const shaders::Device device(options.device);
        hardware = device.hardware();
        std::printf("device %d: %s, %s, OpenGL %s, %s\n", device.index(), device.renderer().c_str(),
                    device.vendor().c_str(), device.version().c_str(), hardware ? "hardware" : "software");
    }
    if (options.cells.empty() && options.mesh.empty())
        options.cells = !hardware        ? std::vector<int>{14, 24}
                        : options.tissue ? std::vector<int>{14, 24, 40, 55}
                                         : std::vector<int>{14, 24, 55, 128};
    if (options.steps <= 0) options.steps = hardware ? 1000 : 50;
    if (options.compare_limit <= 0) options.compare_limit = options.tissue ? 100000 : 1100000;
    print_head(options);
    const auto each = options.tissue ? measure_tissue : measure;
    for (const int cells : options.cells)
        each(meshing::box_mesh({edge, edge, edge}, {cells, cells, cells}), std::to_string(cells) + " cells", options);
    if (!options.mesh.empty()) each(meshing::read_vtu(options.mesh), "file", options);
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "gpu_step_bench: %s\n", error.what());
    return 1;
}
