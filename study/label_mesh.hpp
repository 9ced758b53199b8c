#pragma once
/// Tetrahedra of a label map, asked for by their number.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

#include <vector>

namespace tissuewarp::study {

/// Every wanted label 1, everything else 0; no wanted labels: all but 0.
imaging::Volume one_tissue(const imaging::Volume& label_map, const std::vector<int>& labels = {});

/// Edge (mm) of so many even tetrahedra in the volume of all labels but 0: an even tetrahedron has edge³/8.5.
double edge_length_for(const imaging::Volume& label_map, int tetrahedra);

}  // namespace tissuewarp::study
