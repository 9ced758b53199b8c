#include "imaging/detail/structure_set.hpp"

#include "imaging/detail/dicom_set.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/filters.hpp"

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr double same_plane_mm = 0.05;  // planes are written with a few digits

struct ContourOptions {
    double pixel_mm = 1;         // where no image gives one
    double margin_mm = 2;        // about all contours
    double most_even = 0.1;      // of a step, that a plane may lie off the grid's
    double gap = 2.5;            // a region's usual step times this is left empty
    double most_overlap = 0.05;  // of the smaller region, that two regions share or do not where one holds the other
    double most_voxels = 3e8;    // more are no patient's
    double farthest_mm = 3000;   // an extent of more is no patient's
};
constexpr ContourOptions contour_options;

std::string quoted(const ContouredRegion& region) {
    return "'" + region.name + "'";
}

/// Closed contours of the region; the kinds of those left out.
ContouredRegion region_of(const DicomSet& contours, int number, std::string name, std::set<std::string>& left_out) {
    ContouredRegion region{number, std::move(name), {}};
    for (const DicomSet& contour : contours.items(0x30060040)) {
        const std::string kind = contour.text(0x30060042);
        const auto data = contour.numbers(0x30060050, 0);
        if (kind != "CLOSED_PLANAR" && kind != "CLOSEDPLANAR_XOR") {
            left_out.insert(kind.empty() ? "contours of no kind" : kind);
            continue;
        }
        if (!data || data->size() % 3 != 0) throw std::out_of_range("contour data");
        if (data->size() < 9) continue;  // encloses nothing
        region.contours.emplace_back(
            Eigen::Map<const Matrix3Xd>(data->data(), 3, static_cast<Eigen::Index>(data->size() / 3)));
    }
    return region;
}

/// A number of a region; nothing where it is none.
std::optional<int> region_number(const DicomSet& set, DicomTag tag) {
    const auto number = set.number(tag);
    if (!number || std::abs(*number) > 1e9) return std::nullopt;
    return static_cast<int>(*number);
}

/// Of regions by number: what kind of thing they are (RT ROI Interpreted Type).
std::map<int, std::string> types_of(const DicomSet& file) {
    std::map<int, std::string> types;
    for (const DicomSet& observation : file.items(0x30060080))
        if (const auto number = region_number(observation, 0x30060084)) types[*number] = observation.text(0x300600a4);
    return types;
}

/// Outlines of the patient, volumes of a plan and marks are no tissue of their own.
bool is_tissue(const std::string& type) {
    static const std::set<std::string> others{
        "EXTERNAL",     "PTV",      "CTV",       "ITV",          "TREATED_VOLUME",
        "IRRAD_VOLUME", "BOLUS",    "CONTROL",   "MARKER",       "SUPPORT",
        "DOSE_REGION",  "FIXATION", "ISOCENTER", "REGISTRATION", "DOSE_MEASUREMENT"};
    return !others.contains(type);
}

StructureSet regions_of(const DicomSet& file, const fs::path& path) {
    std::map<int, std::string> names;
    for (const DicomSet& region : file.items(0x30060020))
        if (const auto number = region_number(region, 0x30060022)) names[*number] = region.text(0x30060026);
    std::map<int, std::string> types = types_of(file);
    StructureSet set;
    for (const DicomSet& contours : file.items(0x30060039)) {
        std::set<std::string> left_out;
        const int number = region_number(contours, 0x30060084).value_or(0);
        std::string name = names[number].empty() ? "region " + std::to_string(number) : names[number];
        if (!is_tissue(types[number])) {
            set.notes.push_back("'" + name + "' is no tissue (" + types[number] + ") and left out");
            continue;
        }
        ContouredRegion region = region_of(contours, number, std::move(name), left_out);
        for (const std::string& kind : left_out)
            set.notes.push_back(kind + " of " + quoted(region) + " enclose nothing and are left out");
        if (!region.contours.empty()) set.regions.push_back(std::move(region));
    }
    if (set.regions.empty())
        throw unusable(path,
                       "its regions of tissue have no closed contours (CLOSED_PLANAR); export the structures as "
                       "contours");
    return set;
}

