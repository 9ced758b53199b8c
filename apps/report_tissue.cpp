#include "apps/report_tissue.hpp"

#include "apps/report_json.hpp"
#include "imaging/labels.hpp"
#include "registration/evaluation.hpp"

namespace tissuewarp::apps {

using nlohmann::json;

json resected_json(const RegistrationRun& run) {
    json object{{"labels", run.prepared->options.resected},
                {"volume_ml", number_json(imaging::millilitres(run.prepared->resected))},
                {"gap_ml", number_json(imaging::millilitres(run.products.gap))},
                {"value", gap_value}};
    if (run.resection)
        object["found"] = {{"cavity_ml", number_json(run.resection->cavity_ml)},
                           {"deviation", number_json(run.resection->deviation)}};
    return object;
}

json sliding_json(const RegistrationRun& run) {
    const Eigen::Matrix3Xd& u = run.result.deformation.displacement;
    std::vector<double> slid;
    for (const tled::SlidingPair& pair : run.prepared->sliding) {
        const Eigen::Vector3d apart = u.col(pair.second) - u.col(pair.first);
        slid.push_back((apart - pair.normal.dot(apart) * pair.normal).norm());
    }
    const registration::Summary summary = registration::summarise(slid);
    return {{"labels", run.prepared->options.sliding},
            {"mean_mm", number_json(summary.mean)},
            {"largest_mm", number_json(summary.maximum)}};
}

}  // namespace tissuewarp::apps
