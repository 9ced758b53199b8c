#pragma once
/// How good a registration is, in the measures of the field.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/deformation.hpp"
#include "registration/field.hpp"
#include "registration/result.hpp"

#include <Eigen/Core>

#include <filesystem>
#include <map>
#include <optional>
#include <vector>

namespace tissuewarp::registration {

struct Summary {
    int count = 0;
    double mean = 0, median = 0, percentile_95 = 0, maximum = 0;
};
Summary summarise(std::vector<double> values);

/// Corresponding points, LPS mm, 3 × P.
struct Landmarks {
    Eigen::Matrix3Xd moving, fixed;
};

/// Reads a table of pairs with a header naming pre_x,pre_y,pre_z,intra_x,intra_y,intra_z, in any order, or the same
/// with r,a,s (further columns ignored), LPS mm. Notes go to the observer. Throws IoError or InvalidInput with line
/// numbers.
Landmarks read_landmarks(const std::filesystem::path& path, Observer& observer = silent_observer());

/// Reads a pair of point files: elastix/transformix ("point", count, then x y z per line), LPS mm, tables of points
/// (meshing/point_table.hpp), or markups of 3D Slicer (slicer_markups.hpp). Points of files that name them are pairs
/// where they share a name; those without a partner are left out, with a note. Points without names are pairs by their
/// order, of equal numbers. Throws IoError or InvalidInput, also for names that repeat and for fewer than one pair.
Landmarks read_landmarks(const std::filesystem::path& moving, const std::filesystem::path& fixed,
                         Observer& observer = silent_observer());

/// Whether the header of a table names intra_x or the like: pairs, and not points.
bool is_table_of_pairs(const std::filesystem::path& path);

/// The points of one file of points, LPS mm. Throws IoError or InvalidInput.
Eigen::Matrix3Xd read_points(const std::filesystem::path& path, Observer& observer = silent_observer());

/// Target registration error ‖mapped − fixed‖ in mm.
struct TargetError {
    Summary before, after;
    Summary moved_before, moved_after;  ///< landmarks that truly moved by more than `moved_mm`
    double moved_mm = 2.0;
};
TargetError target_error(const Landmarks& landmarks, const Eigen::Matrix3Xd& mapped, double moved_mm = 2.0);

struct Overlap {
    double dice = 0;
    double mean_surface_distance_mm = 0;  ///< symmetric mean
    double hausdorff_95_mm = 0;           ///< 95th percentile, symmetric maximum of the two directions
};

/// Overlap of each label present in either map, and under key 0 of their union. Distances run from the centres of the
/// voxel faces between a label and others (not those at the edge of the image) to the nearest such centre of the other
/// map; infinite for a label that one map lacks. Throws InvalidInput unless both are integer maps on one grid.
std::map<int, Overlap> overlap(const imaging::Volume& labels, const imaging::Volume& reference);

struct JacobianReport {
    double minimum = 1, percentile_1 = 1, percentile_5 = 1, median = 1;
    double percentile_95 = 1, percentile_99 = 1, maximum = 1;
    double folded_share = 0;                     ///< of the rest volume: det J ≤ 0
    double folded_mm3 = 0;                       ///< rest volume with det J ≤ 0
    long long folded = 0;                        ///< tetrahedra or voxels with det J ≤ 0
    std::vector<Eigen::Vector3d> folded_places;  ///< up to 20 of them, LPS mm
};

/// det J of the tetrahedra, weighted by rest volume.
JacobianReport mesh_jacobians(const Deformation& deformation);

/// det J of a forward field on its grid, every voxel, or those of a mask.
JacobianReport field_jacobians(const imaging::Volume& moving_to_fixed, const imaging::Volume* mask = nullptr);

/// The same of jacobian_determinant() of the field.
JacobianReport jacobian_report(const imaging::Volume& determinant, const imaging::Volume* mask = nullptr);

/// `field.folds` where such a report of all voxels holds folded ones, which no tissue has, and how many the organ's
/// does; or where the backward field was left folded.
std::optional<Doubt> doubt_of_folds(const JacobianReport& everywhere, const JacobianReport& in_organ,
                                    const Unfolding& back);

/// From where on a field that was unfolded is doubted.
struct UnfoldingDoubtLimits {
    double most_mm = 1;          ///< of a voxel of the organ
    double least_share = 0.001;  ///< of its voxels: fewer are worth a notice
};
inline constexpr UnfoldingDoubtLimits unfolding_doubt_limits{};

/// `field.unfolded` where one of the fields, so that it does not fold, is not that of the simulation; a notice where that
/// is so in a few voxels.
std::optional<Doubt> doubt_of_unfolding(const Unfolding& forth, const Unfolding& back);

}  // namespace tissuewarp::registration
