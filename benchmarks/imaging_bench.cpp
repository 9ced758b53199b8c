/// Filters and files on the sizes of a head scan: imaging_bench [--benchmark_filter=...]
/// The column CPU is the time of all threads together.

#include "imaging/filters.hpp"
#include "imaging/image_io.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"

#include <benchmark/benchmark.h>
#include <Eigen/Geometry>

#include <unistd.h>
#include <filesystem>

using namespace tissuewarp::imaging;

namespace {

Geometry cube(int n) {
    Geometry grid;
    grid.size = {n, n, n};
    return grid;
}

Volume noise(const Geometry& grid, int type) {
    Volume volume(grid, type);
    cv::RNG(1).fill(volume.voxels, cv::RNG::UNIFORM, 0.0F, 100.0F);
    return volume;
}

Volume ball(int n) {
    Volume mask(cube(n), CV_8U);
    for (int k = 0; k < n; ++k)
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i)
                mask.data<std::uint8_t>()[mask.offset(i, j, k)] =
                    (Eigen::Vector3d(i, j, k) - Eigen::Vector3d::Constant(0.5 * n)).norm() < 0.35 * n;
    return mask;
}

void smooth_256(benchmark::State& state) {
    const Volume image = noise(cube(256), CV_32F);
    for (auto _ : state) benchmark::DoNotOptimize(smooth(image, 2.0));
}

void resample_256(benchmark::State& state) {
    const Volume image = noise(cube(256), CV_32F);
    Geometry grid = cube(256);
    grid.direction = Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    for (auto _ : state) benchmark::DoNotOptimize(resample(image, grid, Interpolation::Linear));
}

void gradient_256(benchmark::State& state) {
    const Volume image = noise(cube(256), CV_32F);
    for (auto _ : state) benchmark::DoNotOptimize(gradient(image));
}

void signed_distance_256(benchmark::State& state) {
    const Volume mask = ball(256);
    for (auto _ : state) benchmark::DoNotOptimize(signed_distance(mask));
}

void dilate_256(benchmark::State& state) {
    const Volume mask = ball(256);
    for (auto _ : state) benchmark::DoNotOptimize(dilate(mask, 5.0));
}

void connected_components_256(benchmark::State& state) {
    const Volume mask = ball(256);
    for (auto _ : state) benchmark::DoNotOptimize(connected_components(mask));
}

void linear_sampler_million(benchmark::State& state) {
    const Volume image = noise(cube(256), CV_32F);
    const LinearSampler sampler(image);
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    for (auto _ : state) {
        double sum = 0.0;
        for (int n = 0; n < 1'000'000; ++n)
            sum += sampler.value_and_gradient(turn * Eigen::Vector3d(n % 100, n / 100 % 100, n / 10000)).gradient[0];
        benchmark::DoNotOptimize(sum);
    }
}

/// A smooth field with the noise of float32 in its last digits: what a displacement field is to a compressor.
Volume displacement_field() {
    Geometry grid;
    grid.size = {175, 212, 170};
    Volume field = noise(grid, CV_32FC3);
    const Eigen::Vector3d centre(90, 100, 85);
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                field.voxels.at<cv::Vec3f>(k, j, i) *=
                    1e-3F +
                    0.1F * static_cast<float>(std::exp(-1e-3 * (Eigen::Vector3d(i, j, k) - centre).squaredNorm()));
    return field;
}

void write_and_read(benchmark::State& state, const char* extension, bool write) {
    const auto path =
        std::filesystem::temp_directory_path() / ("imaging_bench-" + std::to_string(::getpid()) + extension);
    const Volume field = displacement_field();
    write_volume(field, path);
    for (auto _ : state) {
        if (write)
            write_volume(field, path);
        else
            benchmark::DoNotOptimize(read_volume(path));
    }
    state.counters["MB"] = static_cast<double>(std::filesystem::file_size(path)) / 1e6;
    std::filesystem::remove(path);
}

}  // namespace

#define MEASURED(name) BENCHMARK(name)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime()
MEASURED(smooth_256);
MEASURED(resample_256);
MEASURED(gradient_256);
MEASURED(signed_distance_256);
MEASURED(dilate_256);
MEASURED(connected_components_256);
MEASURED(linear_sampler_million);
BENCHMARK_CAPTURE(write_and_read, write_nii_gz, ".nii.gz", true)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK_CAPTURE(write_and_read, read_nii_gz, ".nii.gz", false)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK_CAPTURE(write_and_read, write_nrrd, ".nrrd", true)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK_CAPTURE(write_and_read, read_nrrd, ".nrrd", false)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK_CAPTURE(write_and_read, write_mha, ".mha", true)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK_CAPTURE(write_and_read, read_mha, ".mha", false)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK_MAIN();
