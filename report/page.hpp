#pragma once
/// What a registration shows to people: a picture of three planes, and one page with a viewer that needs no network.

#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

#include <nlohmann/json.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::report {

/// Null where there is none; a panel whose data is missing is left out.
struct ReportInput {
    const imaging::Volume* moving = nullptr;         ///< preoperative image
    const imaging::Volume* fixed = nullptr;          ///< intraoperative image
    const imaging::Volume* warped = nullptr;         ///< preoperative image in the intraoperative frame
    const imaging::Volume* moving_labels = nullptr;  ///< needed
    const imaging::Volume* fixed_labels = nullptr;   ///< needed, or the warped ones
    const imaging::Volume* warped_labels = nullptr;
    const imaging::Volume* moving_to_fixed = nullptr;  ///< displacement field of three channels, LPS mm, moving grid
    const imaging::Volume* uncertainty = nullptr;  ///< estimated error, 1 σ, mm, fixed frame, NaN outside the tissue
    const imaging::Volume* trust = nullptr;        ///< beside it: 0 no tissue, 1 shown, 2 carried, 3 unknown; one byte
    const imaging::Volume* fixed_to_moving = nullptr;  ///< displacement field of three channels, LPS mm, fixed grid
    const meshing::TetMesh* mesh = nullptr;            ///< of the organ, moving frame
    const Eigen::Matrix3Xd* fixed_nodes = nullptr;     ///< where its nodes are now, 3 × N, LPS mm, fixed frame
    nlohmann::json report;  ///< report.json, docs/manual/register-outputs.md; missing keys leave sections out
    const imaging::Volume* organ = nullptr;  ///< the moving labels without bones about it, where these have some
};

/// What of a report takes time to draw, and none of its figures but "alignment".
struct Pictures {
    std::vector<unsigned char> preview_png;
    std::string preview_jpeg;                    ///< base64, for the page
    std::string scene;                           ///< JSON that the page's viewer reads
    std::optional<double> most_displacement_mm;  ///< in the organ, where there is a field
};

/// Throws InvalidInput without the label maps that are needed, when they hold no label, or when a volume has the wrong
/// number of channels.
Pictures draw_pictures(const ReportInput& input);

/// Writes preview.png and report.html into an existing folder, each to a temporary name that is renamed. Throws IoError
/// when the files cannot be written. The second draws the pictures too, and throws as that does.
void write_report(const nlohmann::json& report, const Pictures& pictures, const std::filesystem::path& folder);
void write_report(const ReportInput& input, const std::filesystem::path& folder);

}  // namespace tissuewarp::report
