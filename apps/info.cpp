// tissuewarp info: what a file holds, and what this machine can compute on.

#include "apps/file_kind.hpp"
#include "apps/patient_file.hpp"
#include "apps/progress.hpp"
#include "apps/verbs.hpp"
#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "imaging/labels.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/quality.hpp"
#include "registration/evaluation.hpp"
#include "registration/io/extent.hpp"
#include "registration/io/slicer_markups.hpp"
#include "registration/record.hpp"
#include "shaders/device.hpp"

#include <fmt/format.h>

#include <set>

namespace tissuewarp::apps {

namespace {

namespace fs = std::filesystem;

std::string point_text(const Eigen::Vector3d& p) {
    return fmt::format("({:.4g}, {:.4g}, {:.4g})", p.x(), p.y(), p.z());
}

const char* type_name(int cv_depth) {
    switch (cv_depth) {
        case CV_8U:
            return "uint8";
        case CV_8S:
            return "int8";
        case CV_16U:
            return "uint16";
        case CV_16S:
            return "int16";
        case CV_32S:
            return "int32";
        case CV_32F:
            return "float32";
        default:
            return "float64";
    }
}

void print_labels(const imaging::ReadResult& image, const fs::path& path, imaging::LabelNames names) {
    const imaging::ReadResult labels = imaging::as_labels(image, path);
    names.insert(labels.label_names.begin(), labels.label_names.end());
    fmt::print("  {:<8}{:>10}{:>14}{:>8}  {}\n", "label", "voxels", "volume (mm3)", "pieces", "centroid (mm, LPS)");
    for (const auto& [label, s] : imaging::label_statistics(labels.volume)) {
        const auto name = names.find(label);
        fmt::print("  {:<8}{:>10}{:>14.1f}{:>8}  {}{}{}\n", label, s.voxels, s.volume_mm3, s.components,
                   point_text(s.centroid), name == names.end() ? "" : "  '" + name->second + "'",
                   s.touches_border ? "  touches the border of the image" : "");
    }
}

/// Of all components.
std::pair<double, double> value_range(const cv::Mat& voxels) {
    const int rows = static_cast<int>(voxels.total() / static_cast<std::size_t>(voxels.size[2]));
    const cv::Mat plane(rows, voxels.size[2], voxels.type(), voxels.data);
    double least = 0, most = 0;
    cv::minMaxIdx(plane.reshape(1), &least, &most);
    return {least, most};
}

void print_image(const fs::path& path, const InfoOptions& options) {
    const imaging::ReadResult image = imaging::read_volume_with_notes(path);
    const imaging::Volume& volume = image.volume;
    const imaging::Geometry& g = volume.geometry;
    fmt::print("{}: image of {} x {} x {} voxels, {}{}\n", path.string(), g.size[0], g.size[1], g.size[2],
               type_name(volume.voxels.depth()),
               volume.channels() == 1 ? "" : fmt::format(", {} components", volume.channels()));
    fmt::print("  spacing (mm)     {}\n  origin (mm, LPS) {}\n", point_text(g.spacing), point_text(g.origin));
    for (int axis = 0; axis < 3; ++axis)
        fmt::print("  axis {} (LPS)     {}\n", "ijk"[axis], point_text(g.direction.col(axis)));
    const auto [least, most] = value_range(volume.voxels);
    fmt::print("  values           {:g} to {:g}\n", least, most);
    for (const std::string& note : image.notes) fmt::print("  note: {}\n", note);
    if (!options.labels) return;
    print_labels(image, path,
                 options.label_names.empty() ? imaging::LabelNames() : imaging::read_label_names(options.label_names));
}

void print_mesh(const meshing::TetMesh& mesh) {
    const meshing::QualityReport quality = meshing::quality(mesh);
    fmt::print("mesh of {} nodes, {} tetrahedra, {} pieces\n", mesh.node_count(), mesh.tet_count(), quality.components);
    fmt::print("  box (mm, LPS)    {} to {}\n", point_text(mesh.nodes.rowwise().minCoeff()),
               point_text(mesh.nodes.rowwise().maxCoeff()));
    fmt::print("  edges (mm)       {:.3g} to {:.3g}, median {:.3g}\n", quality.edge_mm.minimum, quality.edge_mm.maximum,
               quality.edge_mm.median);
    fmt::print("  least dihedral   {:.3g} degrees\n", quality.min_dihedral_deg.minimum);
    for (const auto& [label, volume] : quality.label_volume_mm3)
        fmt::print("  label {:<11}{:.1f} mm3\n", label, volume);
}

void print_mesh_file(const fs::path& path) {
    ProgressLine notes({.quiet = true});
    const meshing::TetMesh mesh = meshing::read_vtu(path, notes);
    fmt::print("{}: ", path.string());
    print_mesh(mesh);
    for (const std::string& note : notes.notes()) fmt::print("note: {}\n", note);
}

void print_surface(const fs::path& path) {
    ProgressLine notes({.quiet = true});
    meshing::Surface surface;
    if (registration::is_slicer_markups(path))
        surface.mesh.nodes = registration::read_slicer_markups(path, notes).points;
    else
        surface = meshing::read_surface(path, notes);
    fmt::print("{}: {} points, {} triangles{}\n", path.string(), surface.mesh.node_count(),
               surface.mesh.triangle_count(), surface.normals.cols() > 0 ? ", with normals" : "");
    if (surface.mesh.node_count() == 0) return;
    fmt::print("  box (mm, LPS)    {} to {}\n", point_text(surface.mesh.nodes.rowwise().minCoeff()),
               point_text(surface.mesh.nodes.rowwise().maxCoeff()));
    for (const std::string& note : notes.notes()) fmt::print("  note: {}\n", note);
    try {
        registration::detail::require_millimetres_of_points(
            surface.mesh.nodes, surface.mesh.triangle_count() > 0 ? "the surface is" : "the points are");
    } catch (const InvalidInput& doubt) {
        fmt::print("  note: {}\n", doubt.what());
    }
}

void print_record(const fs::path& path) {
    const registration::Record record = registration::read_record(path);
    fmt::print("{}: record of a registration, format {}\n", path.string(), record.format_version);
    print_mesh(record.deformation.mesh);
    const Eigen::VectorXd moved = record.deformation.displacement.colwise().norm();
    fmt::print("  displacement     up to {:.3f} mm, mean {:.3f} mm, before the rigid placement\n", moved.maxCoeff(),
               moved.mean());
    fmt::print("  det J            {:.3f} to {:.3f}\n", record.jacobian.minCoeff(), record.jacobian.maxCoeff());
    for (const auto& [name, value] : record.provenance) fmt::print("  {:<24} {}\n", name, value);
}

void print_patient(const fs::path& path) {
    ProgressLine notes({.quiet = true});
    const PreparedPatient patient = read_patient_file(path, notes);
    const registration::PreparedModel& model = *patient.model;
    fmt::print("{}: prepared patient\n", path.string());
    print_mesh(model.model.mesh);
    fmt::print(
        "  coarser model    {}\n",
        model.coarse ? fmt::format("{} tetrahedra, for unknown loads", model.coarse->model.mesh.tet_count()) : "none");
    fmt::print("  images to match  {}\n", (model.image ? 1 : 0) + model.contrasts.size());
    for (const auto& [label, material] : model.model.materials)
        fmt::print(
            "  label {:<11}{}{}\n", label, tled::law_name(material),
            patient.inputs.label_names.contains(label) ? ", '" + patient.inputs.label_names.at(label) + "'" : "");
    for (const InputFile& file : patient.inputs.files)
        fmt::print("  {:<16} {}  {}\n", file.role, file.path.string(), file.sha256.substr(0, 12));
    for (const auto& [name, value] : patient.provenance) fmt::print("  {:<24} {}\n", name, value);
    for (const std::string& note : patient.inputs.notes) fmt::print("note: {}\n", note);
}

void print_devices() {
    const auto devices = shaders::list_devices();
    if (devices.empty()) fmt::print("no EGL device; registrations run on the CPU\n");
    for (const shaders::DeviceInfo& device : devices)
        fmt::print("gpu:{}  {}  {}{}\n", device.index, device.hardware ? "hardware" : "software", device.name,
                   device.problem.empty() ? "" : "  (unusable: " + device.problem + ")");
}

void print_file(const fs::path& path, const InfoOptions& options) {
    std::error_code failure;
    if (!fs::exists(path, failure)) throw IoError("cannot read '" + path.string() + "': no such file");
    switch (file_kind(path)) {
        case FileKind::Image:
            return print_image(path, options);
        case FileKind::Mesh:
            return print_mesh_file(path);
        case FileKind::Points:
        case FileKind::Surface:
            return print_surface(path);
        case FileKind::Record:
            return print_record(path);
        case FileKind::Patient:
            return print_patient(path);
        case FileKind::Unknown:
            break;
    }
    throw InvalidInput("'" + path.string() +
                       "' has an unknown extension; give .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, a DICOM "
                       "folder, .vtu, .ply, .stl, .obj, .vtk, .vtp, .csv, .xyz, .fcsv, .mrk.json, .h5 or .tw");
}

}  // namespace

void run_info(const InfoOptions& options) {
    if (options.files.empty() && !options.devices) throw InvalidInput("nothing to look at; give a file, or --devices");
    if (options.devices) print_devices();
    for (const fs::path& path : options.files) print_file(path, options);
}

}  // namespace tissuewarp::apps
