// Time of an explicit step on the CPU by instruction set and number of threads, beside a plain scalar loop, and how far
// float32 strays from float64. The cube of benchmarks/stretched_cube.hpp.
//     cpu_step_bench [--cells 14,24,55] [--threads 1,2] [--steps N] [--runs N] [--checked-steps N]
//                    [--element t4|averaged] [--law lnj|iso] [--targets AVX3,AVX2,SSE4] [--plain] [--tissue]
// A row has the fewest and the median nanoseconds per element-step of --runs (200) runs of --steps (2) steps each by
// the clock, and the mean processor time of all threads. Where others use the machine, the fewest are the engine's own,
// of runs short enough to fall between theirs. Then the seconds to make the engine and, after --checked-steps (1000; 0
// for none) steps, the difference to the float64 engine over the largest displacement, and whether every number of
// threads and a repeat give the same bits. --plain adds the scalar loop. --tissue times what fibres and viscosity cost
// instead: all tissues of the cube in turns of ten runs, with the ratio of their fewest and of their median turn to
// plain neo-Hookean's; the widest instruction set, T4 unless --element says averaged, two turns for every ten of
// --runs.

#include "benchmarks/stretched_cube.hpp"
#include "core/errors.hpp"
#include "meshing/primitives.hpp"

#include <hwy/highway.h>
#include <oneapi/tbb/global_control.h>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

using namespace tissuewarp;
using namespace tissuewarp::stretched_cube;
using Eigen::Matrix3f;
using Eigen::Matrix3Xd;

namespace {

struct Options {
    std::vector<std::string> cells{"14", "24", "55"}, threads{"1", "2"}, targets;  // no targets: all of the machine
    int steps = 2;
    int runs = 200;
    int checked_steps = 1000;
    std::string element, law;  // empty: both
    bool plain = false;
    bool tissue = false;
};

double processor_seconds() {
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
}

struct Timing {
    double fewest, median, processor;  // ns per element-step
};

template <class Run>
Timing timed(int runs, double element_steps, const Run& run) {
    run();
    std::vector<double> wall;
    const double begin_processor = processor_seconds();
    for (int i = 0; i < runs; ++i) {
        const double begin = now();
        run();
        wall.push_back((now() - begin) / element_steps * 1e9);
    }
    return {*std::min_element(wall.begin(), wall.end()), median(wall),
            (processor_seconds() - begin_processor) / (runs * element_steps) * 1e9};
}

void print_row(const std::string& name, int cells, const std::string& engine, const Timing& timing,
               double start_seconds, const std::string& difference) {
    std::printf("| %-12s | %2d | %-16s | %6.2f | %6.2f | %6.2f | %5.2f | %-14s |\n", name.c_str(), cells,
                engine.c_str(), timing.fewest, timing.median, timing.processor, start_seconds, difference.c_str());
    std::fflush(stdout);
}

void set_start(tled::Engine& engine, const Scene& scene) {
    engine.set_conditions(scene.conditions);
    engine.set_state(scene.start, Matrix3Xd::Zero(3, scene.start.cols()));
}

Matrix3Xd displacement_after(tled::Engine& engine, const Scene& scene, int steps, const tled::StepCoefficients& step) {
    set_start(engine, scene);
    engine.run(steps, step);
    return engine.displacement();
}

/// The step as it is written without SIMD, threads or an order of the nodes: T4 under the lnJ law in float32, elements
/// one after another, forces added to the nodes at once.
class PlainLoop {
public:
    PlainLoop(const tled::RestState& rest, const Scene& scene)
        : rest_(rest),
          gradient_(rest.gradient.cast<float>()),
          volume_(rest.volume.cast<float>()),
          inverse_mass_(rest.lumped_mass.cwiseInverse().cast<float>()),
          free_((1 - scene.conditions.constrained.cast<float>().array()).matrix()),
          u_(scene.start.cast<float>()),
          v_(Eigen::Matrix3Xf::Zero(3, rest.node_count)),
          force_(v_) {}

    void run(int steps, const tled::StepCoefficients& coefficients) {
        for (int step = 0; step < steps; ++step) {
            force_.setZero();
            for (int e = 0; e < rest_.element_count(); ++e) add_forces(e);
            const auto rate = force_.array().rowwise() * inverse_mass_.transpose().array();
            v_ = (free_.array() * (float(coefficients.momentum) * v_.array() - float(coefficients.gain) * rate))
                     .matrix();
            u_ += v_;
        }
    }

