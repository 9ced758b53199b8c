#include "meshing/detail/cgal_refinement.hpp"

namespace tissuewarp::meshing::detail {

TetMesh refine_sequential(const RefinementInput& input, Observer& observer) {
    return refine_with<CGAL::Sequential_tag>(input, observer);
}

}  // namespace tissuewarp::meshing::detail
