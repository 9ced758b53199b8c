#include "apps/register_dicom.hpp"

#include "apps/output_names.hpp"
#include "imaging/dicom_results.hpp"
#include "registration/field.hpp"
#include "registration/io/point_map_field.hpp"

#include <algorithm>

namespace tissuewarp::apps {

namespace {

using imaging::read_dicom_origin;

void write_registration(const RegistrationRun& run, const std::filesystem::path& path) {
    const Eigen::Isometry3d back = run.result.deformation.far_motion().inverse();
    const registration::PointMap map = registration::with_linear_part(run.products.fixed_to_moving, back);
    imaging::write_deformable_registration(*map.field, back, read_dicom_origin(run.options.fixed),
                                           read_dicom_origin(run.options.moving), path);
}

}  // namespace

void require_dicom_origins(const RegisterOptions& options) {
    const bool asked = std::any_of(optional_outputs.begin(), optional_outputs.end(), [&](const OptionalOutput& output) {
        return output.word == std::string("dicom") && writes(options, output);
    });
    if (!asked) return;
    for (const std::filesystem::path& path : {options.fixed, options.moving})
        if (imaging::is_dicom(path)) read_dicom_origin(path);
}

void write_dicom_result(const RegistrationRun& run, const std::string& file, const std::filesystem::path& path) {
    if (file == "registration.dcm") return write_registration(run, path);
    if (file == "structures.dcm")
        return imaging::write_structure_set(run.products.warped_labels, run.inputs.label_names,
                                            read_dicom_origin(run.options.fixed), path);
    if (file == "uncertainty.dcm")
        return imaging::write_parametric_map(run.products.uncertainty_volumes.deviation,
                                             {"Registration error, 1 sigma", "mm", "millimeter", "DEVIATION",
                                              "99TISSUEWARP", "Standard deviation of the registration"},
                                             read_dicom_origin(run.options.fixed), path);
    imaging::write_parametric_map(registration::jacobian_determinant(run.products.moving_to_fixed),
                                  {"Jacobian of the registration", "1", "no units", "JACOBIAN", "99TISSUEWARP",
                                   "Determinant of the deformation gradient"},
                                  read_dicom_origin(run.options.moving), path);
}

}  // namespace tissuewarp::apps
