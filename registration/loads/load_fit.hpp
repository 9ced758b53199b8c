#pragma once
/// Loads that nobody stated, found by what they did to the tissue that data show: they move what no datum shows.
///
/// Loads f = B a are of smooth shapes B (unknown_loads), a of variance s²; beside what they do, tissue moves as strain
/// energy lets it: u has the covariance ε K⁻¹ + s² K⁻¹ B Bᵀ K⁻¹, K the stiffness of tissue and prior. Data pull by
/// springs K_d to where they show it, u₀ = (K + K_d)⁻¹ K_d t without loads. With u integrated out, a has the
/// information M = Bᵀ (K⁻¹ − (K + K_d)⁻¹) B/ε and, of b = Bᵀ u₀/ε, the mean (M + s⁻²)⁻¹ b. s is the likeliest one: it
/// maximises the evidence ½ bᵀ (M + s⁻²)⁻¹ b − ½ log det(1 + s² M) (MacKay, Neural Comput 4 (1992) 415). That unknown
/// boundary loads reconstruct an organ from a part of its surface: Rucker et al., IEEE TMI 33 (2014) 147; Heiselman et
/// al., IEEE TMI 39 (2020) 2223.

#include "registration/loads/posterior.hpp"

#include <Eigen/Core>

#include <limits>
#include <vector>

namespace tissuewarp::registration::detail {

/// The sizes of loads that are tried, as powers of √2: from such as strain tissue by nothing to such as strain it by
/// far too much. Chosen by hand; the largest was reached by loads that the lung's masks do not take
/// (docs/decisions/unknown_loads.md).
struct LoadSizes {
    int least_power = -6, most_power = 15;
};
inline constexpr LoadSizes load_sizes{};

/// Shapes of loads and what they do to tissue that no data hold.
class LoadShapes {
public:
    /// `loads` on the nodes, 3N × count, mN; `unseen` is of the prior's springs alone, `energy` is ε (mN mm).
    LoadShapes(Eigen::MatrixXd loads, const Posterior& unseen, double energy);

    /// B over the loads given, so that loads a of size s have the mean strain energy s² ε.
    [[nodiscard]] double scale() const { return scale_; }
    /// Deviation of the displacement under loads a of size 1, mm.
    [[nodiscard]] double deviation_mm() const;

private:
    friend class LoadFit;
    Eigen::MatrixXd forces_, answers_;  // B and K⁻¹ B, 3N × count, mN and mm
    double energy_, scale_ = 1;         // ε, and B over what was given
};

/// What is expected of s beforehand: log-normal, or nothing.
struct SizePrior {
    double median = 1, log_deviation = std::numeric_limits<double>::infinity();
};

class LoadFit {
public:
    /// `seen` is of the data's and the prior's springs; both outlive this.
    LoadFit(const LoadShapes& shapes, const Posterior& seen);

    /// What loads of size 1 do on displacements u₀ (3N × k, mm) that data show without them, Bᵀ u₀: count × k, mN mm.
    [[nodiscard]] Eigen::MatrixXd work(const Eigen::MatrixXd& shown) const;
    /// The same by their work Bᵀ u on the displacement u under data and loads `acting`: u₀ = u − (K + K_d)⁻¹ B a. A
    /// little wrong where data pull by other springs K_d now; loads found by it again and again are right all the same,
    /// since in (M + s⁻²) a = Bᵀ (u − (K + K_d)⁻¹ B a)/ε these springs cancel, and (Bᵀ K⁻¹ B/ε + s⁻²) a = Bᵀ u/ε is
    /// left.
    [[nodiscard]] Eigen::VectorXd work_without(const Eigen::VectorXd& acting, const Eigen::VectorXd& work) const;

    /// The likeliest s by that work on what data show.
    [[nodiscard]] double likeliest_size(const Eigen::VectorXd& work, const SizePrior& prior = {}) const;

    /// The mean of a under loads of size s: count × k.
    [[nodiscard]] Eigen::MatrixXd coefficients(const Eigen::MatrixXd& work, double size) const;

    /// What loads of these coefficients do to tissue that data hold, (K + K_d)⁻¹ B a, 3N × k, mm.
    [[nodiscard]] Eigen::MatrixXd answers(const Eigen::MatrixXd& coefficients) const { return answers_ * coefficients; }

    /// What loads of size s leave open beside the data, over ε: (K + K_d)⁻¹ B (M + s⁻²)⁻¹ Bᵀ (K + K_d)⁻¹/ε between some
    /// nodes, 3n × 3n, mm/mN.
    [[nodiscard]] Eigen::MatrixXd flexibility_between(const std::vector<int>& nodes, double size) const;

private:
    const LoadShapes& shapes_;
    Eigen::MatrixXd answers_;     // (K + K_d)⁻¹ B
    Eigen::MatrixXd axes_;        // eigenvectors of M
    Eigen::ArrayXd information_;  // its eigenvalues
};

}  // namespace tissuewarp::registration::detail
