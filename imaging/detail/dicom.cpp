#include "imaging/detail/dicom.hpp"

#include "imaging/detail/dicom_file.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/segments.hpp"
#include "imaging/detail/structure_set.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

/// A frame of the series and where it lies.
struct Slice {
    const DicomFile* file = nullptr;
    std::size_t index = 0;  ///< of the frame in its file
    double height = 0.0;    ///< mm along the normal of the first frame

    [[nodiscard]] const DicomFrame& frame() const { return file->frames[index]; }
    [[nodiscard]] std::string name() const {
        const std::string quoted = "'" + file->path.filename().string() + "'";
        return file->frames.size() == 1 ? quoted : "frame " + std::to_string(index + 1) + " of " + quoted;
    }
};

InvalidInput unusable_series(const fs::path& path, const std::string& cause) {
    std::error_code ignored;
    return InvalidInput("cannot use the DICOM " + std::string(fs::is_directory(path, ignored) ? "folder" : "file") +
                        " '" + path.string() + "': " + cause);
}

std::string in_mm(double value) {
    std::ostringstream text;
    text.precision(6);
    text << value << " mm";
    return text.str();
}

/// "1.2.3 (CT, 28 files)".
std::string description(const std::vector<DicomFile>& files, const std::string& series) {
    std::size_t count = 0;
    std::string modality;
    for (const DicomFile& file : files)
        if (file.series == series) ++count, modality = file.modality;
    return series + " (" + modality + ", " + std::to_string(count) + (count == 1 ? " file)" : " files)");
}

std::vector<fs::path> files_in(const fs::path& folder) {
    std::vector<fs::path> paths;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder))
        if (entry.is_regular_file() && is_dicom_file(entry.path())) paths.push_back(entry.path());
    std::sort(paths.begin(), paths.end());
    return paths;
}

/// The files of the one series.
std::vector<DicomFile> read_series(const fs::path& path) {
    std::error_code ignored;
    const bool folder = fs::is_directory(path, ignored);
    std::vector<DicomFile> files;
    const std::vector<fs::path> paths = folder ? files_in(path) : std::vector<fs::path>{path};
    for (const fs::path& name : paths)
        if (auto file = read_dicom_file(name)) files.push_back(std::move(*file));
    if (files.empty())
        throw unusable_series(path, std::string("it holds no DICOM images") +
                                        (paths.empty() ? "" : " (plans, contours and reports have no pixels)") +
                                        "; give the folder of one series, or a structure set (RTSTRUCT) as a file");
    std::set<std::string> series;
    for (const DicomFile& file : files) series.insert(file.series);
    if (series.size() > 1)
        throw unusable_series(path, "it holds " + std::to_string(series.size()) + " series (" +
                                        description(files, *series.begin()) + ", " +
                                        description(files, *std::next(series.begin())) +
                                        (series.size() > 2 ? ", ..." : "") + "); move each into a folder of its own");
    return files;
}

void require_placed(const fs::path& path, const Slice& slice) {
    if (slice.file->mosaic)
        throw unusable_series(path, slice.name() +
                                        " is a mosaic, many slices side by side in one picture; convert it "
                                        "with dcm2niix");
    const DicomFrame& frame = slice.frame();
    const char* missing = !frame.position  ? "position (Image Position (Patient))"
                          : !frame.axes    ? "orientation (Image Orientation (Patient))"
                          : !frame.spacing ? "pixel size (Pixel Spacing)"
                                           : nullptr;
    if (missing == nullptr) return;
    throw unusable_series(path, slice.name() + " of modality '" + slice.file->modality + "' states no " + missing +
                                    ": a secondary capture or a plain picture has no place in the patient; export the "
                                    "original series");
}

