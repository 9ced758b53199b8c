#pragma once
/// Does the interval of a registration's error estimate hold? Random phantoms are registered, and what the estimate
/// says of their targets is set against what happened.

#include "core/observer.hpp"
#include "registration/uncertainty.hpp"
#include "study/phantom.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::study {

/// What a registration is given of a phantom.
enum class Evidence {
    Labels,
    Surface,
    SurfaceAndPoints,
    Points,
    Curves,
    Image,
    DegradedImage,
    PartialImage,
    OtherContrast,
    Ultrasound
};
constexpr std::array all_evidence{Evidence::Labels,        Evidence::Surface,      Evidence::SurfaceAndPoints,
                                  Evidence::Points,        Evidence::Curves,       Evidence::Image,
                                  Evidence::DegradedImage, Evidence::PartialImage, Evidence::OtherContrast,
                                  Evidence::Ultrasound};
/// "labels", "surface", "surface-and-points", "points", "curves", "image", "degraded-image", "partial-image",
/// "other-contrast", "ultrasound".
const char* name_of(Evidence evidence);

/// What a registration knows of tissue that is gone.
enum class KnownOfResection {
    Told,    ///< which labels are
    Sought,  ///< it is to be found in images (registration/resection)
    Untold   ///< nothing: organ and tumour are one label, which is taken to be whole
};

struct CoverageOptions {
    std::uint64_t first_seed = 1001, last_seed = 1120;
    std::vector<Evidence> evidence{all_evidence.begin(), all_evidence.end() - 1};  ///< without ultrasound
    PhantomOptions phantom;
    KnownOfResection resection = KnownOfResection::Told;
    registration::UpdateOptions update;
    registration::UncertaintyOptions uncertainty;
};

/// One target of one registration.
struct CoverageRow {
    std::uint64_t seed = 0;
    Evidence evidence = Evidence::Labels;
    int target = 0;
    Eigen::Vector3d error = Eigen::Vector3d::Zero();  ///< where it was put less where it is, moving frame, mm
    double held_out_z = 1;  ///< of the registration: what regions left out were missed by, over what was expected
    std::string doubts;     ///< codes of the registration's, apart by spaces; notices are none
    double moved_mm = 0;    ///< elastic displacement that the registration gave it
    bool in_view = true;    ///< where it truly is lies in what was seen
    registration::ErrorEstimate estimate;
    double cavity_dice =
        -1;  ///< of the registration, by images: of its hole, or the cavity found, with the true one; -1: none
    double least_det_j = 1;  ///< of the registration's tetrahedra
};

/// Registers the phantoms of the seeds to each kind of evidence. Each seed's rows are kept in
/// `folder`/phantom_<seed>.csv, which appear complete or not at all; seeds whose file is there are read, not computed.
/// Phantoms and registrations that fail are noted to the observer and have no rows. Throws InvalidInput for options
/// that make no sense or a file that is not such a table, IoError, Cancelled.
std::vector<CoverageRow> measured_coverage(const std::filesystem::path& folder, const CoverageOptions& options = {},
                                           Observer& observer = silent_observer());

/// Rows of one phantom.
std::vector<CoverageRow> measured_coverage(const Phantom& phantom, const CoverageOptions& options,
                                           Observer& observer = silent_observer());

/// CSV with a header; lengths mm, errors and covariances in the moving frame.
void write_coverage(const std::filesystem::path& path, const std::vector<CoverageRow>& rows);
std::vector<CoverageRow> read_coverage(const std::filesystem::path& path);

}  // namespace tissuewarp::study
