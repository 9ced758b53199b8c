#include "study/coverage.hpp"

#include "core/cancel_only.hpp"
#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "meshing/point_location.hpp"
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/resection/find_resection.hpp"
#include "registration/resection/gap.hpp"
#include "registration/update.hpp"

#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::study {

namespace {

namespace fs = std::filesystem;
using registration::PreparedModel;

bool is_image(Evidence evidence) {
    return evidence >= Evidence::Image;
}

/// What a registration without resected tissue leaves open.
struct Hole {
    double dice = 0;                          ///< of the hole or the found cavity with the true cavity
    std::vector<registration::Doubt> doubts;  ///< of what was found to be gone
};

/// A phantom, its images once they are needed, and models made of it.
class Patient {
public:
    Patient(const Phantom& phantom, KnownOfResection known)
        : phantom_(phantom),
          labels_(phantom.moving_labels),
          fixed_labels_(phantom.fixed_labels),
          resected_(phantom.resected) {
        if (known == KnownOfResection::Told) return;
        for (imaging::Volume* map : {&labels_, &fixed_labels_})
            *map = imaging::mask_of_all(*map).as(CV_32S);  // tumour and organ alike
        resected_.clear();
    }

    registration::Intraoperative seen(Evidence evidence) {
        registration::Intraoperative seen;
        switch (evidence) {
            case Evidence::Labels:
                seen.labels = fixed_labels_;
                break;
            case Evidence::Surface:
                seen.surface = phantom_.surface;
                break;
            case Evidence::Points:
                seen.points = phantom_.points;
                break;
            case Evidence::SurfaceAndPoints:
                seen.surface = phantom_.surface;
                seen.points = phantom_.points;
                break;
            case Evidence::Curves:
                seen.curves = phantom_.curves;
                break;
            case Evidence::Image:
                seen.image = images().fixed;
                break;
            case Evidence::DegradedImage:
                seen.image = images().degraded;
                break;
            case Evidence::PartialImage:
                seen.image = images().partial;
                break;
            case Evidence::OtherContrast:
                seen.image = images().other_contrast;
                break;
            case Evidence::Ultrasound:
                seen.image = ultrasound().fixed;
                break;
        }
        return seen;
    }

    /// As `tissuewarp register` would, which knows nothing of the tissue.
    const PreparedModel& prepared(Evidence evidence, Observer& observer) {
        std::optional<PreparedModel>& model = evidence == Evidence::Labels       ? for_labels_
                                              : evidence == Evidence::Ultrasound ? for_ultrasound_
                                                                                 : for_others_;
        if (!model) model = made_of(labels_, resected_, evidence, 1, observer);
        if (is_image(evidence) && !model->image)
            registration::prepare_image(
                *model, evidence == Evidence::Ultrasound ? ultrasound().moving : images().moving, {}, observer);
        return *model;
    }

    /// The same without what the image does not show, of which a first look tells; all of it where everything is shown.
    const PreparedModel& without_what_is_gone(Evidence evidence, const registration::Intraoperative& seen,
                                              const registration::UpdateOptions& options, Observer& observer) {
        PreparedModel whole = made_of(labels_, resected_, evidence, registration::FirstLook().coarser, observer);
        registration::prepare_image(whole, images().moving, registration::image_of_first_look(), observer);
        const auto first = registration::update(whole, seen, registration::for_first_look(options), observer);
        found_ = registration::find_resection(whole, first.deformation, images().moving, *seen.image, observer);
        if (found_->gone_ml == 0) return prepared(evidence, observer);
        imaging::Volume labels = labels_.clone();
        const int gone = imaging::labels_in(labels).back() + 1;
        labels.voxels.setTo(gone, found_->gone.voxels);
        without_found_ = made_of(labels, {gone}, evidence, 1, observer);
        registration::prepare_image(*without_found_, images().moving, {}, observer);
        return *without_found_;
    }

