// Deformable Spatial Registration (PS3.3, A.39.2 and C.20.3).

#include "imaging/detail/dicom_object.hpp"
#include "imaging/detail/right_handed.hpp"
#include "imaging/dicom_results.hpp"

namespace tissuewarp::imaging {

namespace {

using detail::DicomObject;

DicomObject matrix_item(const Eigen::Isometry3d& motion) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = motion.matrix();
    DicomObject item;
    item.decimals(0x300600c6, {matrix.data(), matrix.data() + 16});
    item.text(0x0070030c, "CS", "RIGID");
    return item;
}

DicomObject grid_item(const Volume& field) {
    const Geometry& grid = field.geometry;
    const auto* components = field.data<float>();
    DicomObject item;
    item.decimals(0x00200032, {grid.origin.data(), grid.origin.data() + 3});
    item.decimals(0x00200037, {grid.direction.data(), grid.direction.data() + 6});
    item.ul(0x00640007, {static_cast<std::uint32_t>(grid.size[0]), static_cast<std::uint32_t>(grid.size[1]),
                         static_cast<std::uint32_t>(grid.size[2])});
    item.fd(0x00640008, {grid.spacing.data(), grid.spacing.data() + 3});
    item.of(0x00640009, {components, components + 3 * grid.voxel_count()});
    return item;
}

DicomObject series_reference(const DicomOrigin& origin) {
    DicomObject series;
    series.text(0x0020000e, "UI", origin.series);
    series.sequence(0x0008114a, detail::references_to(origin.instances));
    return series;
}

/// Of images in a frame of reference.
DicomObject registration_item(const DicomOrigin& origin) {
    DicomObject item;
    item.text(0x00640003, "UI", origin.frame_of_reference);
    item.sequence(0x00081140, detail::references_to(origin.instances));
    item.sequence(0x0070030d, {});
    return item;
}

/// Images of the object's own study, and those of others (PS3.3, C.12.2).
void add_references(DicomObject& object, const DicomOrigin& fixed, const DicomOrigin& moving) {
    if (fixed.study == moving.study)
        return object.sequence(0x00081115, {series_reference(fixed), series_reference(moving)});
    object.sequence(0x00081115, {series_reference(fixed)});
    DicomObject other;
    other.text(0x0020000d, "UI", moving.study);
    other.sequence(0x00081115, {series_reference(moving)});
    object.sequence(0x00081200, {other});
}

}  // namespace

void write_deformable_registration(const Volume& displacement, const Eigen::Isometry3d& after, const DicomOrigin& fixed,
                                   const DicomOrigin& moving, const std::filesystem::path& path) {
    DicomObject object = detail::derived_object(fixed, "1.2.840.10008.5.1.4.1.1.66.3", "REG", "Registration");
    detail::add_content(object, "REGISTRATION", "moving series to fixed series");
    object.text(0x00200060, "CS", "");
    DicomObject item = registration_item(moving);
    item.sequence(0x00640005, {grid_item(detail::right_handed(displacement))});
    item.sequence(0x0064000f, {matrix_item(Eigen::Isometry3d::Identity())});
    item.sequence(0x00640010, {matrix_item(after)});
    object.sequence(0x00640002, {item, registration_item(fixed)});
    add_references(object, fixed, moving);
    detail::write_dicom(object, path);
}

}  // namespace tissuewarp::imaging
