#pragma once
/// What data and tissue leave open of a displacement where unknown loads are found with it.

#include "registration/loads/load_fit.hpp"

#include <Eigen/Core>

#include <memory>
#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

/// Loads of known shapes and size, as load_fit.hpp has them.
struct KnownLoads {
    LoadShapes shapes;
    double size = 0;
};

/// With loads B a, a of variance s², the posterior covariance ε A⁻¹ becomes ε S with
/// S = A⁻¹ + A⁻¹ B (M + s⁻²)⁻¹ Bᵀ A⁻¹/ε, M the information of the loads (load_fit.hpp). Without loads S = A⁻¹.
class LoadedPosterior {
public:
    explicit LoadedPosterior(Posterior posterior, std::shared_ptr<const KnownLoads> loads = nullptr);

    /// S times forces, 3N × k, mN: displacements, mm.
    [[nodiscard]] Eigen::MatrixXd inverse(const Eigen::MatrixXd& forces) const;
    /// What is found of loads, and answers to them, where data show these displacements without (A⁻¹ K_D t, 3N × k,
    /// mm); 0 without loads.
    [[nodiscard]] Eigen::MatrixXd of_loads(const Eigen::MatrixXd& shown) const;
    /// S between some nodes, 3n × 3n, mm/mN.
    [[nodiscard]] Eigen::MatrixXd inverse_between(const std::vector<int>& nodes) const;

    /// Without the loads.
    [[nodiscard]] const Posterior& unloaded() const& { return posterior_; }
    [[nodiscard]] Posterior unloaded() && { return std::move(posterior_); }
    [[nodiscard]] const std::shared_ptr<const KnownLoads>& loads() const { return loads_; }

private:
    Posterior posterior_;
    std::shared_ptr<const KnownLoads> loads_;
    std::shared_ptr<const LoadFit> fit_;  // of *loads_
};

}  // namespace tissuewarp::registration::detail
