#include "imaging/detail/dicom_series.hpp"

#include "core/errors.hpp"
#include "imaging/detail/itk_voxels.hpp"

#include <itkGDCMImageIO.h>
#include <itkGDCMSeriesFileNames.h>

#include <gdcmReader.h>
#include <gdcmTrace.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <sstream>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

struct Slice {
    std::string file;
    Geometry geometry;
    cv::Mat voxels;         ///< rows × columns, or frames × rows × columns
    double position = 0.0;  ///< mm along the normal of the first slice
};

InvalidInput unusable(const fs::path& folder, const std::string& cause) {
    return InvalidInput("cannot use the DICOM folder '" + folder.string() + "': " + cause);
}

std::string in_mm(double value) {
    std::ostringstream text;
    text.precision(6);
    text << value << " mm";
    return text.str();
}

std::vector<std::string> files_of_the_series(const fs::path& folder) {
    const auto names = itk::GDCMSeriesFileNames::New();
    names->SetUseSeriesDetails(true);
    names->SetRecursive(false);
    names->SetInputDirectory(folder.string());
    const std::vector<std::string> series = names->GetSeriesUIDs();
    if (series.empty()) throw unusable(folder, "it holds no DICOM images; give the folder of one series");
    if (series.size() > 1)
        throw unusable(folder, "it holds " + std::to_string(series.size()) + " series (" + series[0] + ", " +
                                   series[1] + (series.size() > 2 ? ", ..." : "") +
                                   "); move each into a folder of its own");
    return names->GetFileNames(series[0]);
}

/// GDCM fills a truncated slice with what it finds and goes on. Skipping the pixel data by their stated length must not
/// lead beyond the end of the file.
void require_whole_slice(const std::string& file) {
    gdcm::Reader reader;
    reader.SetFileName(file.c_str());
    const gdcm::Tag pixel_data(0x7fe0, 0x0010), just_before(0x7fe0, 0x000f);
    if (!reader.ReadUpToTag(just_before, {pixel_data}))
        throw IoError("cannot read '" + file + "' as DICOM; copy the file again");
    const auto& syntax = reader.GetFile().GetHeader().GetDataSetTransferSyntax();
    // Compressed frames carry their own lengths, which the decoder checks; deflated files have no positions.
    if (syntax.IsEncapsulated() || syntax == gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian) return;
    const std::uint64_t expected = reader.GetStreamCurrentPosition(), found = fs::file_size(file);
    if (found < expected)
        throw IoError("'" + file + "' is cut short: " + std::to_string(found) + " bytes of " +
                      std::to_string(expected) + "; copy the file again");
}

Slice read_slice(const std::string& file) {
    require_whole_slice(file);
    const auto io = itk::GDCMImageIO::New();
    io->SetFileName(file);
    io->ReadImageInformation();
    if (io->GetNumberOfComponents() != 1)
        throw InvalidInput("cannot use '" + file + "': it is a colour image; give a grey one");
    Slice slice;
    slice.file = file;
    slice.geometry = geometry_of(*io);
    slice.voxels = read_voxels(*io, slice.geometry, file);
    return slice;
}

/// Every slice must have the size, in-plane spacing and axes of the first.
void require_alike(const fs::path& folder, const std::vector<Slice>& slices) {
    const Geometry& first = slices.front().geometry;
    for (const Slice& slice : slices) {
        const Geometry& own = slice.geometry;
        const bool alike = own.size == first.size && (own.direction - first.direction).cwiseAbs().maxCoeff() < 1e-3 &&
                           (own.spacing - first.spacing).head<2>().cwiseAbs().maxCoeff() < 1e-3 * first.spacing[0];
        if (!alike)
            throw unusable(folder, "'" + fs::path(slice.file).filename().string() +
                                       "' differs in size, pixel spacing or orientation from '" +
                                       fs::path(slices.front().file).filename().string() +
                                       "'; keep only the slices of one acquisition");
    }
}