    /// The hole that a registration by an image leaves, or the cavity that was found in it; nothing where none is to
    /// be.
    std::optional<Hole> hole(Evidence evidence, const PreparedModel& prepared,
                             const registration::Deformation& deformation) {
        if (phantom_.resected.empty() || !is_image(evidence) || evidence == Evidence::Ultrasound) return std::nullopt;
        const imaging::Volume& truth = images().cavity;
        imaging::Volume gap(truth.geometry, CV_8UC1);
        if (!prepared.resected.empty())
            gap = gap_after(deformation, prepared.resected, displacement_fixed_to_moving(deformation, truth.geometry));
        const imaging::Volume told = imaging::mask_of_all(found_ ? found_->cavity : gap);
        const auto count = [](const cv::Mat& mask) { return double(cv::countNonZero(mask.reshape(1, 1))); };
        cv::Mat both;
        cv::bitwise_and(told.voxels, imaging::mask_of_all(truth).voxels, both);
        return Hole{2 * count(both) / (count(told.voxels) + count(truth.voxels)),
                    found_ ? doubts_of(*found_, deformation, gap) : std::vector<registration::Doubt>()};
    }

    /// Of a partial image or ultrasound: whether it shows where the target is. Of everything else yes.
    bool in_view(Evidence evidence, Eigen::Index target) {
        const Eigen::Vector3d place = phantom_.targets.fixed.col(target);
        if (evidence == Evidence::Ultrasound) return ultrasound().shows(place);
        return evidence != Evidence::PartialImage || images().view.holds(place);
    }

private:
    /// Its edges `coarser` times those that are suggested.
    static PreparedModel made_of(const imaging::Volume& labels, std::vector<int> resected, Evidence evidence,
                                 double coarser, Observer& observer) {
        registration::PrepareOptions options;
        const imaging::Volume organ = imaging::without_labels(labels, resected);
        options.resected = std::move(resected);
        options.meshing.edge_length =
            coarser * (evidence == Evidence::Labels ? registration::suggested_edge_length(organ)
                                                    : registration::suggested_edge_length_without_labels(organ));
        return registration::prepare(labels, options, observer);
    }

    const PhantomImages& images() {
        if (!images_) images_ = phantom_.images();
        return *images_;
    }

    const PhantomUltrasound& ultrasound() {
        if (!ultrasound_) ultrasound_ = phantom_.ultrasound();
        return *ultrasound_;
    }

    const Phantom& phantom_;
    imaging::Volume labels_, fixed_labels_;  // what is known of the organ
    std::vector<int> resected_;
    std::optional<PhantomImages> images_;
    std::optional<PhantomUltrasound> ultrasound_;
    std::optional<PreparedModel> for_labels_, for_others_, for_ultrasound_, without_found_;
    std::optional<registration::FoundResection> found_;
};

void add_codes(std::string& codes, const std::vector<registration::Doubt>& doubts) {
    for (const registration::Doubt& doubt : doubts)
        if (doubt.severity == registration::Severity::Doubt) codes.append(codes.empty() ? "" : " ").append(doubt.code);
}

std::vector<CoverageRow> rows_of(const Phantom& phantom, Patient& patient, Evidence evidence,
                                 const CoverageOptions& options, Observer& observer) {
    const registration::Intraoperative seen = patient.seen(evidence);
    const bool seeks = options.resection == KnownOfResection::Sought && seen.image;
    const PreparedModel& prepared = seeks ? patient.without_what_is_gone(evidence, seen, options.update, observer)
                                          : patient.prepared(evidence, observer);
    const auto result = registration::update(prepared, seen, options.update, observer);
    const registration::Uncertainty uncertainty =
        registration::uncertainty(prepared, result, options.uncertainty, observer);
    const auto estimates = uncertainty.at(phantom.targets.moving);
    const Eigen::Matrix3Xd is = result.deformation.placement.inverse() * phantom.targets.fixed;
    const meshing::PointLocator locator(prepared.model.mesh);
    const Eigen::MatrixXd& nodal = result.deformation.displacement;
    const double z = uncertainty.held_out() ? uncertainty.held_out()->z : 1;
    const std::optional<Hole> hole = patient.hole(evidence, prepared, result.deformation);
    std::string doubts;
    add_codes(doubts, result.doubts);
    add_codes(doubts, doubts_of(uncertainty, options.update.equilibrium.tolerance_mm));
    if (hole) add_codes(doubts, hole->doubts);
    const double least_det_j = registration::mesh_jacobians(result.deformation).minimum;
    std::vector<CoverageRow> rows;
    for (std::size_t k = 0; k < estimates.size(); ++k) {
        const auto column = static_cast<Eigen::Index>(k);
        const Eigen::Vector3d X = phantom.targets.moving.col(column);
        const auto place = locator.find(X);
        if (!estimates[k] || !place) continue;  // in the organ, out of its mesh
        const Eigen::Vector3d u = meshing::interpolate(prepared.model.mesh, nodal, *place);
        rows.push_back({phantom.seed, evidence, static_cast<int>(k), X + u - is.col(column), z, doubts, u.norm(),
                        patient.in_view(evidence, column), *estimates[k], hole ? hole->dice : -1, least_det_j});
    }
    return rows;
}

void require_valid(const CoverageOptions& options) {
    if (options.first_seed > options.last_seed)
        throw InvalidInput("coverage: the first seed, " + std::to_string(options.first_seed) +
                           ", comes after the last, " + std::to_string(options.last_seed));
    if (options.evidence.empty()) throw InvalidInput("coverage: no kind of evidence is wanted; name at least one");
}

/// Says which phantom runs and how long the rest will take; asks for a stop in between.
class Progress {
public:
    Progress(const CoverageOptions& options, Observer& observer)
        : first_(options.first_seed), count_(options.last_seed - options.first_seed + 1), observer_(observer) {}