/// Numbers that are labels: as they are where they differ and are positive, otherwise from 1 on, with a note.
void number_regions(StructureSet& set) {
    std::set<int> numbers;
    for (const ContouredRegion& region : set.regions) numbers.insert(region.number);
    if (*numbers.begin() > 0 && numbers.size() == set.regions.size()) return;
    for (std::size_t n = 0; n < set.regions.size(); ++n) set.regions[n].number = static_cast<int>(n) + 1;
    set.notes.emplace_back("regions whose numbers are no labels or repeat are numbered from 1 on, in their order");
}

/// Twice the area that the contour encloses, along its normal (Newell).
Vector3d normal_of(const Matrix3Xd& contour) {
    Vector3d sum = Vector3d::Zero();
    const Vector3d middle = contour.rowwise().mean();
    for (Eigen::Index n = 0; n < contour.cols(); ++n)
        sum += (contour.col(n) - middle).cross(Vector3d(contour.col((n + 1) % contour.cols()) - middle));
    return sum;
}

/// The axes along which contours lie: in the plane, in the plane, across.
Eigen::Matrix3d axes_of(const StructureSet& set) {
    Vector3d largest = Vector3d::Zero();
    for (const ContouredRegion& region : set.regions)
        for (const Matrix3Xd& contour : region.contours)
            if (const Vector3d normal = normal_of(contour); normal.norm() > largest.norm()) largest = normal;
    Vector3d across = largest.normalized();
    Eigen::Index main = 0;
    across.cwiseAbs().maxCoeff(&main);
    if (across[main] < 0) across = -across;
    const Vector3d first = Vector3d::Unit(main == 0 ? 1 : 0);
    const Vector3d along = (first - first.dot(across) * across).normalized();
    Eigen::Matrix3d axes;
    axes << along, across.cross(along), across;
    return axes;
}

/// Of one region: what it shows of each plane, by height.
using Planes = std::map<double, std::vector<Matrix3Xd>>;

/// Contours in coordinates along the axes, by height; heights that digits alone tell apart are one plane.
Planes planes_of(const ContouredRegion& region, const Eigen::Matrix3d& axes, const fs::path& path) {
    Planes planes;
    for (const Matrix3Xd& contour : region.contours) {
        Matrix3Xd turned = axes.transpose() * contour;
        const double height = turned.row(2).mean();
        if ((turned.row(2).array() - height).abs().maxCoeff() > 10 * same_plane_mm)
            throw unusable(path,
                           "a contour of " + quoted(region) +
                               " does not lie in one plane parallel to the others; export it on the slices of one "
                               "series");
        auto plane = planes.lower_bound(height - same_plane_mm);
        if (plane == planes.end() || plane->first > height + same_plane_mm) plane = planes.emplace(height, 0).first;
        plane->second.push_back(std::move(turned));
    }
    return planes;
}

/// Least and usual distance between neighbours; 0 where there is one plane.
std::pair<double, double> steps_of(const std::set<double>& heights) {
    std::vector<double> steps;
    for (auto at = heights.begin(); at != heights.end() && std::next(at) != heights.end(); ++at)
        if (const double step = *std::next(at) - *at; step > same_plane_mm) steps.push_back(step);
    if (steps.empty()) return {0, 0};
    std::sort(steps.begin(), steps.end());
    return {steps.front(), steps[steps.size() / 2]};
}

std::set<double> heights_of(const Planes& planes) {
    std::set<double> heights;
    for (const auto& [height, contours] : planes) heights.insert(height);
    return heights;
}

