#pragma once
/// Dense forces of a bare intraoperative volume on a model in some state.

#include "meshing/point_location.hpp"
#include "registration/matching/dense/image_engine.hpp"
#include "registration/prepare.hpp"

#include <algorithm>

namespace tissuewarp::registration::detail {

/// Matches and where they lie in the mesh.
struct LocatedMatches {
    std::vector<BlockMatch> matches;
    std::vector<meshing::Location> places;

    void reserve(std::size_t count) {
        matches.reserve(count);
        places.reserve(count);
    }
    /// Takes out those whose place is in no tetrahedron.
    void drop_unlocated() {
        const auto nowhere = [](const meshing::Location& place) { return place.tet < 0; };
        if (std::none_of(places.begin(), places.end(), nowhere)) return;
        std::size_t n = 0;
        std::erase_if(matches, [&](const BlockMatch&) { return nowhere(places[n++]); });
        std::erase_if(places, nowhere);
    }
    void add(const BlockMatch& match, const meshing::Location& place) {
        matches.push_back(match);
        places.push_back(place);
    }
};

struct DenseMatches {
    LocatedMatches found;
    double agreement = 0;  ///< of both images as far as they show the organ: DenseForces::agreement
};

/// A force on the moving grid, seen from the fixed image.
BlockMatch as_match(const DenseForce& force, const meshing::TetMesh& mesh, const State& state,
                    const meshing::Location& at);

class DenseSearch {
public:
    /// `engine` has been made for both and given the fixed image.
    DenseSearch(const meshing::TetMesh& mesh, const ImageModel& image, ImageEngine& engine);

    /// What `known`, found before, and the whole image say about where tissue belongs, on the grid that is `coarsening`
    /// times doubled from the template's finest (or its coarsest): a match for each cell of voxels that has a force,
    /// and those known ones in whose cell the images say nothing. The fixed image is pulled back by the model to the
    /// moving grid, so that descriptors are compared which turned and stretched with the tissue.
    [[nodiscard]] DenseMatches matches(const State& state, int coarsening, const LocatedMatches& known,
                                       const meshing::PointLocator& locator) const;

private:
    const meshing::TetMesh& mesh_;
    const ImageModel& image_;
    ImageEngine& engine_;
};

}  // namespace tissuewarp::registration::detail