    void before(std::uint64_t seed) {
        std::string stage = "phantom " + std::to_string(seed);
        if (computed_ > 0) {
            const std::chrono::duration<double> passed = Clock::now() - start_;
            const double left = passed.count() / double(computed_) * double(first_ + count_ - seed);
            stage += ", " + std::to_string(int(left / 60) + 1) + " min left";
        }
        observer_.checkpoint(stage, double(seed - first_) / double(count_));
    }
    void computed() { ++computed_; }
    void read() {
        if (computed_ == 0) start_ = Clock::now();
    }

private:
    using Clock = std::chrono::steady_clock;
    std::uint64_t first_, count_, computed_ = 0;
    Clock::time_point start_ = Clock::now();
    Observer& observer_;
};

}  // namespace

const char* name_of(Evidence evidence) {
    constexpr std::array names{"labels", "surface",        "surface-and-points", "points",         "curves",
                               "image",  "degraded-image", "partial-image",      "other-contrast", "ultrasound"};
    return names[static_cast<std::size_t>(evidence)];
}

std::vector<CoverageRow> measured_coverage(const Phantom& phantom, const CoverageOptions& options, Observer& observer) {
    std::vector<CoverageRow> rows;
    Patient patient(phantom, options.resection);
    for (const Evidence evidence : options.evidence) {
        try {
            const auto here = rows_of(phantom, patient, evidence, options, observer);
            rows.insert(rows.end(), here.begin(), here.end());
        } catch (const SolverFailure& failure) {
            observer.note("phantom " + std::to_string(phantom.seed) + ", " + name_of(evidence) + ": " + failure.what());
        } catch (const InvalidInput& refused) {
            observer.note("phantom " + std::to_string(phantom.seed) + ", " + name_of(evidence) + ": " + refused.what());
        }
    }
    return rows;
}

std::vector<CoverageRow> measured_coverage(const fs::path& folder, const CoverageOptions& options, Observer& observer) {
    require_valid(options);
    fs::create_directories(folder);
    Progress progress(options, observer);
    CancelOnly within(observer);
    std::vector<CoverageRow> rows;
    for (std::uint64_t seed = options.first_seed; seed <= options.last_seed; ++seed) {
        progress.before(seed);
        const fs::path kept = folder / ("phantom_" + std::to_string(seed) + ".csv");
        if (fs::exists(kept)) {
            progress.read();
        } else {
            try {
                write_coverage(kept, measured_coverage(random_phantom(seed, options.phantom, within), options, within));
            } catch (const SolverFailure& failure) {
                observer.note(failure.what());
                continue;
            }
            progress.computed();
        }
        const auto here = read_coverage(kept);
        rows.insert(rows.end(), here.begin(), here.end());
    }
    observer.progress("coverage", 1);
    return rows;
}

}  // namespace tissuewarp::study
