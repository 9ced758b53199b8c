#include "study/point.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tissuewarp::study {

double percentile(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    const double place = share * double(values.size() - 1);
    const auto below = static_cast<std::size_t>(std::floor(place));
    const std::size_t above = std::min(below + 1, values.size() - 1);
    return values[below] + (place - double(below)) * (values[above] - values[below]);
}

Distance length_of(const Eigen::Matrix3Xd& differences) {
    const Eigen::VectorXd length = differences.colwise().norm();
    return {std::sqrt(length.squaredNorm() / double(length.size())), length.maxCoeff()};
}

Point attempted(const std::string& problem, const Setting& setting, const std::function<void(Point&)>& work) {
    Point point, failed;
    point.problem = failed.problem = problem;
    point.setting = failed.setting = setting;
    try {
        work(point);
    } catch (const SolverFailure& failure) {
        failed.failure = failure.what();
        return failed;
    }
    return point;
}

double Point::median_seconds() const {
    return percentile(seconds, 0.5);
}

double Point::percentile_95_seconds() const {
    return percentile(seconds, 0.95);
}

double Point::preparation_seconds() const {
    double sum = 0;
    for (const Stage& stage : stages)
        if (stage.phase == Phase::Preparation) sum += percentile(stage.seconds, 0.5);
    return sum;
}

double Point::error_mm() const {
    return target ? target->mean : std::hypot(numerical->rms, model->rms);
}

}  // namespace tissuewarp::study
