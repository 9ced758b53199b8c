// Parametric Map (PS3.3, A.75 and C.8.32), frames of float32.

#include "imaging/detail/dicom_object.hpp"
#include "imaging/detail/right_handed.hpp"
#include "imaging/dicom_results.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::imaging {

namespace {

using detail::code;
using detail::DicomObject;

constexpr float padding = -1;  ///< where nothing is said

void add_shared_groups(DicomObject& shared, const Geometry& grid, const MapQuantity& quantity, float least,
                       float most) {
    DicomObject measures, orientation, voi, kind, mapping, definition, identity;
    measures.decimals(0x00280030, {grid.spacing[1], grid.spacing[0]});  // along j comes first
    measures.decimals(0x00180050, {grid.spacing[2]});
    measures.decimals(0x00180088, {grid.spacing[2]});
    orientation.decimals(0x00200037, {grid.direction.data(), grid.direction.data() + 6});
    voi.decimals(0x00281050, {0.5 * (double(least) + most)});
    voi.decimals(0x00281051, {std::max(1e-3, double(most) - least)});
    identity.decimals(0x00281052, {0});
    identity.decimals(0x00281053, {1});
    identity.text(0x00281054, "LO", "US");  // unspecified
    kind.text(0x00089007, "CS", "DERIVED\\PRIMARY\\VOLUME\\QUANTITY");
    definition.text(0x0040a040, "CS", "CODE");
    definition.sequence(0x0040a043, {code("246205007", "SCT", "Quantity")});
    definition.sequence(0x0040a168,
                        {code(quantity.code.c_str(), quantity.code_scheme.c_str(), quantity.code_title.c_str())});
    mapping.text(0x00283003, "LO", quantity.description);
    mapping.text(0x00409210, "SH", quantity.unit);
    mapping.fd(0x00409213, {most});
    mapping.fd(0x00409214, {least});
    mapping.fd(0x00409224, {0});
    mapping.fd(0x00409225, {1});
    mapping.sequence(0x004008ea, {code(quantity.unit.c_str(), "UCUM", quantity.unit_meaning.c_str())});
    mapping.sequence(0x00409220, {definition});
    shared.sequence(0x00289110, {measures});
    shared.sequence(0x00209116, {orientation});
    shared.sequence(0x00289132, {voi});
    shared.sequence(0x00289145, {identity});
    shared.sequence(0x00409092, {kind});
    shared.sequence(0x00409096, {mapping});
}

std::vector<DicomObject> frame_groups(const Geometry& grid) {
    std::vector<DicomObject> frames;
    for (int k = 0; k < grid.size[2]; ++k) {
        const auto slice = static_cast<std::uint32_t>(k + 1);
        const Eigen::Vector3d corner = grid.point({0, 0, double(k)});
        DicomObject frame, content, position;
        content.ul(0x00209157, {1, slice});
        content.text(0x00209056, "SH", "1");
        content.ul(0x00209057, {slice});
        position.decimals(0x00200032, {corner.data(), corner.data() + 3});
        frame.sequence(0x00209111, {content});
        frame.sequence(0x00209113, {position});
        frames.push_back(std::move(frame));
    }
    return frames;
}

/// Frames are counted by stack, of which there is one, and by their place in it.
void add_dimensions(DicomObject& object) {
    constexpr std::uint32_t frame_content = 0x00209111;
    const std::string uid = detail::new_uid();
    DicomObject organization;
    organization.text(0x00209164, "UI", uid);
    std::vector<DicomObject> indices;
    for (const std::uint32_t counted : {0x00209056U, 0x00209057U}) {
        DicomObject index;
        index.text(0x00209164, "UI", uid);
        index.at(0x00209165, counted);
        index.at(0x00209167, frame_content);
        indices.push_back(std::move(index));
    }
    object.sequence(0x00209221, {organization});
    object.sequence(0x00209222, indices);
}

void add_pixels(DicomObject& object, const Volume& map) {
    const Geometry& grid = map.geometry;
    object.us(0x00280002, {1});
    object.text(0x00280004, "CS", "MONOCHROME2");
    object.whole(0x00280008, {grid.size[2]});
    object.us(0x00280010, {static_cast<std::uint16_t>(grid.size[1])});
    object.us(0x00280011, {static_cast<std::uint16_t>(grid.size[0])});
    object.us(0x00280100, {32});
    object.text(0x00280301, "CS", "NO");
    object.text(0x00282110, "CS", "00");
    for (const std::uint32_t value_and_limit : {0x00280122U, 0x00280124U}) object.fl(value_and_limit, padding);
    std::vector<float> values(map.data<float>(), map.data<float>() + grid.voxel_count());
    std::replace_if(
        values.begin(), values.end(), [](float v) { return std::isnan(v); }, padding);
    object.of(0x7fe00008, values);
}

}  // namespace

void write_parametric_map(const Volume& given, const MapQuantity& quantity, const DicomOrigin& origin,
                          const std::filesystem::path& path) {
    const Volume map = detail::right_handed(given.as(CV_32F));
    float least = 0, most = 0;
    for (std::int64_t n = 0; n < map.geometry.voxel_count(); ++n) {
        const float value = map.data<float>()[n];  // NaN, where nothing is said, is neither
        if (value < least) least = value;
        if (value > most) most = value;
    }
    DicomObject object = detail::derived_object(origin, "1.2.840.10008.5.1.4.1.1.30", "OT", quantity.description);
    object.text(0x00080008, "CS", "DERIVED\\PRIMARY\\VOLUME\\QUANTITY");
    detail::add_content(object, "MAP", quantity.description);
    object.text(0x00189004, "CS", "RESEARCH");
    object.text(0x00200060, "CS", "");
    object.text(0x00280302, "CS", "NO");  // no face is to be recognised
    object.sequence(0x00400555, {});
    object.text(0x20500020, "CS", "IDENTITY");
    DicomObject shared;
    add_shared_groups(shared, map.geometry, quantity, least, most);
    add_dimensions(object);
    object.sequence(0x52009229, {shared});
    object.sequence(0x52009230, frame_groups(map.geometry));
    add_pixels(object, map);
    detail::write_dicom(object, path);
}

}  // namespace tissuewarp::imaging
