#pragma once
/// Places in the mesh of points that cells of a grid tell of: mostly the same ones, update after update.

#include "meshing/point_location.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

class RememberedPlaces {
public:
    /// For so many cells; those known stay.
    void reserve(std::size_t cells) {
        if (entries_.size() < cells) entries_.resize(cells);
    }
    /// locate_near() of a point (LPS mm) of a cell. Threads may ask for different cells at once.
    std::optional<meshing::Location> locate(const meshing::PointLocator& locator, std::size_t cell,
                                            const Eigen::Vector3d& point);

private:
    struct Entry {
        bool known = false;
        Eigen::Vector3d point;
        std::optional<meshing::Location> place;
    };
    std::vector<Entry> entries_;
};

}  // namespace tissuewarp::registration::detail