std::vector<Slice> slices_of(const fs::path& path, const std::vector<DicomFile>& files) {
    std::vector<Slice> slices;
    std::map<std::string, int> stacks;
    for (const DicomFile& file : files)
        for (std::size_t i = 0; i < file.frames.size(); ++i) {
            slices.push_back({&file, i});
            require_placed(path, slices.back());
            ++stacks[file.frames[i].stack];
        }
    if (stacks.size() > 1) {
        std::string text;
        for (const auto& [stack, count] : stacks)
            text += (text.empty() ? "'" : ", '") + stack + "': " + std::to_string(count) + " frames";
        throw unusable_series(path, "it holds " + std::to_string(stacks.size()) + " stacks (" + text +
                                        "); export each as a series of its own");
    }
    return slices;
}

Eigen::Vector3d normal_of(const DicomFrame& frame) {
    return frame.axes->col(0).cross(frame.axes->col(1));
}

/// Every slice must have the size, in-plane spacing and axes of the first.
void require_alike(const fs::path& path, const std::vector<Slice>& slices) {
    const Slice& first = slices.front();
    for (const Slice& slice : slices) {
        const DicomFrame &own = slice.frame(), &other = first.frame();
        const bool alike = slice.file->rows == first.file->rows && slice.file->columns == first.file->columns &&
                           (*own.axes - *other.axes).cwiseAbs().maxCoeff() < 1e-3 &&
                           (*own.spacing - *other.spacing).cwiseAbs().maxCoeff() < 1e-3 * (*other.spacing)[0];
        if (!alike)
            throw unusable_series(path, slice.name() + " differs in size, pixel spacing or orientation from " +
                                            first.name() + "; keep only the slices of one acquisition");
    }
}

void sort_by_height(std::vector<Slice>& slices) {
    const Eigen::Vector3d normal = normal_of(slices.front().frame());
    for (Slice& slice : slices) slice.height = normal.dot(*slice.frame().position);
    std::stable_sort(slices.begin(), slices.end(), [](const Slice& a, const Slice& b) { return a.height < b.height; });
}

/// Slices of a stack must follow the normal of the first: over the whole stack they may leave it by a tenth of a pixel.
void require_upright(const fs::path& path, const Slice& first, const Slice& last) {
    const Eigen::Vector3d normal = normal_of(first.frame());
    const Eigen::Vector3d along = *last.frame().position - *first.frame().position;
    const double height = normal.dot(along), shift = (along - normal * height).norm();
    if (shift <= 0.1 * first.frame().spacing->minCoeff()) return;
    std::ostringstream angle;
    angle.precision(3);
    angle << std::atan2(shift, std::abs(height)) * 180.0 / M_PI;
    throw unusable_series(path, "its slices are shifted sideways by " + in_mm(shift) + " over the stack, " +
                                    angle.str() +
                                    " degrees (gantry tilt); correct the tilt first, with dcm2niix for "
                                    "instance");
}

/// Heights of an even stack, first + k distance, mm.
struct EvenSteps {
    double first = 0.0, distance = 0.0;
};

/// The even stack nearest to the slices by least squares, and how far the farthest of them lies off it, mm.
std::pair<EvenSteps, double> fitted_steps(const std::vector<Slice>& slices) {
    const auto count = static_cast<Eigen::Index>(slices.size());
    Eigen::ArrayXd heights(count);
    for (Eigen::Index k = 0; k < count; ++k) heights[k] = slices[static_cast<std::size_t>(k)].height;
    const Eigen::ArrayXd from_middle =
        Eigen::ArrayXd::LinSpaced(count, 0.0, double(count - 1)) - 0.5 * double(count - 1);
    const double distance = (from_middle * heights).sum() / from_middle.square().sum();
    const Eigen::ArrayXd even = heights.mean() + distance * from_middle;
    return {{even[0], distance}, (heights - even).abs().maxCoeff()};
}

