#pragma once
/// Where labels slide on one another two nodes lie at one place, each of its own side's tissue.

#include "registration/prepare.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

/// Of every node of a model the label of its tissue where that slides, otherwise 0.
std::vector<int> sides_of(const PreparedModel& prepared);

/// Labels that slide.
std::vector<int> sliding_labels(const PreparedModel& prepared);

/// The tissue of a label.
struct Side {
    meshing::TetMesh mesh;   ///< of its nodes alone
    std::vector<int> nodes;  ///< these in the whole
};
Side side_of(const meshing::TetMesh& whole, int label);

}  // namespace tissuewarp::registration::detail
