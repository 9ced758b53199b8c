#include "report/detail/picture.hpp"

#include "report/detail/drawing.hpp"

#include "core/errors.hpp"

#include <opencv2/imgproc.hpp>

#include <cmath>
#include <cstdio>
#include <functional>

namespace tissuewarp::report::detail {

namespace {

using Eigen::Vector3d;
using imaging::Interpolation;
using imaging::Volume;

// BGR. Red and green differ in lightness too, and the green line is the wider one, for those who confuse the hues.
const cv::Scalar background(26, 23, 21), ink(235, 235, 235), faint(165, 165, 165);
const cv::Scalar moving_colour(60, 60, 255), fixed_colour(90, 210, 70);

constexpr int cell = 360, gap = 10, left_margin = 16, top_margin = 84, bottom_margin = 112, bar_margin = 84;
constexpr double margin_mm = 12.0;
constexpr double difference_range = 0.5;  // of the grey window

/// What every panel needs.
struct Scene {
    const ReportInput& input;
    double mm_per_pixel = 1;
    std::array<Plane, 3> fixed_planes{}, moving_planes{};
    Window fixed_window{}, moving_window{};
    std::optional<Focus> focus{};
    std::optional<Volume> magnitude{};
    double displacement_limit = 1, error_limit = 1;  ///< mm, ends of the colour bars
    bool distrusts = false;                          ///< some tissue is not to be trusted
};

struct Column {
    std::string title, subtitle;
    std::function<cv::Mat(int row)> draw;
    bool of_moving_frame = false;
    double bar_mm = 0;  ///< end of the colour bar beside it; 0: none
    [[nodiscard]] int width() const { return cell + gap + (bar_mm > 0 ? bar_margin : 0); }
};

double voxel_mm(const Volume& volume) {
    return volume.geometry.spacing.maxCoeff();
}

/// Corners of nearest-neighbour labels are as wide as a voxel.
double corner_sigma(const Volume& labels, const Scene& scene) {
    return 0.5 * voxel_mm(labels) / scene.mm_per_pixel;
}

void outline(cv::Mat& picture, const Volume& labels, const Plane& plane, const Scene& scene, const cv::Scalar& colour,
             int thickness) {
    outlines(picture, label_slice(labels, plane), colour, thickness, corner_sigma(labels, scene));
}

/// The image's plane, or the labels as flat grey where there is no image.
cv::Mat base(const Volume* image, const Window& window, const Volume& labels, const Plane& plane) {
    if (image != nullptr) return grey_to_colour(grey_slice(*image, window, plane));
    cv::Mat grey;
    cv::Mat(label_slice(labels, plane) != 0).convertTo(grey, CV_32F, 0.45 / 255);
    return grey_to_colour(grey);
}

cv::Mat overlay(const Scene& scene, int row, const Volume& labels) {
    const Plane& plane = scene.fixed_planes[static_cast<std::size_t>(row)];
    const Volume* fixed_labels = scene.input.fixed_labels;
    cv::Mat picture = base(scene.input.fixed, scene.fixed_window, fixed_labels ? *fixed_labels : labels, plane);
    if (fixed_labels != nullptr) outline(picture, *fixed_labels, plane, scene, fixed_colour, 2);
    outline(picture, labels, plane, scene, moving_colour, 1);
    return picture;
}

/// fixed − other, each windowed; as colours, pale where neither has labels, because nothing is simulated there.
cv::Mat difference(const Scene& scene, int row, const Volume& other, const Volume* other_labels) {
    const Plane& plane = scene.fixed_planes[static_cast<std::size_t>(row)];
    const cv::Mat values =
        grey_slice(*scene.input.fixed, scene.fixed_window, plane) - grey_slice(other, scene.moving_window, plane);
    const cv::Mat colours = signed_to_colour(values / difference_range);
    constexpr double kept = 0.3;
    const cv::Scalar white(247, 247, 247);
    cv::Mat picture = colours * kept + cv::Mat(colours.size(), colours.type(), white) * (1 - kept);
    const Volume& organ = organ_labels(scene.input);
    cv::Mat mask = label_slice(organ, plane) != 0;
    if (other_labels != nullptr) mask |= label_slice(*other_labels, plane) != 0;
    colours.copyTo(picture, mask);
    outline(picture, organ, plane, scene, cv::Scalar(60, 120, 40), 1);
    return picture;
}

cv::Mat displacement(const Scene& scene, int row) {
    const Plane& plane = scene.moving_planes[static_cast<std::size_t>(row)];
    const Volume& labels = *scene.input.moving_labels;
    cv::Mat picture = base(scene.input.moving, scene.moving_window, labels, plane);
    cv::Mat values = slice(*scene.magnitude, plane, Interpolation::Linear) / scene.displacement_limit;
    values = cv::max(cv::min(values, 1.0), 0.0);
    cv::Mat mixed;
    cv::addWeighted(magnitude_to_colour(values), 0.75, picture, 0.25, 0, mixed);
    mixed.copyTo(picture, label_slice(labels, plane) != 0);
    outline(picture, labels, plane, scene, moving_colour, 1);
    const Vector3d pixel = plane.grid.index(scene.focus->moving);
    cv::drawMarker(picture, {static_cast<int>(std::lround(pixel[0])), static_cast<int>(std::lround(pixel[1]))},
                   cv::Scalar(255, 255, 255), cv::MARKER_CROSS, 13, 1, cv::LINE_AA);
    return picture;
}

/// Tissue that is not to be trusted is hatched.
cv::Mat estimated_error(const Scene& scene, int row) {
    constexpr int stripe = 3, stripes_apart = 9;  // pixels
    const Plane& plane = scene.fixed_planes[static_cast<std::size_t>(row)];
    const Volume& labels = organ_labels(scene.input);
    cv::Mat picture = base(scene.input.fixed, scene.fixed_window, labels, plane);
    const cv::Mat trust = label_slice(*scene.input.trust, plane), tissue = trust != 0;
    cv::Mat values = slice(*scene.input.uncertainty, plane, Interpolation::Nearest) / scene.error_limit, mixed;
    values.setTo(0, ~tissue);  // NaN
    cv::addWeighted(magnitude_to_colour(cv::min(values, 1.0)), 0.75, picture, 0.25, 0, mixed);
    mixed.copyTo(picture, tissue);
    for (int y = 0; y < picture.rows; ++y)
        for (int x = 0; x < picture.cols; ++x)
            if (trust.at<int>(y, x) == 3 && (x + y) % stripes_apart < stripe) picture.at<cv::Vec3b>(y, x) *= 0.2;
    outline(picture, labels, plane, scene, fixed_colour, 1);
    return picture;
}

void letters(cv::Mat& panel, const Plane& plane) {
    text(panel, plane.left, {6, panel.rows / 2}, 0.6, ink);
    text(panel, plane.right, {panel.cols - 6, panel.rows / 2}, 0.6, ink, Anchor::Right);
    text(panel, plane.top, {panel.cols / 2, 13}, 0.6, ink, Anchor::Centre);
    text(panel, plane.bottom, {panel.cols / 2, panel.rows - 13}, 0.6, ink, Anchor::Centre);
}

void place_name(cv::Mat& panel, const Plane& plane) {
    char line[32];
    std::snprintf(line, sizeof line, "%c = %.1f mm", plane.axis, plane.position);
    text(panel, plane.name, {6, 14}, 0.52, ink);
    text(panel, line, {6, 35}, 0.52, ink);
}

/// A line of a round length, about a quarter of the panel.
void scale_bar(cv::Mat& panel, double mm_per_pixel) {
    const double length = round_ticks(panel.cols * mm_per_pixel / 4, 4).back();
    const int pixels = static_cast<int>(std::lround(length / mm_per_pixel)), y = panel.rows - 8;
    cv::line(panel, {panel.cols - 10 - pixels, y}, {panel.cols - 10, y}, cv::Scalar(12, 12, 12), 5);
    cv::line(panel, {panel.cols - 10 - pixels, y}, {panel.cols - 10, y}, ink, 2);
    text(panel, tick_text(length) + " mm", {panel.cols - 10 - pixels / 2, y - 15}, 0.52, ink, Anchor::Centre);
}

std::vector<Column> columns_of(const Scene& scene) {
    const ReportInput& in = scene.input;
    std::vector<Column> columns;
    columns.push_back({"Before", "as the image headers say",
                       [&scene, &in](int row) { return overlay(scene, row, *in.moving_labels); }});
    if (in.warped_labels != nullptr)
        columns.push_back({"After", "preoperative labels warped",
                           [&scene, &in](int row) { return overlay(scene, row, *in.warped_labels); }});
    if (in.fixed != nullptr && in.moving != nullptr)
        columns.push_back({"Difference before", "intraoperative - preoperative",
                           [&scene, &in](int row) { return difference(scene, row, *in.moving, in.moving_labels); }});
    if (in.fixed != nullptr && in.warped != nullptr)
        columns.push_back({"Difference after", "intraoperative - warped",
                           [&scene, &in](int row) { return difference(scene, row, *in.warped, in.warped_labels); }});
    if (in.uncertainty != nullptr)
        columns.push_back({"Estimated error", "one standard deviation, mm",
                           [&scene](int row) { return estimated_error(scene, row); }, false, scene.error_limit});
    if (scene.magnitude)
        columns.push_back(
            {"Displacement",
             in.report.contains("alignment") ? "mm, beyond the rigid alignment" : "mm, rigid motion included",
             [&scene](int row) { return displacement(scene, row); }, true, scene.displacement_limit});
    return columns;
}

void vertical_bar(cv::Mat& page, const cv::Rect& place, double limit) {
    cv::Mat ramp(place.height, place.width, CV_32F);
    for (int y = 0; y < place.height; ++y) ramp.row(y) = 1.0 - y / static_cast<double>(place.height - 1);
    magnitude_to_colour(ramp).copyTo(page(place));
    cv::rectangle(page, place, faint, 1);
    for (const double tick : round_ticks(limit, 5)) {
        const int y = place.y + static_cast<int>(std::lround((1 - tick / limit) * (place.height - 1)));
        cv::line(page, {place.x + place.width, y}, {place.x + place.width + 4, y}, faint);
        text(page, tick_text(tick), {place.x + place.width + 8, y}, 0.55, ink);
    }
    text(page, "mm", {place.x + place.width / 2, place.y - 14}, 0.55, ink, Anchor::Centre);
}

void difference_bar(cv::Mat& page, const cv::Rect& place) {
    cv::Mat ramp(place.height, place.width, CV_32F);
    for (int x = 0; x < place.width; ++x) ramp.col(x) = 2.0 * x / (place.width - 1) - 1.0;
    signed_to_colour(ramp).copyTo(page(place));
    cv::rectangle(page, place, faint, 1);
    const int y = place.y + place.height + 14;
    text(page, "-50 %", {place.x, y}, 0.55, ink, Anchor::Centre);
    text(page, "0", {place.x + place.width / 2, y}, 0.55, ink, Anchor::Centre);
    text(page, "+50 %", {place.x + place.width, y}, 0.55, ink, Anchor::Centre);
}

void legend(cv::Mat& page, const std::vector<Column>& columns, const Scene& scene) {
    const int y = page.rows - bottom_margin + 22;
    const auto sample = [&](int row, const cv::Scalar& colour, int thickness, const std::string& words) {
        cv::line(page, {left_margin, y + row}, {left_margin + 30, y + row}, colour, thickness, cv::LINE_AA);
        text(page, words, {left_margin + 40, y + row}, 0.55, ink);
    };
    if (scene.input.fixed_labels != nullptr) sample(0, fixed_colour, 2, "intraoperative (fixed) labels");
    sample(26, moving_colour, 1, "preoperative (moving) labels, as they lie and warped");
    text(page, "Radiological: the patient's right (R) is on the left. A front, P back,", {left_margin, y + 54}, 0.5,
         faint);
    text(page, "S head, I feet. Places in LPS mm.", {left_margin, y + 72}, 0.5, faint);
    int x = left_margin;
    for (const Column& column : columns) {
        if (column.title.starts_with("Difference")) {
            difference_bar(page, {x + 60, y - 6, cell - 120, 12});
            text(page, "of the grey window; pale outside labels", {x + cell / 2, y + 44}, 0.5, faint, Anchor::Centre);
        }
        if (column.title == "Estimated error" && scene.distrusts)
            text(page, "hatched: do not trust", {x + cell / 2, y}, 0.55, ink, Anchor::Centre);
        if (column.of_moving_frame) {
            char line[96];
            std::snprintf(line, sizeof line, "largest in the organ: %.1f mm, at the cross", scene.focus->displacement);
            text(page, line, {x + cell / 2, y}, 0.55, ink, Anchor::Centre);
        }
        x += column.width();
    }
}

void require_channels(const Volume* volume, int channels, const char* name) {
    if (volume != nullptr && (volume->empty() || volume->channels() != channels))
        throw InvalidInput(std::string("report: ") + name + " must have " + std::to_string(channels) +
                           (channels == 1 ? " component" : " components"));
}

void require_input(const ReportInput& input) {
    if (input.moving_labels == nullptr) throw InvalidInput("report: the moving label map is needed");
    require_channels(input.moving, 1, "the moving image");
    require_channels(input.fixed, 1, "the fixed image");
    require_channels(input.warped, 1, "the warped image");
    require_channels(input.moving_labels, 1, "the moving label map");
    require_channels(input.fixed_labels, 1, "the fixed label map");
    require_channels(input.warped_labels, 1, "the warped label map");
    require_channels(input.moving_to_fixed, 3, "the displacement field");
    require_channels(input.uncertainty, 1, "the estimated error");
    require_channels(input.trust, 1, "the map of trust");
    if ((input.uncertainty == nullptr) != (input.trust == nullptr))
        throw InvalidInput("report: the estimated error and the map of trust go together");
}

void show_errors(Scene& scene) {
    const cv::Mat trust = scene.input.trust->voxels.reshape(1, 1),
                  errors = scene.input.uncertainty->voxels.reshape(1, 1);
    double largest = 0;
    cv::minMaxLoc(errors, nullptr, &largest, nullptr, nullptr, trust != 0);
    scene.error_limit = std::max(largest, 0.1);
    scene.distrusts = cv::countNonZero(trust == 3) > 0;
}

Scene scene_of(const ReportInput& input) {
    const std::optional<Box> fixed = label_box(organ_labels(input)), moving = label_box(*input.moving_labels);
    if (!fixed || !moving) throw InvalidInput("report: a label map holds no label");
    Scene scene{input};
    if (input.moving_to_fixed != nullptr) {
        scene.magnitude = elastic_magnitude(*input.moving_to_fixed, alignment_of(input.report));
        const Focus focus = largest_displacement(*input.moving_to_fixed, *scene.magnitude,
                                                 input.organ ? *input.organ : *input.moving_labels);
        if (focus.displacement >= 0)
            scene.focus = focus;
        else
            scene.magnitude.reset();
    }
    const Vector3d extent = fixed->extent().cwiseMax(moving->extent()) + Vector3d::Constant(2 * margin_mm);
    const Box fixed_box = around(fixed->centre(), extent), moving_box = around(moving->centre(), extent);
    scene.mm_per_pixel = std::max(extent[0], extent[1]) / cell;
    const Vector3d fixed_point = scene.focus ? scene.focus->fixed : fixed->centre();
    scene.fixed_planes = planes_through(fixed_point, fixed_box, scene.mm_per_pixel);
    scene.moving_planes =
        planes_through(scene.focus ? scene.focus->moving : moving->centre(), moving_box, scene.mm_per_pixel);
    if (input.fixed != nullptr) scene.fixed_window = window_of(*input.fixed, *fixed);
    if (input.moving != nullptr)
        scene.moving_window = window_of(*input.moving, *moving);
    else if (input.warped != nullptr)
        scene.moving_window = window_of(*input.warped, *fixed);
    if (scene.focus) scene.displacement_limit = std::max(scene.focus->displacement, 0.1);
    if (input.uncertainty != nullptr) show_errors(scene);
    return scene;
}

}  // namespace

Eigen::Isometry3d alignment_of(const nlohmann::json& report) {
    Eigen::Isometry3d alignment = Eigen::Isometry3d::Identity();
    const auto entry = report.is_object() ? report.find("alignment") : report.end();
    if (entry == report.end() || !entry->is_object() || !entry->contains("matrix")) return alignment;
    const nlohmann::json& rows = (*entry)["matrix"];
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column) {
            const auto at = [&](const nlohmann::json& list, int k) {
                return list.is_array() && list.size() > static_cast<std::size_t>(k) ? list[static_cast<std::size_t>(k)]
                                                                                    : nlohmann::json();
            };
            const nlohmann::json value = rows.size() == 16 ? at(rows, 4 * row + column) : at(at(rows, row), column);
            if (!value.is_number()) return Eigen::Isometry3d::Identity();
            alignment.matrix()(row, column) = value.get<double>();
        }
    return alignment;
}

