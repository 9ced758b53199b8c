// RT Structure Set (PS3.3, A.19 and C.8.8.5 to C.8.8.8).

#include "core/errors.hpp"
#include "imaging/detail/dicom_object.hpp"
#include "imaging/detail/slice_contours.hpp"
#include "imaging/dicom_results.hpp"
#include "imaging/labels.hpp"

#include <cmath>

namespace tissuewarp::imaging {

namespace {

using detail::DicomObject;

/// The frame of reference, and the images that lie in it.
DicomObject frame_reference(const DicomOrigin& origin) {
    DicomObject series, study, frame;
    series.text(0x0020000e, "UI", origin.series);
    series.sequence(0x30060016, detail::references_to(origin.instances));
    study.text(0x00081150, "UI", "1.2.840.10008.3.1.2.3.1");  // a study, retired but for this use
    study.text(0x00081155, "UI", origin.study);
    study.sequence(0x30060014, {series});
    frame.text(0x00200052, "UI", origin.frame_of_reference);
    frame.sequence(0x30060012, {study});
    return frame;
}

/// The image whose plane a slice lies in; null where none does.
const DicomInstance* image_at(const DicomOrigin& origin, const Geometry& grid, int k) {
    const Eigen::Vector3d normal = grid.direction.col(2), slice = grid.point({0, 0, double(k)});
    for (const DicomInstance& instance : origin.instances)
        if (instance.position && std::abs(normal.dot(*instance.position - slice)) < 0.1 * grid.spacing[2])
            return &instance;
    return nullptr;
}

std::vector<DicomObject> contours(const Volume& labels, int label, const DicomOrigin& origin) {
    std::vector<DicomObject> items;
    for (int k = 0; k < labels.geometry.size[2]; ++k) {
        const DicomInstance* image = image_at(origin, labels.geometry, k);
        for (const Eigen::Matrix3Xd& contour : detail::slice_contours(labels, label, k)) {
            DicomObject item;
            if (image) item.sequence(0x30060016, {detail::reference_to(*image)});
            item.text(0x30060042, "CS", "CLOSED_PLANAR");
            item.whole(0x30060046, {static_cast<int>(contour.cols())});
            item.decimals(0x30060050, {contour.data(), contour.data() + contour.size()});
            items.push_back(std::move(item));
        }
    }
    return items;
}

/// Far apart for labels that follow each other.
std::vector<int> colour_of(int label) {
    const auto channel = [&](int step) { return 55 + label * step % 200; };
    return {channel(67), channel(131), channel(173)};
}

}  // namespace

void write_structure_set(const Volume& labels, const LabelNames& names, const DicomOrigin& origin,
                         const std::filesystem::path& path) {
    std::vector<DicomObject> regions, drawn, observations;
    for (const int label : labels_in(labels)) {
        if (label == 0) continue;
        const auto name = names.find(label);
        DicomObject region, outline, observation;
        region.whole(0x30060022, {label});
        region.text(0x30060024, "UI", origin.frame_of_reference);
        region.text(0x30060026, "LO", name == names.end() ? "label " + std::to_string(label) : name->second);
        region.text(0x30060036, "CS", "AUTOMATIC");
        outline.whole(0x3006002a, colour_of(label));
        outline.sequence(0x30060040, contours(labels, label, origin));
        outline.whole(0x30060084, {label});
        observation.whole(0x30060082, {label});
        observation.whole(0x30060084, {label});
        observation.text(0x300600a4, "CS", "ORGAN");
        observation.text(0x300600a6, "PN", "");
        regions.push_back(std::move(region));
        drawn.push_back(std::move(outline));
        observations.push_back(std::move(observation));
    }
    if (regions.empty()) throw InvalidInput("cannot write '" + path.string() + "': the label map is empty");
    DicomObject object =
        detail::derived_object(origin, "1.2.840.10008.5.1.4.1.1.481.3", "RTSTRUCT", "Registered structures");
    object.text(0x00081070, "PN", "");
    object.text(0x30060002, "SH", "registered");
    object.text(0x30060008, "DA", detail::today());
    object.text(0x30060009, "TM", detail::time_of_day());
    object.sequence(0x30060010, {frame_reference(origin)});
    object.sequence(0x30060020, regions);
    object.sequence(0x30060039, drawn);
    object.sequence(0x30060080, observations);
    detail::write_dicom(object, path);
}

}  // namespace tissuewarp::imaging
