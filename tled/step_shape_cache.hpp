#pragma once
/// Shapes of GPU steps that were measured (step_tuning.hpp), kept in a file of the user for later runs.

#include "tled/engine.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::tled {

/// What decides which shape is fast, beside the mesh.
struct StepDevice {
    std::string name, driver;  ///< renderer and version strings of OpenGL
    int multiprocessors = 0;   ///< 0 where unknown
    bool hardware = false;
};
/// `device` as in make_gpu_engine. Throws GpuUnavailable.
StepDevice step_device(int device = -1);

/// Element::AveragedPressureT4 where the model averages its pressure.
Element element_of(const RestState& rest);

/// The fastest shape for one mesh on one device.
struct MeasuredStepShape {
    std::string device, driver;
    Element element = Element::T4;
    int tetrahedra = 0;
    GpuStepShape shape{};
    double seconds_per_step = 0;
};

struct StepShapeCache {
    std::vector<MeasuredStepShape> shapes;
    int skipped = 0;  ///< lines of the file that could not be used
};

/// gpu_step_shapes.tsv as user_cache_file (core/user_cache.hpp) places it; empty where there is no place.
std::filesystem::path step_shape_cache_path();

/// Never fails: nothing where there is no file; lines that are damaged or that hold what no measurement gives are
/// skipped and counted.
StepShapeCache read_step_shape_cache(const std::filesystem::path& path);

/// Makes the folder and replaces the file at once. Throws IoError.
void write_step_shape_cache(const StepShapeCache& cache, const std::filesystem::path& path);

/// Adds a measurement, in place of an older one for the same device, driver, element and number of tetrahedra.
void keep(StepShapeCache& cache, MeasuredStepShape measured);

struct KnownStepShape {
    GpuStepShape shape;
    bool measured = false;  ///< otherwise suggested_gpu_step_shape
};
/// Of the shapes that were measured with this element on this device and driver that of the nearest number of
/// tetrahedra, at most 1.5 times more or fewer, with the size of its patches changed such that their number stays.
/// Where there is none, or its patches would grow beyond what a workgroup has room for, the suggested shape.
KnownStepShape best_known_gpu_step_shape(int element_count, Element element, const StepDevice& device,
                                         const StepShapeCache& cache);

/// "two passes", "2910:5:640" (tetrahedra, fan, workgroup) or "2910:5:640:132" (workgroups at once).
std::string name_of(const GpuStepShape& shape);

}  // namespace tissuewarp::tled
