#pragma once
/// A segmented intraoperative volume: interface nodes of the deformed mesh belong on the boundaries of its labels.

#include "registration/terms/term.hpp"

namespace tissuewarp::registration::detail {

class LabelEvidence {
public:
    LabelEvidence(const PreparedModel& prepared, const imaging::Volume& fixed_labels, const UpdateOptions& options);

    /// Springs from every interface node along its normal to the boundary in the fixed labels. Throws InvalidInput when
    /// no boundary was found.
    [[nodiscard]] Contribution contribution(const RoundPlan& plan, const State& state) const;

private:
    const PreparedModel& prepared_;
    const UpdateOptions& options_;
    LabelBoundaryField fixed_;
    std::vector<std::vector<int>> neighbours_;  // of interface nodes
};

}  // namespace tissuewarp::registration::detail
