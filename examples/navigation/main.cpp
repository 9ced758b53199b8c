// A navigation program in one page: a model prepared and saved before the operation, loaded during it, registered to an
// intraoperative image and then to points of the exposed surface, and asked how far its answers can be trusted.
//     navigation preop.nii.gz preop_labels.nii.gz intraop.nii.gz intraop_surface.ply
//
// The head of data/brainshift: the cortex under a craniotomy has sunk by up to 9 mm.

#include <tissuewarp/core/version.hpp>
#include <tissuewarp/imaging/image_io.hpp>
#include <tissuewarp/meshing/mesh_io.hpp>
#include <tissuewarp/registration/registration.hpp>

#include <cstdio>
#include <exception>

using namespace tissuewarp;

namespace {

constexpr const char* model_file = "patient.tw";

void before_the_operation(const char* image, const char* labels) {
    registration::PreparedModel model = registration::prepare(imaging::read_labels(labels));
    registration::prepare_image(model, imaging::read_volume(image));  // to register to images
    registration::prepare_loads(model);                               // to register to labels or points
    registration::write_prepared(model, model_file);
    std::printf("prepared %d tetrahedra\n", model.model.mesh.tet_count());
}

/// Where a point of the preoperative image is now, and within how many mm that is true in 95 of 100 cases.
void report(const char* data, const registration::PreparedModel& model, const registration::UpdateResult& result,
            const Eigen::Vector3d& target) {
    const Eigen::Vector3d now = registration::PointTransform(result.deformation)(target);
    const auto error = registration::uncertainty(model, result).at(target).front();
    std::printf("%s: (%.1f, %.1f, %.1f) moved %.1f mm, to within %.1f mm\n", data, target[0], target[1], target[2],
                (now - target).norm(), error ? error->interval_mm : 0.0);
    for (const registration::Doubt& doubt : result.doubts)
        std::printf("  doubt (%s): %s\n", doubt.code.c_str(), full_text(doubt).c_str());
}

void during_the_operation(const char* preop, const char* intraop, const char* surface) {
    const auto model = std::make_shared<const registration::PreparedModel>(registration::read_prepared(model_file));
    registration::UpdateOptions options;
    options.align = false;                            // patient and image are in one frame already
    registration::Updater updater(model, options);    // keeps what updates share: engine, device, images
    const Eigen::Vector3d target(-33.6, 18.7, 50.2);  // under the craniotomy, LPS mm

    const imaging::Volume seen = imaging::read_volume(intraop);
    const registration::UpdateResult by_image = updater.update({.image = seen});
    report("image", *model, by_image, target);
    const imaging::Volume warped = registration::warp_image(
        imaging::read_volume(preop), registration::displacement_fixed_to_moving(by_image.deformation, seen.geometry));
    imaging::write_volume(warped, "warped.nii.gz");

    const registration::SurfacePoints points{meshing::read_surface(surface).mesh.nodes, {}, 0.3};
    report("surface", *model, updater.update({.surface = points}), target);
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 5) {
        std::fprintf(stderr, "usage: navigation preop.nii.gz preop_labels.nii.gz intraop.nii.gz surface.ply\n");
        return 2;
    }
    try {
        std::printf("tissuewarp %s\n", TISSUEWARP_VERSION);
        before_the_operation(arguments[1], arguments[2]);
        during_the_operation(arguments[1], arguments[3], arguments[4]);
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "navigation: %s\n", failure.what());
        return 1;
    }
}
