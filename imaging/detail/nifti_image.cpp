/// NIfTI (.nii, .nii.gz, .hdr with .img): geometry from the header's own words. ITK scales spacings by the header's
/// unit and leaves origins, and turns voxels that are not finite into 0.

#include "imaging/detail/gzip.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/image_header.hpp"
#include "imaging/detail/nifti_header.hpp"
#include "imaging/detail/text_headers.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <sstream>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

const Eigen::Vector3d ras_to_lps(-1.0, -1.0, 1.0);

/// The geometry that a NIfTI matrix (voxel to RAS) states, in the header's unit.
Geometry geometry_of(const Eigen::Matrix4d& matrix, const std::array<int, 3>& size) {
    const Eigen::Matrix3d axes = ras_to_lps.asDiagonal() * matrix.topLeftCorner<3, 3>();
    Geometry geometry;
    geometry.size = size;
    geometry.spacing = axes.colwise().norm().transpose();
    geometry.direction = axes * geometry.spacing.cwiseInverse().asDiagonal();
    geometry.origin = ras_to_lps.cwiseProduct(matrix.topRightCorner<3, 1>());
    return geometry;
}

bool at_right_angles(const Geometry& grid) {
    const Eigen::Matrix3d product = grid.direction.transpose() * grid.direction;
    return (product - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= 1e-3;
}

Eigen::Vector3d voxel_size(const NiftiHeader& header) {
    return {header.pixdim[1], header.pixdim[2], header.pixdim[3]};
}

bool has_voxel_size(const Geometry& grid, const Eigen::Vector3d& size) {
    return ((grid.spacing - size.cwiseAbs()).cwiseAbs().array() <= 1e-2 * size.cwiseAbs().array()).all();
}

std::string voxel_text(const Eigen::Vector3d& size) {
    std::ostringstream text;
    text.precision(6);
    text << size[0] << " x " << size[1] << " x " << size[2];
    return text.str();
}

/// The sform alone: its voxels must be those of pixdim, and at right angles.
Geometry sform_alone(const fs::path& path, const Geometry& sform, const Eigen::Vector3d& size) {
    if (!has_voxel_size(sform, size))
        throw unusable(path, "its sform states voxels of " + voxel_text(sform.spacing) + " and its pixdim of " +
                                 voxel_text(size) + ", and no qform decides; write the true voxel size into both");
    return sform;
}

/// ITK's choice, so that all programs over ITK see one place: an sform of scanner coordinates (code 1) that is a rigid
/// motion of the voxels, else the qform, else the sform.
Geometry chosen_form(const fs::path& path, const NiftiHeader& header, const std::array<int, 3>& size,
                     std::vector<std::string>& notes) {
    const Geometry qform = geometry_of(header.qform, size), sform = geometry_of(header.sform, size);
    const bool has_qform = header.qform_code > 0, has_sform = header.sform_code > 0;
    if (!has_qform && !has_sform) {
        Geometry unknown;
        unknown.size = size;
        unknown.spacing = voxel_size(header).cwiseAbs();
        notes.emplace_back(
            "neither qform nor sform is set: the header does not say where the image lies in the patient");
        return unknown;
    }
    if (!has_qform) return sform_alone(path, sform, voxel_size(header));
    if (voxel_size(header).minCoeff() < 0.0)
        throw unusable(path, "its pixdim states voxels of " + voxel_text(voxel_size(header)) +
                                 ", and a qform needs positive ones; write the true voxel size, and turn the qform "
                                 "where an axis is reversed");
    if (!has_sform) return qform;
    const bool rigid = at_right_angles(sform) && has_voxel_size(sform, voxel_size(header));
    const bool took_sform = header.sform_code == 1 && rigid;
    const double distance = took_sform ? grid_distance(sform, qform) : grid_distance(qform, sform);
    if (distance > 1e-2) {
        std::ostringstream note;
        note.precision(3);
        note << "sform and qform disagree by up to " << distance << " voxels; the " << (took_sform ? "sform" : "qform")
             << " is used, as ITK does";
        notes.push_back(note.str());
    }
    return took_sform ? sform : qform;
}

void read_geometry(const fs::path& path, const NiftiHeader& header, ImageHeader& image) {
    image.geometry = chosen_form(path, header, image.voxels.size, image.notes);
    if (header.space_unit == 0 || header.space_unit == 2) return;  // mostly left out, and millimetres then
    if (header.space_unit != 1 && header.space_unit != 3)
        throw unusable(path, "its unit of length has the code " + std::to_string(header.space_unit) +
                                 ", NIfTI knows 1 (m), 2 (mm) and 3 (um); correct xyzt_units");
    const double millimetres = header.space_unit == 1 ? 1e3 : 1e-3;
    image.geometry.spacing *= millimetres;
    image.geometry.origin *= millimetres;
    image.vector_axes *= millimetres;
    image.converted = true;
    image.notes.push_back(std::string("lengths are given in ") + (header.space_unit == 1 ? "metres" : "micrometres") +
                          " and were converted to mm");
}

Scalar nifti_type(const fs::path& path, int code) {
    static const std::map<int, Scalar> types = {{2, Scalar::UInt8},    {4, Scalar::Int16},    {8, Scalar::Int32},
                                                {16, Scalar::Float32}, {64, Scalar::Float64}, {256, Scalar::Int8},
                                                {512, Scalar::UInt16}, {768, Scalar::UInt32}, {1024, Scalar::Int64},
                                                {1280, Scalar::UInt64}};
    const auto found = types.find(code);
    if (code == 0) throw unusable(path, "NIfTI data type 0 (unknown); write the type that its voxels have");
    if (code == 1) throw unusable(path, "NIfTI data type 1 (single bits); convert it to uint8");
    if (found == types.end())
        throw unusable(path, "NIfTI data type " + std::to_string(code) +
                                 " (colour, complex or long double); convert it to int16 or float32");
    return found->second;
}

/// Sizes of the three axes; one volume, of one value or three components.
void read_sizes(const fs::path& path, const NiftiHeader& header, StoredVoxels& voxels) {
    const long long dimensions = header.dim[0];
    if (dimensions < 1 || dimensions > 7)
        throw unreadable(path, "its header says " + std::to_string(dimensions) +
                                   " dimensions, NIfTI has 1 to 7; the header is damaged");
    std::vector<double> sizes;
    for (std::size_t axis = 1; axis <= static_cast<std::size_t>(dimensions); ++axis)
        sizes.push_back(static_cast<double>(header.dim[axis]));
    values_of(path, sizes);
    require_three_dimensions(path, sizes);
    if (header.intent_code >= 2006 && header.intent_code <= 2018)
        throw unusable(path, "it is a warp of FSL (intent " + std::to_string(header.intent_code) +
                                 "), in a frame of FSL's own; convert it to displacements in LPS mm");
    sizes.resize(std::max<std::size_t>(sizes.size(), 5), 1.0);
    const bool vectors = header.intent_code == nifti_intent_vector || header.intent_code == nifti_intent_displacement;
    if (vectors && sizes[3] == 3.0 && sizes[4] == 1.0) std::swap(sizes[3], sizes[4]);  // 4-D, as some programs write
    if (sizes[3] > 1)
        throw unusable(path, "it holds " + std::to_string(header.dim[4]) +
                                 (sizes[3] == 3.0 ? " time points, or vectors without NIfTI's intent 1007; extract one "
                                                    "of them, or write the intent"
                                                  : " time points; extract one of them"));
    const double components = sizes[4];
    const bool more = sizes.size() > 5 && std::any_of(sizes.begin() + 5, sizes.end(), [](double s) { return s > 1.0; });
    if ((components != 1.0 && components != 3.0) || more)
        throw unusable(path, "its size " + text_of(sizes) +
                                 " is neither a scalar image nor vectors of three components; extract one volume");
    voxels.channels = static_cast<int>(components);
    voxels.planar = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        voxels.size[axis] = static_cast<int>(sizes[axis]);
        require_spacing(path, header.pixdim[axis + 1], axis);
    }
}

