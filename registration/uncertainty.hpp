#pragma once
/// How far the true place of a target may lie from where a registration puts it: what the solver left, what the mesh
/// cannot follow, and what data and tissue leave open.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/point_location.hpp"
#include "registration/prepare.hpp"
#include "registration/result.hpp"
#include "tled/error/discretisation_error.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::registration {

struct UncertaintyOptions {
    int samples = 64;        ///< of the posterior; a deviation is known to 1/√(6 · samples), 5 %. By hand
    std::uint64_t seed = 1;  ///< of these
};

/// What the data say of a place.
enum class Trust : unsigned char {
    Outside = 0,  ///< no tissue of the model; the field is continued there and nothing is said of it
    Shown = 1,    ///< data show it, and it lies within 5 mm with a probability of 95 %
    Carried = 2,  ///< no datum is near: mechanics carried it there, and it lies within 5 mm with 95 % all the same
    Unknown = 3   ///< do not trust: it may lie 5 mm off or more
};

/// Errors of one place, mm. Each deviation is the root of the expected square of the error vector's length.
struct ErrorEstimate {
    double algebraic_mm = 0;       ///< of the solver: the lifted residual
    double discretisation_mm = 0;  ///< of linear tetrahedra of this size; NaN where there is no estimate of it
    double data_mm = 0;            ///< of matches, and of tissue between them: 1 σ
    double deviation_mm = 0;       ///< all together, 1 σ
    /// All together, mm², moving frame before the placement turns it.
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    double interval_mm = 0;  ///< with a probability of 95 % the true place lies within; NaN where the data tell nothing
    Trust trust = Trust::Unknown;
};

/// With a probability in [0.001, 0.999] the true place lies within this radius, mm.
double interval_mm(const ErrorEstimate& estimate, double probability);

/// Regions of the data were left out and predicted from the rest.
struct HeldOut {
    double z = 1;        ///< error of these predictions over the one that was to be expected, root mean square
    int regions = 0;     ///< that were left out
    double seconds = 0;  ///< it took to leave them out and predict them
};

/// What is estimated at the nodes.
struct NodalErrors {
    Eigen::RowVectorXd algebraic, discretisation, data;  ///< N, mm²: of the solver, of the mesh (NaN: no estimate) and
                                                         ///< of the data: expected squares of the error's length
    Eigen::Matrix<double, 6, Eigen::Dynamic> covariance;  ///< 6 × N, mm², all together: xx, yy, zz, xy, yz, zx
    std::vector<char> shown;                              ///< N: whether data show the tissue about the node
    bool placed = true;                                   ///< false: where the organ lies as a whole is not known
};

/// The estimate at every node of the mesh, and anywhere between: of an element's corners, linearly; an element is shown
/// whose corners all are. Tables, volumes and summaries say the same of one place.
class Uncertainty {
public:
    /// `held_out`: see HeldOut, where there were data enough.
    Uncertainty(meshing::TetMesh mesh, NodalErrors nodal, std::optional<HeldOut> held_out = {});

    /// Of places of the moving frame, 3 × P mm; nothing for places farther than half an element outside the mesh.
    [[nodiscard]] std::vector<std::optional<ErrorEstimate>> at(const Eigen::Matrix3Xd& points) const;
    /// Of every node.
    [[nodiscard]] std::vector<ErrorEstimate> at_nodes() const;
    /// In the moving frame.
    [[nodiscard]] const meshing::TetMesh& mesh() const { return mesh_; }
    [[nodiscard]] const std::optional<HeldOut>& held_out() const { return held_out_; }
    [[nodiscard]] const NodalErrors& nodal() const { return nodal_; }
    /// At barycentric coordinates of an element.
    [[nodiscard]] ErrorEstimate at(int tet, const Eigen::Vector4d& barycentric) const;

private:
    meshing::TetMesh mesh_;
    meshing::PointLocator locator_;
    NodalErrors nodal_;
    std::optional<HeldOut> held_out_;
};

