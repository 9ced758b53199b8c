#pragma once
/// What README.md and docs/lab/results.md claim of a registration, held with room of a tenth on the files it is claimed
/// for.

#include "registration/evaluation.hpp"
#include "registration/update.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace tissuewarp::registration::claims {

/// Errors at targets, mm, as docs/lab/results.md states them.
struct Claim {
    int count = 0;
    double before = 0;  ///< mean
    double mean = 0, percentile_95 = 0;
    double room = 1.1;
};

/// Expects the claim. Number and place of the targets before tell other files from those that it was made for.
void expect(const Claim& claim, const Summary& before, const Summary& after);

TargetError error_of(const UpdateResult& result, const Landmarks& targets);

/// Expects that no element folds, nor a voxel of the forward field on the grid of the moving volume.
void expect_unfolded(const Deformation& deformation, const imaging::Volume& moving);

/// Points (LPS mm) of a true forward field's grid in a preoperative mask, and where the field takes them.
Landmarks field_targets(const std::filesystem::path& field, const std::filesystem::path& mask);

UpdateOptions on_cpu(bool align = true);

/// As the command line meshes where no label map shows the organ during the operation.
PrepareOptions without_fixed_labels(const imaging::Volume& moving_labels);

/// `prepare` and `prepare_image`.
PreparedModel prepared_with_image(const imaging::Volume& moving_labels, const imaging::Volume& moving,
                                  const PrepareOptions& options);

}  // namespace tissuewarp::registration::claims