/// The other file of a pair (.hdr, .img): beside this one, packed or not, in small or capital letters.
fs::path other_of_pair(const fs::path& path, const std::string& extension) {
    std::string name = path.filename().string();
    if (lower_case(name).ends_with(".gz")) name.resize(name.size() - 3);
    const fs::path stem = path.parent_path() / fs::path(name).stem();
    std::string capitals = extension;
    for (char& c : capitals) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    for (const std::string& ending : {extension, extension + ".gz", capitals, capitals + ".GZ"}) {
        std::error_code failure;
        const fs::path other = stem.string() + ending;
        if (fs::exists(other, failure)) return other;
    }
    throw IoError("cannot read '" + path.string() + "': it is one of a pair, and '" + stem.string() + extension +
                  "' is not there; put that file beside it");
}

bool is_voxel_file(const fs::path& path) {
    const std::string name = lower_case(path.filename().string());
    return name.ends_with(".img") || name.ends_with(".img.gz");
}

/// More bytes than the header promises may be padding, or a size that is stated wrongly.
void note_surplus(ImageHeader& image) {
    const StoredVoxels& voxels = image.voxels;
    if (voxels.packing != Packing::Raw) return;
    const std::uint64_t end = voxels.pieces[0].offset + static_cast<std::uint64_t>(voxels.channels) *
                                                            bytes_of(voxels.type) *
                                                            static_cast<std::uint64_t>(image.geometry.voxel_count());
    std::error_code failure;
    const std::uint64_t whole = fs::file_size(voxels.pieces[0].file, failure);
    if (!failure && whole > end)
        image.notes.push_back(std::to_string(whole - end) +
                              " bytes behind the voxels that the header states are not read");
}