/// Sorts by position and returns the distance between slices.
double sort_by_position(const fs::path& folder, std::vector<Slice>& slices) {
    const Eigen::Vector3d normal =
        slices.front().geometry.direction.col(0).cross(slices.front().geometry.direction.col(1));
    for (Slice& slice : slices) slice.position = normal.dot(slice.geometry.origin);
    std::stable_sort(slices.begin(), slices.end(),
                     [](const Slice& a, const Slice& b) { return a.position < b.position; });
    const auto gaps = static_cast<double>(slices.size() - 1);
    const double mean = (slices.back().position - slices.front().position) / gaps;
    std::vector<double> distances;
    for (std::size_t i = 1; i < slices.size(); ++i) distances.push_back(slices[i].position - slices[i - 1].position);
    std::vector<double> sorted = distances;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    const double usual = sorted[sorted.size() / 2];
    // Positions are printed with few digits: 2 % of a slice or 0.01 mm is rounding, more is a gap.
    const double tolerance = std::max(0.02 * usual, 0.01);
    for (std::size_t i = 0; i < distances.size(); ++i) {
        if (distances[i] < 1e-3)
            throw unusable(folder, "two slices lie at the same position (" +
                                       fs::path(slices[i].file).filename().string() + ", " +
                                       fs::path(slices[i + 1].file).filename().string() + "); keep one of each");
        if (std::abs(distances[i] - usual) > tolerance)
            throw unusable(folder, "slices are missing or uneven: " + in_mm(distances[i]) + " between '" +
                                       fs::path(slices[i].file).filename().string() + "' and '" +
                                       fs::path(slices[i + 1].file).filename().string() + "', " + in_mm(usual) +
                                       " elsewhere; export the whole series, or resample it to even slices");
    }
    const Eigen::Vector3d along = slices.back().geometry.origin - slices.front().geometry.origin;
    const double shift = (along - normal * normal.dot(along)).norm();
    if (shift > 0.01 * along.norm())
        throw unusable(folder, "its slices are shifted sideways by " + in_mm(shift) +
                                   " over the stack (gantry tilt); correct the tilt first");
    return mean;
}

Volume stacked(std::vector<Slice>& slices, double distance) {
    Geometry geometry = slices.front().geometry;
    geometry.size[2] = static_cast<int>(slices.size());
    geometry.spacing[2] = distance;
    geometry.direction.col(2) = geometry.direction.col(0).cross(geometry.direction.col(1));
    // The rescale slope may differ from slice to slice (PET), and with it the type that ITK chooses.
    const int depth = slices.front().voxels.depth();
    const bool one_type =
        std::all_of(slices.begin(), slices.end(), [&](const Slice& s) { return s.voxels.depth() == depth; });
    Volume volume(geometry, one_type ? depth : CV_32F);
    for (std::size_t k = 0; k < slices.size(); ++k) {
        const int sizes[2] = {geometry.size[1], geometry.size[0]};
        cv::Mat target(2, sizes, volume.voxels.type(), volume.voxels.ptr(static_cast<int>(k)));
        cv::Mat(2, sizes, slices[k].voxels.type(), slices[k].voxels.data).convertTo(target, volume.voxels.depth());
    }
    return volume;
}

}  // namespace

Volume read_dicom_series(const fs::path& folder) {
    // What these libraries would print becomes an exception here, or is repaired by the sorting below.
    itk::Object::SetGlobalWarningDisplay(false);
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    try {
        std::vector<Slice> slices;
        for (const std::string& file : files_of_the_series(folder)) slices.push_back(read_slice(file));
        if (slices.size() == 1 && slices.front().geometry.size[2] > 1) {
            require_valid(slices.front().geometry, slices.front().file.c_str());
            return {slices.front().geometry, slices.front().voxels};
        }
        if (slices.size() < 2) throw unusable(folder, "it holds one slice; give the whole series");
        require_alike(folder, slices);
        const double distance = sort_by_position(folder, slices);
        return stacked(slices, distance);
    } catch (const itk::ExceptionObject& error) {
        throw IoError("cannot read the DICOM folder '" + folder.string() + "': " + one_line(error));
    }
}

}  // namespace tissuewarp::imaging::detail