/// The estimate over the tissue, by volume.
struct UncertaintySummary {
    double algebraic_mm = 0, discretisation_mm = 0, data_mm = 0, deviation_mm = 0;  ///< root mean square
    double interval_mm = 0;                                                         ///< mean
    double worst_interval_mm = 0;
    Eigen::Vector3d worst_place = Eigen::Vector3d::Zero();  ///< moving frame, LPS mm
    double shown_share = 0, unknown_share = 0;              ///< of the tissue: Trust::Shown, Trust::Unknown
    double failed_share = 0, poor_share = 0;  ///< of the tissue: may lie DataDoubtLimits::failed_mm off, or poor_mm
};
UncertaintySummary summarise(const Uncertainty& uncertainty);

/// When data are said to show too little. Errors of a centimetre are what a failed registration has. Chosen on
/// *phantom*, *bent* and *organ*: of seeds 521 to 580 half of the tissue as failed_share doubts 41 of 44 failures
/// and 11.5 % of good results, a quarter 43 and 12.9 %; of seeds 401 to 480, parts of the surface alone left out, 7 mm
/// as poor_mm doubts 6 of 9 failures beyond 10 mm and 2.5 % of good results, 5 mm 9 of 9 and 4.6 %.
struct DataDoubtLimits {
    double failed_mm = 10;       ///< radius of 95 % of tissue that may as well lie anywhere
    double failed_share = 0.25;  ///< of the tissue
    double poor_mm = 5;          ///< radius of 95 % of most of the tissue: not known, as in Trust
    double poor_share = 0.75;    ///< of the tissue
};
inline constexpr DataDoubtLimits data_doubt_limits{};

/// In words, where more than a quarter of the tissue may lie a centimetre off, or three quarters 5 mm, and what would
/// help; otherwise nothing.
std::optional<Doubt> doubt_of_data(const UncertaintySummary& summary);

/// In words, where the solver stopped farther from equilibrium than the tolerance it was given, mm; otherwise nothing.
std::optional<Doubt> doubt_of_solver(const UncertaintySummary& summary, double tolerance_mm);

/// From where on a registration that was set against what it left out is doubted.
struct HeldOutDoubtLimits {
    double most_z = 2;  ///< errors twice those that were to be expected
};
inline constexpr HeldOutDoubtLimits held_out_doubt_limits{};

/// In words, where regions left out were missed by far more than was to be expected; otherwise nothing.
std::optional<Doubt> doubt_of_held_out(const HeldOut& held_out);

/// All that the estimate says against a result whose equilibria had this tolerance, mm; empty when there is nothing.
std::vector<Doubt> doubts_of(const Uncertainty& uncertainty, double tolerance_mm);

/// In words, where errors are not within `accuracy_mm` with a probability of 95 % on average over the tissue, what is
/// at fault and what would help; otherwise nothing. Of random phantoms, the error over the tissue (root mean square) of
/// 96 to 99 in a hundred is within that radius (docs/lab/accuracy-time.md, "Are a time and an accuracy kept?").
std::optional<Doubt> doubt_of_accuracy(const UncertaintySummary& summary, double accuracy_mm);

/// The estimate on a grid of the fixed frame.
struct UncertaintyVolumes {
    imaging::Volume deviation;  ///< deviation_mm, float32, NaN outside the tissue
    imaging::Volume trust;      ///< Trust, one byte
};

/// Throws InvalidInput when the estimate and the deformation have different meshes.
UncertaintyVolumes uncertainty_on_grid(const Uncertainty& uncertainty, const Deformation& deformation,
                                       const imaging::Geometry& fixed_grid);

/// Throws InvalidInput when the result does not belong to the model, SolverFailure where the stiffness cannot be
/// factorised, Cancelled.
Uncertainty uncertainty(const PreparedModel& prepared, const UpdateResult& result,
                        const UncertaintyOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