/// Steps between sorted slices, each at its place.
EvenSteps even_steps(const fs::path& path, const std::vector<Slice>& slices, std::vector<std::string>& notes) {
    constexpr double same_place = 1e-3;
    if (slices.front().file == slices.back().file && slices.back().height - slices.front().height < same_place)
        throw unusable_series(path, "its " + std::to_string(slices.size()) +
                                        " frames lie at one position, since none has a position of its own (as in "
                                        "nuclear medicine) or they are one slice again and again; export them as a "
                                        "volume with a position for each slice");
    const auto [fitted, off] = fitted_steps(slices);
    std::vector<double> distances;
    for (std::size_t i = 1; i < slices.size(); ++i) distances.push_back(slices[i].height - slices[i - 1].height);
    std::vector<double> sorted = distances;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    const double usual = sorted[sorted.size() / 2];
    // Positions are printed with few digits: 2 % of a slice or 0.01 mm is rounding, more is a gap.
    const double tolerance = std::max(0.02 * usual, 0.01);
    // Some programs round them to 0.1 mm, which no distance between two shows, and the whole stack does.
    const bool rounded = off <= std::min(0.08, 0.12 * fitted.distance);
    bool noted = false;
    for (std::size_t i = 0; i < distances.size(); ++i) {
        if (distances[i] < same_place)
            throw unusable_series(path, "two slices lie at the same position (" + slices[i].name() + ", " +
                                            slices[i + 1].name() +
                                            "); keep one of each (echoes, time points and b-values are volumes of "
                                            "their own)");
        if (std::abs(distances[i] - usual) <= tolerance) continue;
        if (!rounded)
            throw unusable_series(path, "slices are missing or uneven: " + in_mm(distances[i]) + " between " +
                                            slices[i].name() + " and " + slices[i + 1].name() + ", " + in_mm(usual) +
                                            " elsewhere; export the whole series, or resample it to even slices");
        noted = true;
    }
    const double first = slices.front().height, last = slices.back().height;
    if (!noted) return {first, (last - first) / static_cast<double>(distances.size())};
    notes.push_back("slices lie up to " + in_mm(off) + " off even steps of " + in_mm(fitted.distance) +
                    ", as rounded positions do; the even steps are taken");
    return fitted;
}

/// A grid from its first slice.
Geometry grid_of(const Slice& first, int count, double distance) {
    Geometry grid;
    grid.size = {first.file->columns, first.file->rows, count};
    grid.origin = *first.frame().position;
    grid.spacing << *first.frame().spacing, distance;
    grid.direction << *first.frame().axes, normal_of(first.frame());
    return grid;
}

/// The depth that holds what every frame stands for.
int depth_of(const std::vector<Slice>& slices) {
    bool plain = true, whole = true;
    double least = 0.0, most = 0.0;
    int bits = 0;
    for (const Slice& slice : slices) {
        const double slope = slice.frame().slope, intercept = slice.frame().intercept;
        plain &= slope == 1.0 && intercept == 0.0 && slice.file->bits_allocated == slices[0].file->bits_allocated &&
                 slice.file->is_signed == slices[0].file->is_signed;
        whole &= slope == std::floor(slope) && intercept == std::floor(intercept);
        bits = std::max(bits, slice.file->bits_allocated);
        const double range = std::exp2(slice.file->bits_stored);
        for (const double stored :
             slice.file->is_signed ? std::array{-range / 2, range / 2 - 1} : std::array{0.0, range - 1}) {
            least = std::min(least, slope * stored + intercept);
            most = std::max(most, slope * stored + intercept);
        }
    }
    if (plain) return -1;  // as stored
    if (!whole) return bits > 16 ? CV_64F : CV_32F;
    if (least >= -32768.0 && most <= 32767.0) return CV_16S;
    if (least >= 0.0 && most <= 65535.0) return CV_16U;
    return least >= -2147483648.0 && most <= 2147483647.0 ? CV_32S : CV_64F;
}

/// Pixels of each file, frame by frame, to where they go: `use(slice, frame's pixels)`.
template <class Use>
void for_each_frame(const std::vector<DicomFile>& files, const std::vector<Slice>& slices, const Use& use) {
    for (const DicomFile& file : files) {
        const cv::Mat frames = read_dicom_pixels(file);
        const int sizes[2] = {file.rows, file.columns};
        for (const Slice& slice : slices) {
            if (slice.file != &file) continue;
            void* first = const_cast<uchar*>(frames.ptr(static_cast<int>(slice.index)));
            use(slice, cv::Mat(2, sizes, frames.type(), first));
        }
    }
}

