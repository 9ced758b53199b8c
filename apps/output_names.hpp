#pragma once
/// The names of the files that a registration leaves behind: here and nowhere else.

#include "apps/options.hpp"

#include <array>
#include <string>
#include <vector>

namespace tissuewarp::apps {

inline constexpr const char* moving_to_fixed_name = "displacement_moving_to_fixed.nii.gz";
inline constexpr const char* fixed_to_moving_name = "displacement_fixed_to_moving.nii.gz";
inline constexpr const char* gap_name = "gap.nii.gz";
inline constexpr const char* cavity_name = "cavity.nii.gz";
inline constexpr const char* transform_name = "transform.h5";

/// Files that are written when --write names them.
struct OptionalOutput {
    const char* word;  ///< for --write
    const char* file;
};
inline constexpr OptionalOutput inverse_transform{"inverse_transform", "inverse_transform.h5"};
inline constexpr std::array<OptionalOutput, 10> optional_outputs{{
    {"displacement_magnitude", "displacement_magnitude.nii.gz"},
    {"jacobian", "jacobian.nii.gz"},
    {"organ", "organ.vtp"},
    {"markups", "warped_landmarks.mrk.json"},
    {"markups", "warped_points.mrk.json"},
    inverse_transform,
    {"dicom", "registration.dcm"},
    {"dicom", "structures.dcm"},
    {"dicom", "uncertainty.dcm"},
    {"dicom", "jacobian.dcm"},
}};

/// What --write takes: the words above and "all".
std::vector<std::string> words_of_write();

/// Whether --write asks for a file of `optional_outputs` that these inputs can give.
bool writes(const RegisterOptions& options, const OptionalOutput& output);

/// Whether it is said where tissue is gone or parted: with resections, and where both images are at hand.
bool writes_gap(const RegisterOptions& options);

/// Whether what is gone is sought in an image alone.
bool writes_cavity(const RegisterOptions& options);

/// Names of the files in the output folder.
std::vector<std::string> output_names(const RegisterOptions& options);

/// "warped_surface" with the extension of the surface that is carried along.
std::string surface_name(const RegisterOptions& options);

/// Of any options, and of versions before this one.
bool is_register_output(const std::string& name);

}  // namespace tissuewarp::apps
