#pragma once
/// A kind of datum that the library does not know: a thread that draws one point of the tissue to a place.

#include "meshing/point_location.hpp"
#include "registration/prepare.hpp"
#include "registration/terms/term.hpp"

namespace tissuewarp::registration::test {

class TetherTerm : public detail::Term {
public:
    /// From `moving` to `fixed`, LPS mm, with a stiffness in mN/mm.
    TetherTerm(const PreparedModel& prepared, const Eigen::Vector3d& moving, const Eigen::Vector3d& fixed,
               double stiffness);

    [[nodiscard]] detail::Shows shows() const override { return detail::Shows::Parts; }
    [[nodiscard]] detail::PoseClaim pose_claim() const override { return detail::PoseClaim::Shift; }
    [[nodiscard]] Alignment pose(const Eigen::Isometry3d& start, Observer& observer) override;
    [[nodiscard]] detail::Contribution linearise(const detail::RoundPlan& plan, const detail::State& state,
                                                 Observer& observer) override;
    void judge(const detail::State& state, UpdateResult& result) override;

private:
    const PreparedModel& prepared_;
    Eigen::Vector3d moving_, fixed_;
    double stiffness_;
    meshing::Location at_;
};

}  // namespace tissuewarp::registration::test
