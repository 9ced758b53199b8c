#include "registration/loads/loaded_posterior.hpp"

#include <utility>

namespace tissuewarp::registration::detail {

LoadedPosterior::LoadedPosterior(Posterior posterior, std::shared_ptr<const KnownLoads> loads)
    : posterior_(std::move(posterior)), loads_(std::move(loads)) {
    if (loads_) fit_ = std::make_shared<const LoadFit>(loads_->shapes, posterior_);
}

Eigen::MatrixXd LoadedPosterior::inverse(const Eigen::MatrixXd& forces) const {
    const Eigen::MatrixXd unloaded = posterior_.inverse(forces);
    return unloaded + of_loads(unloaded);
}

Eigen::MatrixXd LoadedPosterior::of_loads(const Eigen::MatrixXd& shown) const {
    if (!fit_) return Eigen::MatrixXd::Zero(shown.rows(), shown.cols());
    return fit_->answers(fit_->coefficients(fit_->work(shown), loads_->size));
}

Eigen::MatrixXd LoadedPosterior::inverse_between(const std::vector<int>& nodes) const {
    Eigen::MatrixXd result = posterior_.inverse_between(nodes);
    if (fit_) result += fit_->flexibility_between(nodes, loads_->size);
    return result;
}

}  // namespace tissuewarp::registration::detail