/// The grid that holds all contours.
Geometry grid_of(const std::vector<Planes>& regions, const Eigen::Matrix3d& axes, const fs::path& path) {
    constexpr ContourOptions options = contour_options;
    std::set<double> heights;
    Vector3d lower = Vector3d::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
    for (const Planes& planes : regions)
        for (const auto& [height, contours] : planes) {
            heights.insert(height);
            for (const Matrix3Xd& contour : contours) {
                lower = lower.cwiseMin(contour.rowwise().minCoeff());
                upper = upper.cwiseMax(contour.rowwise().maxCoeff());
            }
        }
    if ((upper - lower).maxCoeff() > options.farthest_mm || lower.cwiseAbs().maxCoeff() > 1e5)
        throw unusable(path, "its contours span " +
                                 text_of({upper[0] - lower[0], upper[1] - lower[1], upper[2] - lower[2]}) +
                                 " mm, more than a patient; check its units");
    const double step = steps_of(heights).first;
    if (!(step > 0)) throw unusable(path, "its contours lie in one plane; give contours of a volume");
    Geometry grid;
    grid.direction = axes;
    grid.spacing = {options.pixel_mm, options.pixel_mm, step};
    for (int axis = 0; axis < 2; ++axis) {
        lower[axis] -= options.margin_mm;
        grid.size[static_cast<std::size_t>(axis)] =
            static_cast<int>(std::ceil((upper[axis] + options.margin_mm - lower[axis]) / options.pixel_mm)) + 1;
    }
    lower[2] -= step;  // an empty slice on either side
    grid.size[2] = static_cast<int>(std::ceil((upper[2] - lower[2]) / step - options.most_even)) + 2;
    grid.origin = axes * lower;
    if (double(grid.size[0]) * grid.size[1] * grid.size[2] > options.most_voxels ||
        grid.size[2] > 1000 + 100 * double(heights.size()))
        throw unusable(path, "its contours would take " +
                                 text_of({1.0 * grid.size[0], 1.0 * grid.size[1], 1.0 * grid.size[2]}) +
                                 " voxels; planes that lie close together are damaged, or more than one patient's");
    require_valid(grid, path.c_str());
    return grid;
}

