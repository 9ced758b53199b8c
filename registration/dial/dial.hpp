#pragma once
/// Accuracy against time as a dial: which mesh to take for an accuracy or a time, from measurements on phantoms whose
/// truth is known.

#include "imaging/volume.hpp"
#include "registration/intraoperative.hpp"

#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::registration {

/// What pulls at the model decides what a mesh is worth.
enum class DataKind {
    Labels,  ///< every boundary, in a label map
    Partial  ///< points of a part of the surface, pairs of points, vessels
};
/// Labels where there are any. Nothing for a bare volume alone, for which nothing was measured.
std::optional<DataKind> data_kind(const Intraoperative& seen);
/// "labels", "partial".
const char* name_of(DataKind kind);

/// Seconds of a stage as constant + slope · amount.
struct LinearCost {
    double constant_s = 0, slope_s = 0;
    [[nodiscard]] double at(double amount) const { return constant_s + slope_s * amount; }
};

/// One density of the mesh, measured on a number of phantoms with one kind of data.
struct FrontPoint {
    DataKind kind = DataKind::Labels;
    double edges_per_organ = 0;  ///< a cube root of the organ's volume over the edge of the mesh
    double tetrahedra = 0;       ///< median
    double preparation_s = 0;    ///< meshing, rest state, rest stiffness: median
    double rounds_s = 0;         ///< matching and equilibrium: median
    double rounds_95_s = 0;      ///< and 95th percentile
    double fields_s = 0;         ///< both fields on the grids of phantoms, where the mesh decides: median
    double error_mm = 0;         ///< root mean square over the targets of a phantom: median over phantoms
    double error_95_mm = 0;      ///< and 95th percentile
};

/// Measured by study::measure_fronts.
struct Fronts {
    std::string machine;         ///< processor, threads and device, for people
    bool measured_here = false;  ///< false: the figures that come with the program
    LinearCost alignment[2];     ///< by DataKind: over millions of voxels of the fixed labels; constant otherwise
    LinearCost fields;           ///< both fields, over millions of voxels of the two grids; beside FrontPoint::fields_s
    LinearCost warp;             ///< image and labels, over millions of voxels of the output grid
    std::vector<FrontPoint> points;
};

/// What is asked for; both may be.
struct DialRequest {
    std::optional<double> accuracy_mm;  ///< root mean square error over the tissue
    std::optional<double> time_s;       ///< from data at hand to warped image; preparation apart
};

/// What is registered.
struct DialCase {
    DataKind kind = DataKind::Labels;
    double organ_mm = 0;  ///< organ_size
    double moving_megavoxels = 0, output_megavoxels = 0, fixed_label_megavoxels = 0;
};

/// What was chosen, and what it should give.
struct DialChoice {
    double edge_length_mm = 0;
    FrontPoint point;                           ///< the measurement behind it
    double seconds = 0;                         ///< expected from data at hand to warped image: median
    double update_budget_s = 0;                 ///< for UpdateOptions::time_budget_s; 0 without a time
    double error_mm = 0;                        ///< expected: median over phantoms
    double error_95_mm = 0;                     ///< and 95th percentile
    bool time_met = true, accuracy_met = true;  ///< by these expectations
    std::string reason;                         ///< one line for people
};

/// With an accuracy alone, the fastest mesh whose 95th percentile of errors keeps it, otherwise the most accurate one;
/// with a time, the most accurate mesh (or the fastest that keeps the accuracy) whose 95th percentile of times keeps
/// it, otherwise the fastest. Of meshes within 5 % of the most accurate one, the finest counts as that, if it takes at
/// most twice as long as the fastest of them or a time is given. Throws
/// InvalidInput when nothing is asked, or for values that are not above 0, and where nothing was measured for the kind
/// of data.
DialChoice choose(const Fronts& fronts, const DialRequest& request, const DialCase& what);

}  // namespace tissuewarp::registration