void require_linear_values(const std::vector<DicomFile>& files) {
    for (const DicomFile& file : files)
        if (file.value_table)
            throw unusable(file.path,
                           "its values are entries of a table (Modality LUT Sequence, 0028,3000), which is "
                           "not read; export it with Rescale Slope and Rescale Intercept");
}

Volume read_image(const fs::path& path, const std::vector<DicomFile>& files, std::vector<Slice> slices,
                  std::vector<std::string>& notes) {
    require_linear_values(files);
    if (slices.size() < 2) throw unusable_series(path, "it holds one slice; give the folder of the whole series");
    require_alike(path, slices);
    sort_by_height(slices);
    const EvenSteps steps = even_steps(path, slices, notes);
    require_upright(path, slices.front(), slices.back());
    Geometry grid = grid_of(slices.front(), static_cast<int>(slices.size()), steps.distance);
    grid.origin += (steps.first - slices.front().height) * grid.direction.col(2);
    require_valid(grid, path.c_str());
    int depth = depth_of(slices);
    Volume volume;
    for_each_frame(files, slices, [&](const Slice& slice, const cv::Mat& pixels) {
        if (depth < 0) depth = pixels.depth();
        if (volume.empty()) volume = Volume(grid, depth);
        const auto k = static_cast<int>(
            std::find_if(slices.begin(), slices.end(),
                         [&](const Slice& s) { return s.file == slice.file && s.index == slice.index; }) -
            slices.begin());
        const int sizes[2] = {grid.size[1], grid.size[0]};
        cv::Mat target(2, sizes, volume.voxels.type(), volume.voxels.ptr(k));
        pixels.convertTo(target, depth, slice.frame().slope, slice.frame().intercept);
    });
    return volume;
}

/// Frames of a segmentation lie where segments are: the grid is made from the steps between their places.
Geometry segmentation_grid(const fs::path& path, std::vector<Slice>& slices) {
    require_alike(path, slices);
    sort_by_height(slices);
    std::vector<const Slice*> places{&slices.front()};
    for (const Slice& slice : slices)
        if (slice.height - places.back()->height > 1e-2) places.push_back(&slice);
    if (places.size() < 2)
        throw unusable_series(path, "its segments lie in one slice; give a segmentation of a volume");
    double step = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i < places.size(); ++i) step = std::min(step, places[i]->height - places[i - 1]->height);
    const double stated = slices.front().frame().slice_spacing.value_or(0.0);
    const double height = places.back()->height - places.front()->height;
    // The stated spacing is finer where every other slice holds no segment; a thickness may be anything.
    if (stated > 0.0 && std::abs(std::round(step / stated) * stated - step) < 0.02 * stated) step = stated;
    const double count = std::round(height / step), most = 100.0 * static_cast<double>(places.size());
    if (count > std::max(1000.0, most))
        throw unusable_series(path, "its " + std::to_string(places.size()) + " slices lie over " + in_mm(height) +
                                        ", in steps of " + in_mm(step) +
                                        ": more than 100 empty ones to each; the positions are damaged");
    for (const Slice* place : places) {
        const double steps = (place->height - places.front()->height) / (height / count);
        if (std::abs(steps - std::round(steps)) > 0.02)
            throw unusable_series(path, "slices are uneven: " + place->name() + " lies " +
                                            in_mm(place->height - places.front()->height) +
                                            " from the first, no whole "
                                            "number of steps of " +
                                            in_mm(step) + "; export it on an even grid");
    }
    require_upright(path, slices.front(), slices.back());
    const Geometry grid = grid_of(slices.front(), static_cast<int>(count) + 1, height / count);
    require_valid(grid, path.c_str());
    values_of(path, {1.0 * grid.size[0], 1.0 * grid.size[1], 1.0 * grid.size[2]});
    return grid;
}

