#pragma once
/// Reading what a registration needs and refusing what cannot be registered, before any heavy work.

#include "apps/material_file.hpp"
#include "apps/options.hpp"
#include "core/observer.hpp"
#include "imaging/foreground.hpp"
#include "imaging/image_io.hpp"
#include "imaging/label_names.hpp"
#include "meshing/tet_mesh.hpp"
#include "registration/evaluation.hpp"
#include "registration/intraoperative.hpp"
#include "registration/pose/start_pose.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// One file that was read.
struct InputFile {
    std::string role;  ///< "moving", "fixed-labels", ...: the option's name
    std::filesystem::path path;
    std::string sha256;  ///< empty for a folder
};

struct RegistrationInputs {
    imaging::Volume moving, fixed;                                   ///< grey images; empty when not given
    imaging::Volume moving_labels, fixed_labels;                     ///< the latter empty when not given
    imaging::Volume moving_matched, fixed_matched;                   ///< the images without what their masks exclude
    std::vector<imaging::Volume> moving_contrasts, fixed_contrasts;  ///< further pairs, likewise
    std::optional<imaging::Foreground> foreground;             ///< whose labels are the moving ones, without any given
    std::optional<meshing::TetMesh> moving_mesh;               ///< where it was made elsewhere
    imaging::Volume fixed_labels_as_given;                     ///< the same before they were resampled
    std::optional<registration::SurfacePoints> fixed_surface;  ///< to register to, as the pairs
    std::optional<registration::PointPairs> point_pairs;
    std::optional<registration::Curves> curves;
    std::optional<registration::StartPose> start;  ///< in place of the headers' placement
    std::optional<registration::Landmarks> landmarks;
    std::optional<Eigen::Matrix3Xd> points;                     ///< moving frame, LPS mm
    std::optional<meshing::SurfaceMesh> surface;                ///< to carry along, moving frame, LPS mm
    std::map<int, TissueEntry> materials;                       ///< empty without a table
    imaging::LabelNames moving_label_names, fixed_label_names;  ///< of segmentations that name their segments
    imaging::LabelNames label_names;                            ///< of both, after those of --label-names
    std::vector<InputFile> files;
    std::vector<std::string> notes;  ///< what the readers had to decide

    /// Nothing where no fixed image and no fixed labels were given.
    [[nodiscard]] const imaging::Geometry* fixed_grid() const {
        if (!fixed.empty()) return &fixed.geometry;
        return fixed_labels.empty() ? nullptr : &fixed_labels.geometry;
    }
    [[nodiscard]] const imaging::Geometry& moving_grid() const {
        return moving.empty() ? moving_labels.geometry : moving.geometry;
    }
};

/// Reads all files at once. Throws IoError or InvalidInput, each naming the file.
RegistrationInputs read_inputs(const RegisterOptions& options, Observer& observer);
/// The half that is known before the operation, and the other, which completes it.
RegistrationInputs read_preoperative(const PreoperativeOptions& options, Observer& observer);
void read_intraoperative(RegistrationInputs& inputs, const IntraoperativeOptions& options, Observer& observer);

/// Throw InvalidInput where geometry, labels, units or materials cannot be registered; resample labels when asked.
void validate_preoperative(RegistrationInputs& inputs, const PreoperativeOptions& options, bool resample_labels);
void validate_intraoperative(RegistrationInputs& inputs, const RegisterOptions& options);

/// A label map without rigid neighbours and what is resected, which are not registered.
imaging::Volume organ_of(const imaging::Volume& labels, const PreoperativeOptions& options);

/// Throws InvalidInput unless both lie on one grid; says how far apart they are, in voxels.
void require_same_grid(const imaging::Geometry& image, const imaging::Geometry& labels, const std::string& image_name,
                       const std::string& labels_name, const std::string& remedy);

/// Throws InvalidInput where two maps give one name to two numbers: segments are matched by number.
void require_same_numbers(const imaging::LabelNames& names, const std::filesystem::path& path,
                          const imaging::LabelNames& other_names, const std::filesystem::path& other_path);

/// Throws InvalidInput where --label-edge-length names a label that the map lacks.
void require_labels_of_lengths(const std::map<int, double>& label_edge_length, const imaging::Volume& labels,
                               const std::filesystem::path& path);

/// Throws InvalidInput where --label-tissue names a label that the map lacks.
void require_labels_of_tissues(const std::map<int, std::string>& label_tissue, const imaging::Volume& labels,
                               const std::filesystem::path& path);

/// Throws InvalidInput where the extent of a grid is no part of a body: other units than millimetres.
void require_millimetres(const imaging::Geometry& grid, const std::filesystem::path& path);

/// Points (3 × P, LPS mm) outside of their image are mostly RAS taken for LPS, or of another image: some are worth a
/// note, most throw InvalidInput. `what` names them.
void check_inside(const Eigen::Matrix3Xd& points, const imaging::Geometry& grid, const std::string& what,
                  std::vector<std::string>& notes);

/// Reads the files of points to register to, if given.
std::optional<registration::PointPairs> read_point_pairs(const PointPairFiles& files, Observer& observer);

/// Reads the landmark files that were given.
std::optional<registration::Landmarks> read_landmark_files(const LandmarkFiles& files, Observer& observer);

}  // namespace tissuewarp::apps
