#include "meshing/detail/cgal_refinement.hpp"

namespace tissuewarp::meshing::detail {

TetMesh refine_parallel(const RefinementInput& input, Observer& observer) {
    return refine_with<CGAL::Parallel_tag>(input, observer);
}

}  // namespace tissuewarp::meshing::detail