/// Pixels within an odd number of contours, uint8 0 or 255. Edges toggle what lies behind them in each row.
cv::Mat filled(const std::vector<Matrix3Xd>& contours, const Geometry& grid) {
    const Vector3d origin = grid.direction.transpose() * grid.origin;
    const auto [columns, rows, slices] = grid.size;
    cv::Mat inside = cv::Mat::zeros(rows, columns, CV_8U);
    const auto pixel = [&](const Matrix3Xd& contour, Eigen::Index n) -> Eigen::Vector2d {
        return (contour.col(n % contour.cols()) - origin).head<2>().cwiseQuotient(grid.spacing.head<2>());
    };
    for (const Matrix3Xd& contour : contours)
        for (Eigen::Index n = 0; n < contour.cols(); ++n) {
            Eigen::Vector2d a = pixel(contour, n), b = pixel(contour, n + 1);
            if (a[1] > b[1]) std::swap(a, b);
            const double end = std::min(b[1], 1.0 * rows);
            for (double row = std::max(0.0, std::ceil(a[1])); row < end; ++row) {
                const double column = std::ceil(a[0] + (row - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
                if (column < columns)
                    inside.at<std::uint8_t>(static_cast<int>(row), static_cast<int>(std::max(0.0, column))) ^= 255;
            }
        }
    for (int row = 0; row < rows; ++row)
        for (int i = 1; i < columns; ++i) inside.at<std::uint8_t>(row, i) ^= inside.at<std::uint8_t>(row, i - 1);
    return inside;
}

/// To the boundary, pixels, positive inside.
cv::Mat signed_distance(const cv::Mat& inside) {
    cv::Mat in, out;
    cv::distanceTransform(inside, in, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    cv::distanceTransform(~inside, out, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    return in - out;
}

/// What a region shows at heights between its planes.
class RegionSlices {
public:
    RegionSlices(const Planes& planes, const Geometry& grid)
        : planes_(planes), grid_(grid), usual_step_(steps_of(heights_of(planes)).second) {}

    /// Empty where there is nothing of it. Beyond the outermost planes a region goes on for half a step.
    [[nodiscard]] cv::Mat at(double height) const {
        const auto above = planes_.lower_bound(height);
        const auto below = above == planes_.begin() ? planes_.end() : std::prev(above);
        for (const double near : {contour_options.most_even * grid_.spacing[2],
                                  0.5 * std::min(grid_.spacing[2], std::max(usual_step_, same_plane_mm))}) {
            for (const auto plane : {below, above})
                if (plane != planes_.end() && std::abs(plane->first - height) < near)
                    return filled(plane->second, grid_);
            if (below != planes_.end() && above != planes_.end() &&
                above->first - below->first < contour_options.gap * usual_step_)
                return between(*below, *above, height);
        }
        return {};
    }

private:
    const Planes& planes_;
    const Geometry& grid_;
    double usual_step_;

    [[nodiscard]] cv::Mat between(const Planes::value_type& below, const Planes::value_type& above,
                                  double height) const {
        const double nearness = (height - below.first) / (above.first - below.first);
        const cv::Mat a = signed_distance(filled(below.second, grid_)),
                      b = signed_distance(filled(above.second, grid_));
        return (1 - nearness) * a + nearness * b > 0;
    }
};

/// One label map of regions, smaller ones over larger ones.
class RegionMap {
public:
    explicit RegionMap(const Geometry& grid) : labels_(grid, CV_32S) {}

    /// Of voxels within the region, in its order.
    void paint(const RegionSlices& slices, int label) {
        const Geometry& grid = labels_.geometry;
        const double first = grid.direction.col(2).dot(grid.origin);
        for (int k = 0; k < grid.size[2]; ++k) {
            const cv::Mat inside = slices.at(first + k * grid.spacing[2]);
            if (inside.empty()) continue;
            int* voxel = labels_.voxels.ptr<int>(k);
            for (int n = 0; n < grid.size[0] * grid.size[1]; ++n) {
                if (inside.data[n] == 0) continue;
                ++voxels_[label];
                if (voxel[n] != 0) ++shared_[{voxel[n], label}];
                voxel[n] = label;
            }
        }
    }
    /// Throws InvalidInput where two regions share more than a rim.
    [[nodiscard]] Volume disjoint(const fs::path& path, const std::map<int, std::string>& names,
                                  std::vector<std::string>& notes) const {
        for (const auto& [pair, count] : shared_) {
            const auto [larger, smaller] = pair;
            const std::string both = "'" + names.at(larger) + "' and '" + names.at(smaller) + "' share " +
                                     std::to_string(count) + " of " + std::to_string(voxels_.at(smaller)) + " voxels";
            const double share = double(count) / double(voxels_.at(smaller)), rim = contour_options.most_overlap;
            if (share > rim && share < 1 - rim)
                throw unusable(path,
                               "regions overlap: " + both +
                                   "; a voxel has one label, so export only the regions that are to be registered");
            notes.push_back(both + ": they count for the smaller");
        }
        return labels_;
    }

private:
    Volume labels_;
    std::map<int, std::int64_t> voxels_;
    std::map<std::pair<int, int>, std::int64_t> shared_;
};

double enclosed(const ContouredRegion& region) {
    double sum = 0;
    for (const Matrix3Xd& contour : region.contours) sum += normal_of(contour).norm();
    return sum;
}

}  // namespace

std::optional<StructureSet> read_structure_set(const fs::path& path) {
    const DicomBytes read(path);
    if (read.set.text(0x00080060) != "RTSTRUCT") return std::nullopt;
    try {
        StructureSet set = regions_of(read.set, path);
        number_regions(set);
        return set;
    } catch (const std::out_of_range&) {
        throw IoError("cannot read '" + path.string() +
                      "' as DICOM: a contour is cut short or damaged; export the structure set again");
    }
}

ReadResult labels_of(const StructureSet& set, const fs::path& path, const Geometry* image) {
    const Eigen::Matrix3d axes = axes_of(set);
    const bool in_image = image != nullptr && std::abs(image->direction.col(2).dot(axes.col(2))) > 1 - 1e-6;
    std::vector<const ContouredRegion*> by_size;
    for (const ContouredRegion& region : set.regions) by_size.push_back(&region);
    std::stable_sort(by_size.begin(), by_size.end(),
                     [](const auto* a, const auto* b) { return enclosed(*a) > enclosed(*b); });
    std::vector<Planes> planes;
    for (const ContouredRegion* region : by_size)
        planes.push_back(planes_of(*region, in_image ? image->direction : axes, path));
    const Geometry own = grid_of(planes, in_image ? image->direction : axes, path);
    const Geometry& grid = in_image ? *image : own;
    RegionMap map(grid);
    ReadResult result;
    result.notes = set.notes;
    for (std::size_t n = 0; n < planes.size(); ++n) {
        result.label_names[by_size[n]->number] = by_size[n]->name;
        map.paint(RegionSlices(planes[n], grid), by_size[n]->number);
    }
    result.volume = map.disjoint(path, result.label_names, result.notes);
    result.notes.push_back("contours in planes " + text_of({own.spacing[2]}) + " mm apart, drawn " +
                           (in_image ? "on the image's voxels" : "on pixels of " + text_of({own.spacing[0]}) + " mm") +
                           "; slices between the planes of a region are interpolated");
    if (image != nullptr && !in_image) result.volume = resample(result.volume, *image, Interpolation::Nearest);
    return result;
}

}  // namespace tissuewarp::imaging::detail
