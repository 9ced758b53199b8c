#pragma once
/// What data miss of tissue that other data pull.

#include "registration/detail/fit_scalars.hpp"
#include "tled/conditions.hpp"
#include "tled/engine.hpp"
#include "tled/equilibrium.hpp"

#include <array>
#include <memory>
#include <optional>

namespace tissuewarp::registration::detail {

/// The springs of the last round in two halves: cubes of space in the order of a chess board. Each half is left out in
/// turn, and judged at those of its nodes that share no element with a node that pulls (a datum within an element pulls
/// at all of its corners). Blocks, by which the misfits are counted, have half the edge of the cubes.
class HeldOut {
public:
    HeldOut(const PreparedModel& prepared, const UpdateResult& result, const FitOptions& options);

    /// Blocks that hold judged data.
    [[nodiscard]] int block_count() const { return block_count_; }
    /// Block of each judged spring.
    [[nodiscard]] const std::vector<int>& block_of() const { return block_of_; }

    /// Misfits u − target of the judged springs along what they pull, 3 × S, mm, weighed so that the squares of a block
    /// add up to the mean over its springs by stiffness. Throws SolverFailure, Cancelled.
    [[nodiscard]] Eigen::Matrix3Xd residuals(const Tissue& tissue, Observer& observer);

    [[nodiscard]] int equilibria() const { return equilibria_; }
    [[nodiscard]] int force_evaluations() const { return force_evaluations_; }

private:
    /// One half of the data left out.
    struct Fold {
        tled::Conditions training;  // without loads
        std::vector<tled::Spring> judged;
        std::vector<Eigen::Matrix3d> root;  // what weighs the misfits of the judged
        std::optional<tled::RestStiffness> factor;
    };
    /// The materials that engine and factors are of.
    struct Current {
        tled::MaterialTable materials;
        std::optional<tled::RestState> rest;  // unless it is the prepared one
        std::unique_ptr<tled::Engine> engine;
    };

    const PreparedModel& prepared_;
    double tolerance_mm_;
    Eigen::Matrix3Xd start_;  // 3 × N, mm
    std::array<Fold, 2> folds_;
    std::vector<int> block_of_;
    int block_count_ = 0, equilibria_ = 0, force_evaluations_ = 0;
    Current current_;

    void take(const tled::MaterialTable& materials);
    [[nodiscard]] Eigen::Matrix3Xd displacement(Fold& fold, const Eigen::Matrix3Xd& loads, Observer& observer);
};

}  // namespace tissuewarp::registration::detail
