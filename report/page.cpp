#include "report/page.hpp"

#include "report/detail/encoding.hpp"
#include "report/detail/picture.hpp"
#include "report/detail/template.hpp"
#include "report/detail/view.hpp"
#include "report/detail/viewer_surface.hpp"
#include "report/detail/viewer_volumes.hpp"

#include "core/atomic_file.hpp"

#include <tbb/parallel_invoke.h>

#include <cstdio>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::report {

namespace {

nlohmann::json place(const Eigen::Vector3d& point) {
    return {point[0], point[1], point[2]};
}

/// The voxel of the largest estimated error of tissue, LPS mm.
std::optional<Eigen::Vector3d> least_known(const ReportInput& input) {
    if (input.uncertainty == nullptr) return std::nullopt;
    const imaging::Volume deviation = input.uncertainty->as(CV_32F), trust = input.trust->as(CV_8U);
    const imaging::Geometry& grid = deviation.geometry;
    std::int64_t worst = -1;
    for (std::int64_t at = 0; at < grid.voxel_count(); ++at)
        if (trust.data<std::uint8_t>()[at] != 0 &&
            (worst < 0 || deviation.data<float>()[at] > deviation.data<float>()[worst]))
            worst = at;
    if (worst < 0) return std::nullopt;
    const std::int64_t row = worst / grid.size[0];
    return grid.point(Eigen::Vector3d(static_cast<double>(worst % grid.size[0]),
                                      static_cast<double>(row % grid.size[1]),
                                      static_cast<double>(row / grid.size[1])));
}

/// What the viewer shows, as report/viewer/scene.js reads it.
nlohmann::json viewer_scene(const ReportInput& input, const detail::Preview& preview) {
    const double displacement_mm = preview.displacement_mm, error_mm = preview.error_mm;
    const std::optional<detail::Box> organ = detail::label_box(detail::organ_labels(input));
    nlohmann::json scene = detail::viewer_volumes(input, *organ, displacement_mm, error_mm);
    scene["displacement_mm"] = displacement_mm;
    scene["error_mm"] = error_mm;
    scene["focus"] = place(preview.focus ? preview.focus->fixed : organ->centre());
    scene["moved_most"] = preview.focus.has_value();
    if (const auto worst = least_known(input)) scene["least_known"] = place(*worst);
    if (nlohmann::json surface = detail::viewer_surface(input, displacement_mm, error_mm); !surface.is_null())
        scene["surface"] = std::move(surface);
    return scene;
}

nlohmann::json page_values(const nlohmann::json& report, const Pictures& pictures) {
    nlohmann::json values = detail::view_of(report);
    values["preview"] = pictures.preview_jpeg;
    if (pictures.most_displacement_mm) {
        char millimetres[32];
        std::snprintf(millimetres, sizeof millimetres, "%.1f", *pictures.most_displacement_mm);
        values["summary"]["displacement"] = {{"largest", millimetres},
                                             {"beyond_alignment", report.contains("alignment")}};
    }
    values["viewer"] = {{"scene", pictures.scene}};
    return values;
}

}  // namespace

Pictures draw_pictures(const ReportInput& input) {
    const detail::Preview preview = detail::draw_preview(input);
    Pictures pictures;
    if (preview.focus) pictures.most_displacement_mm = preview.focus->displacement;
    tbb::parallel_invoke([&] { pictures.preview_png = detail::png(preview.picture); },
                         [&] { pictures.preview_jpeg = detail::base64(detail::jpeg(preview.picture, 92)); },
                         [&] { pictures.scene = viewer_scene(input, preview).dump(); });
    return pictures;
}

void write_report(const nlohmann::json& report, const Pictures& pictures, const std::filesystem::path& folder) {
    const std::vector<unsigned char>& png = pictures.preview_png;
    write_file({reinterpret_cast<const char*>(png.data()), png.size()}, folder / "preview.png");
    write_file(detail::fill(detail::page_template(), page_values(report, pictures)), folder / "report.html");
}

void write_report(const ReportInput& input, const std::filesystem::path& folder) {
    write_report(input.report, draw_pictures(input), folder);
}

}  // namespace tissuewarp::report
