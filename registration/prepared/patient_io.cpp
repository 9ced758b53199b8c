#include "registration/prepared/patient_io.hpp"

#include "core/atomic_file.hpp"
#include "core/file_message.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/io/stored_model.hpp"
#include "registration/prepared/stored_prepared.hpp"

namespace tissuewarp::registration {

namespace {

constexpr const char* facts_name = "patient/facts";
constexpr const char* image_group = "patient/image";

/// Whole numbers as such, which keeps them small; `depth` says of which kind they were.
void write_image(Hdf5Output& file, const imaging::Volume& image) {
    const std::string group = image_group;
    if (image.channels() != 1) throw InvalidInput("the image of a patient has more than one component");
    detail::write_grid(file, group + "/grid", image.geometry);
    file.scalar<int>(group + "/depth", image.voxels.depth(), "1");
    const auto shape = detail::voxel_shape(image.geometry);
    if (image.voxels.depth() == CV_64F)
        file.array<double>(group + "/voxels", image.data<double>(), shape, "1");
    else if (image.voxels.depth() == CV_32F)
        file.array<float>(group + "/voxels", image.data<float>(), shape, "1");
    else
        file.array<int>(group + "/voxels", image.as(CV_32S).data<int>(), shape, "1");
}

imaging::Volume read_image(const Hdf5Input& file) {
    const std::string group = image_group;
    const imaging::Geometry grid = detail::read_grid(file, group + "/grid");
    const int depth = file.scalar<int>(group + "/depth");
    if (depth < CV_8U || depth > CV_64F)
        throw InvalidInput("'" + group + "/depth' is " + std::to_string(depth) + ", not 0 to 6");
    const auto shape = detail::voxel_shape(grid);
    file.require_shape(group + "/voxels", shape);
    const bool real = depth == CV_32F || depth == CV_64F;
    imaging::Volume image(grid, real ? CV_MAKETYPE(depth, 1) : CV_32SC1);
    if (depth == CV_64F)
        file.array<double>(group + "/voxels", image.data<double>(), shape);
    else if (depth == CV_32F)
        file.array<float>(group + "/voxels", image.data<float>(), shape);
    else
        file.array<int>(group + "/voxels", image.data<int>(), shape);
    return real ? image : image.as(depth);
}

Patient read_checked(const std::filesystem::path& path, Observer& observer) {
    const Hdf5Input file(path, detail::prepared_format, detail::prepared_version, detail::oldest_prepared_version);
    if (!file.holds(facts_name))
        throw InvalidInput(
            "it holds a prepared model alone, without the patient's data; make it by tissuewarp prepare");
    const std::string facts = file.text(facts_name);
    imaging::Volume image;
    if (file.holds(image_group)) image = read_image(file);
    PreparedModel prepared = detail::read_prepared_parts(file, path, observer);
    imaging::Volume labels = detail::with_neighbours(prepared);
    return {std::move(prepared), std::move(labels), std::move(image), facts};
}

}  // namespace

void write_patient(const PreparedModel& prepared, const imaging::Volume& image, const std::string& facts,
                   const std::filesystem::path& path) {
    AtomicFile target(path);
    Hdf5Output file(target.path(), detail::prepared_format, detail::version_of(prepared));
    detail::write_prepared_parts(file, prepared);
    if (!image.empty()) write_image(file, image);
    file.texts(facts_name, {facts});
    file.close();
    target.commit();
}

Patient read_patient(const std::filesystem::path& path, Observer& observer) {
    return naming(path, [&] {
        try {
            return read_checked(path, observer);
        } catch (const SolverFailure& failure) {  // sizes or materials whose stiffness is no number
            throw InvalidInput(std::string("its tissue cannot be computed with: ") + failure.what());
        }
    });
}

}  // namespace tissuewarp::registration