    [[nodiscard]] Matrix3Xd displacement() const { return u_.cast<double>(); }

private:
    const tled::RestState& rest_;
    Eigen::Matrix<float, 9, Eigen::Dynamic> gradient_;
    Eigen::VectorXf volume_, inverse_mass_;
    Eigen::Matrix3Xf free_, u_, v_, force_;

    void add_forces(int e) {
        const auto node = rest_.nodes.col(e);
        Matrix3f difference;
        for (int k = 0; k < 3; ++k) difference.col(k) = u_.col(node[k + 1]) - u_.col(node[0]);
        const Matrix3f G = gradient_.col(e).reshaped<Eigen::RowMajor>(3, 3);  // row k: ∂N_{k+1}/∂X
        const Matrix3f F = Matrix3f::Identity() + difference * G;
        const float J = F.determinant();
        const Matrix3f F_inverse_transposed = F.inverse().transpose();
        const Matrix3f P =
            float(shear) * (F - F_inverse_transposed) + float(lambda) * std::log(J) * F_inverse_transposed;
        const Matrix3f f = volume_[e] * P * G.transpose();
        for (int k = 0; k < 3; ++k) force_.col(node[k + 1]) += f.col(k);
        force_.col(node[0]) -= f.rowwise().sum();
    }
};

std::string difference_text(const Matrix3Xd& found, const Matrix3Xd& exact) {
    if (exact.size() == 0) return "–";
    char text[32];
    std::snprintf(text, sizeof text, "%.1e", (found - exact).cwiseAbs().maxCoeff() / exact.cwiseAbs().maxCoeff());
    return text;
}

/// Leaves `target` the widest that Highway may choose; an empty name leaves all.
void use_target(std::int64_t target) {
    hwy::DisableTargets(0);
    hwy::DisableTargets(target == 0 ? 0 : target - 1);  // a wider set has a lower bit
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

std::vector<std::int64_t> targets(const Options& options) {
    use_target(0);
    std::vector<std::int64_t> result;
    for (std::int64_t rest = hwy::SupportedTargets() & HWY_TARGETS; rest != 0; rest &= rest - 1) {
        const std::int64_t target = rest & -rest;
        const bool wanted = std::count(options.targets.begin(), options.targets.end(), hwy::TargetName(target)) > 0;
        if (wanted || options.targets.empty()) result.push_back(target);
    }
    if (result.empty()) throw InvalidInput("this machine has none of the instruction sets of --targets");
    return result;
}

void measure_engines(const Scene& scene, const Variant& variant, int cells, const Matrix3Xd& exact,
                     const Options& options) {
    const tled::RestState& rest = variant.rest;
    const tled::StepCoefficients step = coefficients(rest);
    for (const std::int64_t target : targets(options)) {
        use_target(target);
        Matrix3Xd first;
        for (const std::string& threads : options.threads) {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::stoul(threads));
            const double begin = now();
            const auto engine = tled::make_cpu_engine(rest);
            const double start_seconds = now() - begin;
            set_start(*engine, scene);
            const Timing timing = timed(options.runs, double(options.steps) * rest.element_count(),
                                        [&] { engine->run(options.steps, step); });
            std::string difference = "–";
            if (options.checked_steps > 0) {
                const Matrix3Xd u = displacement_after(*engine, scene, options.checked_steps, step);
                if (first.size() == 0) first = u;
                const bool same =
                    u == first && displacement_after(*engine, scene, options.checked_steps, step) == first;
                difference = difference_text(u, exact) + (same ? ", same" : ", OTHER BITS");
            }
            print_row(variant.name, cells, std::string(hwy::TargetName(target)) + ", " + threads + " thr.", timing,
                      start_seconds, difference);
        }
    }
    use_target(0);
}

void measure(int cells, const Options& options) {
    const Scene scene = stretched(meshing::box_mesh({edge, edge, edge}, {cells, cells, cells}));
    for (const Variant& variant : variants(scene, options.element, options.law)) {
        const tled::RestState& rest = variant.rest;
        Matrix3Xd exact;
        if (options.checked_steps > 0)
            exact = displacement_after(*tled::make_cpu_engine(rest, tled::Scalar::Float64), scene,
                                       options.checked_steps, coefficients(rest));
        if (options.plain && variant.name == "T4 lnJ") {
            const tled::StepCoefficients step = coefficients(rest);
            PlainLoop plain(rest, scene);
            const Timing timing = timed(std::min(options.runs, 10), double(options.steps) * rest.element_count(),
                                        [&] { plain.run(options.steps, step); });
            PlainLoop again(rest, scene);
            again.run(options.checked_steps, step);
            print_row(variant.name, cells, "plain loop", timing, 0, difference_text(again.displacement(), exact));
        }
        measure_engines(scene, variant, cells, exact, options);
    }
}

/// Fewest nanoseconds per element-step of ten runs, after one that fills the caches.
double turn_of(tled::Engine& engine, const tled::RestState& rest, int steps) {
    const tled::StepCoefficients step = coefficients(rest);
    return timed(10, double(steps) * rest.element_count(), [&] { engine.run(steps, step); }).fewest;
}

void measure_tissues(int cells, const Options& options) {
    const Scene scene = stretched(meshing::box_mesh({edge, edge, edge}, {cells, cells, cells}));
    const std::vector<Variant> variants = tissues(scene, options.element);
    std::fprintf(stderr, "time step %.1f us\n", 1e6 * coefficients(variants.front().rest).time_step);
    for (const std::string& threads : options.threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::stoul(threads));
        std::vector<std::unique_ptr<tled::Engine>> engines;
        std::vector<std::function<double()>> turns;
        for (const Variant& variant : variants) {
            engines.push_back(tled::make_cpu_engine(variant.rest));
            set_start(*engines.back(), scene);
            turns.emplace_back([engine = engines.back().get(), &variant, &options] {
                return turn_of(*engine, variant.rest, options.steps);
            });
        }
        const std::vector<std::vector<double>> times = in_turn(turns, std::max(1, options.runs / 5));
        const auto fewest = [&](std::size_t i) { return *std::min_element(times[i].begin(), times[i].end()); };
        for (std::size_t i = 0; i < variants.size(); ++i) {
            std::vector<double> ratios;
            for (std::size_t turn = 0; turn < times[i].size(); ++turn)
                ratios.push_back(times[i][turn] / times[0][turn]);
            std::printf("| %-16s | %2d | %s thr. | %6.2f | %6.2f | %5.2f | %5.2f |\n", variants[i].name.c_str(), cells,
                        threads.c_str(), fewest(i), median(times[i]), fewest(i) / fewest(0), median(ratios));
        }
        std::fflush(stdout);
    }
}