Preview draw_preview(const ReportInput& input) {
    require_input(input);
    const Scene scene = scene_of(input);
    const std::vector<Column> columns = columns_of(scene);
    std::array<int, 3> top{};
    int height = top_margin;
    for (std::size_t row = 0; row < 3; ++row) {
        top[row] = height;
        height += scene.fixed_planes[row].grid.size[1] + gap;
    }
    constexpr int least_width = 660;  // of the legend
    int width = left_margin + (columns.back().bar_mm > 0 ? 0 : left_margin - gap);
    for (const Column& column : columns) width += column.width();
    cv::Mat page(height + bottom_margin, std::max(width, least_width), CV_8UC3, background);
    int x = left_margin;
    for (const Column& column : columns) {
        const bool first = &column == &columns.front();
        text(page, column.title, {x + cell / 2, 34}, 0.85, ink, Anchor::Centre);
        text(page, column.subtitle, {x + cell / 2, 62}, 0.55, faint, Anchor::Centre);
        for (int row = 0; row < 3; ++row) {
            cv::Mat panel = column.draw(row);
            const auto index = static_cast<std::size_t>(row);
            const Plane& plane = (column.of_moving_frame ? scene.moving_planes : scene.fixed_planes)[index];
            letters(panel, plane);
            if (first || column.of_moving_frame) place_name(panel, plane);
            if (first) scale_bar(panel, scene.mm_per_pixel);
            const cv::Size size(std::min(panel.cols, cell), panel.rows);
            panel(cv::Rect({0, 0}, size)).copyTo(page(cv::Rect({x + (cell - size.width) / 2, top[index]}, size)));
        }
        if (column.bar_mm > 0)
            vertical_bar(page, {x + cell + gap + 8, top[0] + 30, 16, std::max(top[1] - top[0] - 60, 40)},
                         column.bar_mm);
        x += column.width();
    }
    legend(page, columns, scene);
    return {page, scene.focus, scene.displacement_limit, scene.error_limit};
}

}  // namespace tissuewarp::report::detail
