#pragma once
/// Everything that one registration read, computed and measured; what outputs and reports are made from.

#include "apps/inputs.hpp"
#include "meshing/quality.hpp"
#include "registration/dial/dial.hpp"
#include "registration/resection/find_resection.hpp"
#include "registration/stretch/stretched_update.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"

#include <chrono>
#include <memory>
#include <optional>

namespace tissuewarp::apps {

/// What a warped image holds where tissue is gone.
inline constexpr double gap_value = 0;

/// Results on grids and at points.
struct Products {
    imaging::Volume moving_to_fixed, fixed_to_moving;       ///< displacement fields, mm, LPS
    registration::Unfolding unfolded_forth, unfolded_back;  ///< of them
    imaging::Volume warped, warped_labels;                  ///< on the output grid; warped is empty without --moving
    imaging::Volume gap;                 ///< there, uint8: where tissue is gone; empty without --resected
    imaging::Volume parted;              ///< there, uint8: where tissue parted; empty unless writes_gap()
    Eigen::Matrix3Xd landmarks, points;  ///< where moving landmarks and points went, mm, LPS; NaN where
                                         ///< their tissue is gone
    std::optional<registration::Uncertainty> uncertainty;
    registration::UncertaintyVolumes uncertainty_volumes;  ///< on the output grid
    std::optional<meshing::SurfaceMesh> surface;
};

/// From points along vessels to the nearest place on the preoperative lines, mm.
struct CurveDistances {
    registration::Summary before, after;  ///< as the headers place the lines, and as they were carried
};

/// How good the result is.
struct Scores {
    std::map<int, registration::Overlap> before, after;  ///< per label, 0 is their union; empty without fixed labels
    registration::JacobianReport mesh, organ, grid;      ///< of the elements, of labelled voxels, of all voxels
    std::optional<registration::TargetError> target_error;
    std::optional<CurveDistances> curves;  ///< where such points were registered to
};

struct RegistrationRun {
    /// `at` is the time of the start, UTC.
    RegistrationRun(const RegisterOptions& given, std::string at) : options(given), started(std::move(at)) {}

    const RegisterOptions& options;
    std::string started;  ///< UTC
    RegistrationInputs inputs;
    std::unique_ptr<registration::PreparedModel> prepared;
    registration::UpdateResult result;
    std::optional<registration::StretchedUpdate> stretched;  ///< where `result` began from a stretch
    std::optional<registration::FoundResection> resection;   ///< where what is gone was sought
    std::optional<registration::DialChoice> dial;            ///< where an accuracy or a time was asked for
    double intraoperative_seconds = 0;                       ///< from data and model at hand to the warped image
    Products products;
    Scores scores;
    std::vector<registration::StageTime> times;
    std::vector<std::string> notes;
};

/// Wall-clock seconds of stages, and of everything.
class StageClock {
public:
    registration::StageTime lap(const std::string& stage) {
        const auto now = Clock::now();
        const double seconds = std::chrono::duration<double>(now - last_).count();
        last_ = now;
        return {stage, seconds};
    }
    [[nodiscard]] double total() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

private:
    using Clock = std::chrono::steady_clock;
    Clock::time_point start_ = Clock::now(), last_ = start_;
};

}  // namespace tissuewarp::apps
