#pragma once
/// The unknown loads of one model, kept ready from one update to the next.

#include "registration/detail/load_fit.hpp"

#include <optional>

namespace tissuewarp::registration::detail {

struct FoundLoads {
    Eigen::Matrix3Xd forces;  ///< on the model's nodes, 3 × N, mN
    double size = 0;          ///< s of load_fit.hpp
};

class LoadFinder {
public:
    /// The model outlives this.
    LoadFinder(const PreparedModel& prepared, int shapes) : prepared_(prepared), count_(shapes) {}

    /// The loads that data pulling like `pulls` tell. The prior's springs are the same in every call. Of a model of
    /// more than 6000 nodes they are found on a coarser mesh of the organ, since they are smooth and a factor would
    /// take long. Throws InvalidInput where the springs do not hold the tissue, Cancelled.
    FoundLoads find(const LastPulls& pulls, Observer& observer);

private:
    const PreparedModel& prepared_;
    int count_;
    std::optional<PreparedModel> twin_;
    std::optional<LoadShapes> shapes_;  // of the twin, or of the model
    Eigen::MatrixXd forces_;            // theirs on the model's nodes

    [[nodiscard]] FoundLoads found(const PreparedModel& model, const LastPulls& pulls);
};

}  // namespace tissuewarp::registration::detail
