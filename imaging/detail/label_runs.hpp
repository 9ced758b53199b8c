#pragma once
/// Connected pieces of a label map, from runs of equal labels along i joined by union-find.

#include "imaging/volume.hpp"

#include <vector>

namespace tissuewarp::imaging::detail {

/// Voxels [begin, end) of row (j, k), all of one label.
struct LabelRun {
    int begin, end, j, k;
    int label;
    int piece;  ///< number of the piece, from 0 in the order of first voxels
};

/// The runs of labels != 0 of an int32 map in memory order, with 6-connected voxels of equal label in one piece.
std::vector<LabelRun> connected_runs(const Volume& labels);

}  // namespace tissuewarp::imaging::detail