/// Segment numbers of the pixels of one frame.
template <class Paint>
void read_segment_frame(const Slice& slice, const cv::Mat& pixels, const Paint& paint) {
    cv::Mat values;
    pixels.convertTo(values, CV_32S);
    const DicomFile& file = *slice.file;
    const double least = file.segmentation == DicomFile::Segmentation::Fractional ? 0.5 * file.most_fraction : 1.0;
    const bool numbers = file.segmentation == DicomFile::Segmentation::LabelMap;
    const auto count = static_cast<std::int64_t>(values.total());
    for (std::int64_t i = 0; i < count; ++i)
        if (const int value = values.ptr<int>()[i]; value >= least) paint(i, numbers ? value : slice.frame().segment);
}

/// Of all files of one segmentation, in which a number is one segment.
std::map<int, std::string> segment_names(const fs::path& path, const std::vector<DicomFile>& files) {
    std::map<int, const DicomFile*> file_of;
    for (const DicomFile& file : files)
        for (const auto& [number, name] : file.segment_names) {
            const DicomFile& first = *file_of.try_emplace(number, &file).first->second;
            if (first.segment_names.at(number) != name)
                throw unusable_series(
                    path, "segment " + std::to_string(number) + " is '" + first.segment_names.at(number) + "' in " +
                              first.path.filename().string() + " and '" + name + "' in " +
                              file.path.filename().string() + "; give one file, or number the segments anew");
        }
    std::map<int, std::string> names;
    for (const auto& [number, file] : file_of) names[number] = file->segment_names.at(number);
    return names;
}

ReadResult read_segmentation(const fs::path& path, const std::vector<DicomFile>& files, std::vector<Slice> slices) {
    ReadResult result;
    result.label_names = segment_names(path, files);
    for (const Slice& slice : slices)
        if (slice.file->segmentation != DicomFile::Segmentation::LabelMap && slice.frame().segment < 1)
            throw unusable_series(path,
                                  slice.name() + " names no segment (Referenced Segment Number); export it again");
    const Geometry grid = segmentation_grid(path, slices);
    const std::int64_t plane = std::int64_t{grid.size[0]} * grid.size[1];
    const double first = slices.front().height;
    std::optional<SegmentPainter> painter;  // memory is asked for once a frame was there
    for_each_frame(files, slices, [&](const Slice& slice, const cv::Mat& pixels) {
        if (!painter) painter.emplace(grid);
        const auto k = static_cast<std::int64_t>(std::llround((slice.height - first) / grid.spacing[2]));
        read_segment_frame(slice, pixels, [&](std::int64_t i, int label) { painter->paint(plane * k + i, label); });
    });
    result.volume = painter.value().disjoint(path, result.label_names);
    if (files.front().segmentation == DicomFile::Segmentation::Fractional)
        result.notes.emplace_back("a fractional segmentation: voxels that a segment fills by half or more are its own");
    return result;
}

}  // namespace

bool is_dicom_file(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::array<char, 132> head{};
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    if (file.gcount() == 132 && std::string(head.data() + 128, 4) == "DICM") return true;
    // Old files have no preamble: they begin with an element of group 0008 (or 0002), whose elements are small.
    const bool little = (head[0] == 8 || head[0] == 2) && head[1] == 0 && head[3] == 0;
    return file.gcount() >= 8 && little && (head[2] == 0 || head[2] == 1 || head[2] == 5 || head[2] == 8);
}

ReadResult read_dicom(const fs::path& path) {
    std::error_code ignored;
    if (fs::is_regular_file(path, ignored))
        if (const auto set = read_structure_set(path)) return labels_of(*set, path, nullptr);
    const std::vector<DicomFile> files = read_series(path);
    std::vector<Slice> slices = slices_of(path, files);
    const bool segmentation = std::any_of(files.begin(), files.end(), [](const DicomFile& file) {
        return file.segmentation != DicomFile::Segmentation::None;
    });
    if (segmentation) return read_segmentation(path, files, std::move(slices));
    ReadResult result;
    result.volume = read_image(path, files, std::move(slices), result.notes);
    return result;
}

}  // namespace tissuewarp::imaging::detail
