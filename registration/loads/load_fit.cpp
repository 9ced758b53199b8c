#include "registration/loads/load_fit.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <limits>
#include <utility>

namespace tissuewarp::registration::detail {

LoadShapes::LoadShapes(Eigen::MatrixXd loads, const Posterior& unseen, double energy)
    : forces_(std::move(loads)), answers_(unseen.inverse(forces_)), energy_(energy) {
    const double drawn = 0.5 * answers_.cwiseProduct(forces_).sum();
    scale_ = std::sqrt(energy / drawn);
    forces_ *= scale_;
    answers_ *= scale_;
}

double LoadShapes::deviation_mm() const {
    return std::sqrt(answers_.squaredNorm() / (double(answers_.rows()) / 3));
}

LoadFit::LoadFit(const LoadShapes& shapes, const Posterior& seen)
    : shapes_(shapes), answers_(seen.inverse(shapes.forces_)) {
    const Eigen::MatrixXd product = shapes.forces_.transpose() * (shapes.answers_ - answers_) / shapes.energy_;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(0.5 * (product + product.transpose()));
    axes_ = modes.eigenvectors();
    information_ = modes.eigenvalues().cwiseMax(0.0);
}

Eigen::MatrixXd LoadFit::work(const Eigen::MatrixXd& shown) const {
    return shapes_.forces_.transpose() * shown;
}

Eigen::VectorXd LoadFit::work_without(const Eigen::VectorXd& acting, const Eigen::VectorXd& work) const {
    return work - shapes_.forces_.transpose() * (answers_ * acting);
}

double LoadFit::likeliest_size(const Eigen::VectorXd& work, const SizePrior& prior) const {
    const Eigen::ArrayXd b = axes_.transpose() * work / shapes_.energy_;
    double best = -std::numeric_limits<double>::infinity(), size = 0;
    for (int power = load_sizes.least_power; power <= load_sizes.most_power; ++power) {
        const double squared = std::pow(2.0, power);
        const double deviations = 0.5 * std::log(squared / (prior.median * prior.median)) / prior.log_deviation;
        const double evidence =
            0.5 * (b.square() / (information_ + 1 / squared) - (1 + squared * information_).log()).sum() -
            0.5 * deviations * deviations;
        if (evidence <= best) continue;
        best = evidence;
        size = std::sqrt(squared);
    }
    return size;
}

Eigen::MatrixXd LoadFit::coefficients(const Eigen::MatrixXd& work, double size) const {
    const Eigen::VectorXd variances = (information_ + 1 / (size * size)).inverse();
    return axes_ * (variances.asDiagonal() * (axes_.transpose() * work / shapes_.energy_));
}

Eigen::MatrixXd LoadFit::flexibility_between(const std::vector<int>& nodes, double size) const {
    Eigen::MatrixXd there(3 * static_cast<Eigen::Index>(nodes.size()), answers_.cols());
    for (std::size_t n = 0; n < nodes.size(); ++n)
        there.middleRows<3>(static_cast<Eigen::Index>(3 * n)) = answers_.middleRows<3>(3 * Eigen::Index{nodes[n]});
    there *= axes_;
    const Eigen::VectorXd variances = (information_ + 1 / (size * size)).inverse();
    return there * variances.asDiagonal() * there.transpose() / shapes_.energy_;
}

}  // namespace tissuewarp::registration::detail
