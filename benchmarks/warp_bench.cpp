// Time of a warp and how far the GPU's strays from the CPU's:
//     warp_bench [--gpu] [--device N] [--size 256] [--elements 100000] [--repeats 5] [--threads 2]
// An image of size³ voxels of 1 mm, value ±100, waves of 8 to 13 voxels; two meshes of about that many tetrahedra, both
// deformed by a smooth field of 8 mm: "full" holds every voxel, "organ" is a ball of 0.37 of the image's edge, so that
// four fifths of the voxels take the continuation outside of it. Best and median of the repeats, and the median of the
// time that all threads together spent on processors, which a busy machine does not stretch. With --gpu the field and
// the image of the device are compared with the CPU's in the same run; the exit code is 1 where they differ by more
// than the bounds below. The device's continuation is the CPU's field, given once before the clock starts.

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "registration/field.hpp"
#include "registration/gpu_warp.hpp"
#include "registration/warp.hpp"

#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

using namespace tissuewarp;
using namespace tissuewarp::registration;
using imaging::Geometry;
using imaging::Volume;

namespace {

/// What differs by more, in mm and in values between −100 and 100, may be one voxel component in 20 000: centres within
/// 1e-4 voxels of a surface, which may fall on either side of it, and only by the error of the continuation.
constexpr double field_bound = 1e-4, field_limit = 0.02;
constexpr double image_bound = 0.02, image_limit = 2.0;
constexpr double share_beyond = 5e-5;

struct Options {
    bool gpu = false;
    int device = -1, size = 256, elements = 100000, repeats = 5, threads = 2;
};

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Of all threads together.
double processor_seconds() {
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

struct Times {
    std::vector<double> wall, processor;  // seconds; the second may be missing
};

void print(const char* what, const Times& times) {
    std::printf("| %-46s | %9.3f | %9.3f |", what, 1e3 * *std::min_element(times.wall.begin(), times.wall.end()),
                1e3 * median(times.wall));
    if (times.processor.empty())
        std::printf("  |\n");
    else
        std::printf(" %9.3f |\n", 1e3 * median(times.processor));
    std::fflush(stdout);
}

/// Adds the times of one run of `work`.
void run_timed(Times& times, const std::function<void()>& work) {
    const double begin = now(), processor = processor_seconds();
    work();
    times.wall.push_back(now() - begin);
    times.processor.push_back(processor_seconds() - processor);
}

Volume waves(int size) {
    Geometry grid;
    grid.size = {size, size, size};
    grid.origin.setConstant(-0.5 * (size - 1));
    Volume image(grid, CV_32FC1);
    auto* voxel = image.data<float>();
    for (int k = 0; k < size; ++k)
        for (int j = 0; j < size; ++j)
            for (int i = 0; i < size; ++i)
                *voxel++ = static_cast<float>(100.0 * std::sin(0.75 * i + 0.1 * j) * std::cos(0.6 * j - 0.2 * k) *
                                              std::sin(0.5 * k + 0.05 * i));
    return image;
}

/// Six tetrahedra in each of cells³ cubes of a cube around the origin.
meshing::TetMesh cube_mesh(double edge, int elements, double jitter) {
    const int cells = std::max(1, static_cast<int>(std::lround(std::cbrt(elements / 6.0))));
    meshing::TetMesh mesh = meshing::box_mesh({edge, edge, edge}, {cells, cells, cells}, jitter);
    mesh.nodes.array() -= 0.5 * edge;
    return mesh;
}

/// The cube drawn out to a ball of that radius.
meshing::TetMesh ball_mesh(double radius, int elements) {
    meshing::TetMesh mesh = cube_mesh(2.0, elements, 0.0);
    for (auto node : mesh.nodes.colwise()) {
        const double length = node.norm();
        if (length > 0.0) node *= radius * node.cwiseAbs().maxCoeff() / length;
    }
    return mesh;
}

/// Displacements of up to 8 mm that vanish on the faces of a cube of that edge.
Deformation smoothly_deformed(const meshing::TetMesh& mesh, double edge) {
    Deformation deformation{mesh, Eigen::Matrix3Xd(3, mesh.node_count()), Eigen::Isometry3d::Identity()};
    for (int n = 0; n < mesh.node_count(); ++n) {
        const Eigen::Vector3d X = mesh.nodes.col(n);
        deformation.displacement.col(n) =
            8.0 * Eigen::Vector3d(std::sin(X[1] / 40.0), std::cos(X[2] / 45.0), std::sin(X[0] / 50.0)) *
            (X * EIGEN_PI / edge).array().cos().prod();
    }
    return deformation;
}

struct Difference {
    double largest = 0;
    long long beyond = 0, size = 0;  // components of float32 that differ by more than the bound, and all

    Difference(const Volume& a, const Volume& b, double bound)
        : size(static_cast<long long>(a.voxels.total()) * a.channels()) {
        for (long long n = 0; n < size; ++n) {
            const double difference = std::abs(double{a.data<float>()[n]} - b.data<float>()[n]);
            largest = std::max(largest, difference);
            beyond += !(difference <= bound);
        }
    }
    [[nodiscard]] bool good(double limit) const {
        return largest <= limit && static_cast<double>(beyond) <= share_beyond * static_cast<double>(size);
    }
};

/// Times and checks the device; false where it differs too much.
bool measure_gpu(const Deformation& deformation, const Volume& image, const Volume& field, const Volume& warped,
                 const Options& options) {
    GpuWarp gpu(deformation.mesh, image, image.geometry, {.gpu_index = options.device});
    gpu.set_continuation(field, deformation.placement);
    const Difference of_field(gpu.field(deformation.displacement, deformation.placement), field, field_bound);
    Volume result = gpu.warp(deformation.displacement, deformation.placement);
    const Volume first = result.clone();
    Times rasterise, resample, both, all;
    for (int repeat = 0; repeat < options.repeats; ++repeat) {
        run_timed(all, [&] { gpu.warp(deformation.displacement, deformation.placement, result); });
        rasterise.wall.push_back(gpu.report().rasterise_seconds);
        resample.wall.push_back(gpu.report().resample_seconds);
        both.wall.push_back(rasterise.wall.back() + resample.wall.back());
    }
    print("GPU: rasterise, device time", rasterise);
    print("GPU: resample, device time", resample);
    print("GPU: both, device time", both);
    print("GPU: both and transfers", all);
    const Difference of_image(result, warped, image_bound);
    const bool repeats = std::memcmp(result.voxels.data, first.voxels.data, result.voxels.total() * sizeof(float)) == 0;
    const bool good = of_field.good(field_limit) && of_image.good(image_limit) && repeats;
    std::printf(
        "\n%s, against the CPU: field %.1e mm at most, %lld of %lld beyond %.0e; image %.1e at most, %lld of %lld "
        "beyond %.0e; repeats %s: %s\n\n",
        gpu.device().c_str(), of_field.largest, of_field.beyond, of_field.size, field_bound, of_image.largest,
        of_image.beyond, of_image.size, image_bound, repeats ? "bit by bit" : "DIFFER", good ? "good" : "WRONG");
    return good;
}

bool measure(const char* name, const Deformation& deformation, const Volume& image, const Options& options) {
    std::printf("%s: %d tetrahedra, %d^3 voxels\n\n| | best, ms | median, ms | processor, ms |\n|---|---|---|---|\n",
                name, deformation.mesh.tet_count(), options.size);
    Volume field, warped;
    Times field_times, image_times, both;
    for (int repeat = 0; repeat < options.repeats; ++repeat)
        run_timed(both, [&] {
            run_timed(field_times, [&] { field = displacement_fixed_to_moving(deformation, image.geometry); });
            run_timed(image_times, [&] { warped = warp_image(image, field); });
        });
    print("CPU: field (rasterise, continue outside)", field_times);
    print("CPU: resample", image_times);
    print("CPU: both", both);
    if (options.gpu) return measure_gpu(deformation, image, field, warped, options);
    std::printf("\n");
    return true;
}

Options parsed(int argc, char** argv) {
    Options options;
    for (int a = 1; a < argc; ++a) {
        const std::string name = argv[a];
        if (name == "--gpu") {
            options.gpu = true;
            continue;
        }
        if (a + 1 == argc) throw InvalidInput(name + " wants a value; the head of warp_bench.cpp lists the options");
        const int value = std::stoi(argv[++a]);
        if (name == "--device")
            options.device = value;
        else if (name == "--size")
            options.size = value;
        else if (name == "--elements")
            options.elements = value;
        else if (name == "--repeats")
            options.repeats = std::max(1, value);
        else if (name == "--threads")
            options.threads = std::max(1, value);
        else
            throw InvalidInput("unknown option " + name + "; the head of warp_bench.cpp lists them");
    }
    return options;
}

}  // namespace

int main(int argc, char** argv) try {
    const Options options = parsed(argc, argv);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(options.threads));
    const Volume image = waves(options.size);
    std::printf("%d threads, %d repeats\n\n", options.threads, options.repeats);
    const double edge = options.size;
    const bool full = measure("full", smoothly_deformed(cube_mesh(edge, options.elements, 0.15), edge), image, options);
    Deformation ball = smoothly_deformed(ball_mesh(0.37 * edge, options.elements), edge);
    ball.placement.linear() = Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    ball.placement.translation() = Eigen::Vector3d(1.5, -2.0, 0.7);
    const bool organ = measure("organ", ball, image, options);
    return full && organ ? 0 : 1;
} catch (const std::exception& error) {
    std::fprintf(stderr, "warp_bench: %s\n", error.what());
    return 1;
}