void print_head(const Options& options) {
    std::printf("%d runs of %d steps, ns per element-step\n\n", options.runs, options.steps);
    std::printf(options.tissue
                    ? "| tissue | cells | threads | fewest | median | fewest over iso | median over iso |\n"
                      "|---|---|---|---|---|---|---|\n"
                    : "| element, law | cells | engine | fewest | median | processor | start s | difference |\n"
                      "|---|---|---|---|---|---|---|---|\n");
}

std::vector<std::string> split(const std::string& list) {
    std::vector<std::string> parts;
    std::istringstream stream(list);
    for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
    return parts;
}

Options parsed(int argc, char** argv) {
    Options options;
    for (int i = 1; i < argc; ++i) {
        const std::string name = argv[i];
        if (name == "--plain" || name == "--tissue") {
            (name == "--plain" ? options.plain : options.tissue) = true;
            continue;
        }
        if (++i == argc) throw InvalidInput(name + " needs a value");
        const std::string value = argv[i];
        if (name == "--cells")
            options.cells = split(value);
        else if (name == "--threads")
            options.threads = split(value);
        else if (name == "--targets")
            options.targets = split(value);
        else if (name == "--steps")
            options.steps = std::max(1, std::stoi(value));
        else if (name == "--runs")
            options.runs = std::max(1, std::stoi(value));
        else if (name == "--checked-steps")
            options.checked_steps = std::stoi(value);
        else if (name == "--element")
            options.element = value;
        else if (name == "--law")
            options.law = value;
        else
            throw InvalidInput("unknown option " + name + "; the head of cpu_step_bench.cpp lists them");
    }
    return options;
}

}  // namespace

int main(int argc, char** argv) try {
    const Options options = parsed(argc, argv);
    print_head(options);
    const auto each = options.tissue ? measure_tissues : measure;
    for (const std::string& cells : options.cells) each(std::stoi(cells), options);
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "cpu_step_bench: %s\n", error.what());
    return 1;
}