void read_layout(const fs::path& path, const NiftiHeader& header, ImageHeader& image) {
    StoredVoxels& voxels = image.voxels;
    const double least = header.separate_voxels ? 0.0 : 348.0;
    if (!(header.data_offset >= least && header.data_offset < 1e9))
        throw unreadable(
            path, "its voxels are to begin at byte " + std::to_string(header.data_offset) + "; the header is damaged");
    voxels.type = nifti_type(path, header.datatype);
    if (header.bits_per_voxel != static_cast<int>(8 * bytes_of(voxels.type)))
        throw unreadable(path, "data type " + std::to_string(header.datatype) + " of " +
                                   std::to_string(header.bits_per_voxel) + " bits a voxel; the header is damaged");
    voxels.swapped = header.swapped;
    voxels.surplus = Surplus::Allowed;
    const fs::path file = header.separate_voxels ? other_of_pair(path, ".img") : path;
    const auto offset = static_cast<std::uint64_t>(header.data_offset);
    voxels.packing = is_gzip(file) ? Packing::Deflate : Packing::Raw;
    if (voxels.packing == Packing::Deflate) voxels.unpacked_skip = offset;
    voxels.pieces = {{file, voxels.packing == Packing::Raw ? offset : 0}};
    note_surplus(image);
    // Slope 0 means "no scaling" (nifti1.h); some writers leave NaN.
    if (std::isfinite(header.slope) && std::isfinite(header.intercept) && header.slope != 0.0) {
        voxels.slope = header.slope;
        voxels.intercept = header.intercept;
    }
}

/// What the three components of a voxel are.
void read_intent(const fs::path& path, const NiftiHeader& header, ImageHeader& image) {
    if (image.voxels.channels != 3) return;
    const Eigen::Matrix3d turned = ras_to_lps.asDiagonal();
    if (header.intent_name == "NREG_TRANS") {
        const bool positions = header.intent_parameter == 0.0;
        if (!positions && header.intent_parameter != 1.0)
            throw unusable(path, "it is a transform of NiftyReg of kind " + std::to_string(header.intent_parameter) +
                                     " (velocities or splines); convert it with reg_transform -def or -disp");
        image.vector_axes *= turned;
        image.positions = positions;
        image.notes.push_back(std::string("a field of ") + (positions ? "positions" : "displacements") +
                              " of NiftyReg: turned from RAS to " + (positions ? "displacements in " : "") + "LPS");
    } else if (header.intent_code == nifti_intent_displacement) {
        image.vector_axes *= turned;
        image.notes.emplace_back(
            "NIfTI intent 1006 (displacement): components are taken as RAS and turned to LPS, as ITK 5.3 and later do; "
            "a file whose components are LPS already must carry intent 1007");
    } else if (header.intent_code != nifti_intent_vector) {
        image.notes.push_back("vectors of NIfTI intent " + std::to_string(header.intent_code) + " are taken as LPS mm");
    }
}

}  // namespace

ImageHeader read_nifti_image_header(const fs::path& path) {
    if (is_voxel_file(path)) return read_nifti_image_header(other_of_pair(path, ".hdr"));
    const NiftiHeader header = read_nifti_header(path);
    ImageHeader image;
    read_sizes(path, header, image.voxels);
    read_geometry(path, header, image);
    read_layout(path, header, image);
    read_intent(path, header, image);
    return image;
}

}  // namespace tissuewarp::imaging::detail
