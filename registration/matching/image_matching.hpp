#pragma once
/// Image-driven correspondence: where does each textured point of the preoperative image lie in a bare intraoperative
/// volume? Feature points, block matching, and outlier rejection by neighbours; no model and no labels of the fixed
/// image needed.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/options.hpp"

#include <Eigen/Core>

#include <memory>
#include <vector>

namespace tissuewarp::registration {

/// Feature points, LPS mm (3 × N), and their structure tensors G * (∇I ∇Iᵀ) in LPS, (intensity/mm)².
struct FeaturePoints {
    Eigen::Matrix3Xd points;
    std::vector<Eigen::Matrix3d> structure;
};

/// Beside FeatureOptions.
struct FeaturePointRules {
    double least_score = 0.05;  ///< flat tissue lies below. Chosen by hand; on which data is not recorded
    double packing = 0.38;      ///< of space by balls about points taken at random until none fits (mathematics)
};

/// Points of high structure in and near the mask (voxels != 0, any grid), spread evenly: in the order of the score
/// Σ λᵢ/(λᵢ + λ₀), λ₀ the median of the mean eigenvalue in the mask, each point that lies far enough from those taken.
/// Corners (three strong eigenvalues, Rohr 1997) score close to 3 and come first, plane edges up to 1; flat tissue is
/// left out. Throws InvalidInput on non-finite voxels, an empty mask, one off the image, or an image that is constant
/// in it.
FeaturePoints select_feature_points(const imaging::Volume& image, const imaging::Volume& mask,
                                    const FeatureOptions& options = {});

namespace detail {
struct TemplateImages;
}

/// All that block matching needs of the moving image, made once before the operation: the points, and the image around
/// them on the working grids of every level, which lie along its own axes. Immutable; copies share it.
class MatchingTemplate {
public:
    /// Points: 3 × N, LPS mm. Throws InvalidInput on non-finite voxels or points, options out of range, and when no
    /// point lies in the image.
    MatchingTemplate(const imaging::Volume& moving, const Eigen::Matrix3Xd& points,
                     const TemplateOptions& options = {});

    [[nodiscard]] const Eigen::Matrix3Xd& points() const;
    [[nodiscard]] const TemplateOptions& options() const;
    [[nodiscard]] const detail::TemplateImages& images() const { return *images_; }

private:
    std::shared_ptr<const detail::TemplateImages> images_;
};

/// What the preoperative image shows of the tissue, to be found again in a bare intraoperative volume.
struct ImageModel {
    imaging::Volume image;
    MatchingTemplate blocks;
};

/// A block of the moving image found in the fixed one.
struct BlockMatch {
    int point = -1;                                         ///< column of the points given
    Eigen::Vector3d moving = Eigen::Vector3d::Zero();       ///< centre of the block, LPS mm
    Eigen::Vector3d fixed = Eigen::Vector3d::Zero();        ///< where it was found, LPS mm, sub-voxel
    double cost = 0;                                        ///< mean squared difference at the match
    double uniqueness = 0;                                  ///< 0..1, see docs/method.md, section 7
    double back_match_mm = 0;                               ///< error of the way back, along what the block shows
    double confidence = 0;                                  ///< 0..1: uniqueness × exp(−½ (back match / scale)²)
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< inverse covariance of `fixed`, 1/mm², LPS
};

/// Finds the blocks around the template's points near `predicted` (3 × N, LPS mm, fixed frame), coarse to fine. The
/// fixed image is looked at along the template's axes, turned by `rotation`. Between levels each block's prediction is
/// the robust local affine fit of its neighbours' matches. The matches returned are those of the level that is the most
/// certain of them: noise leaves the finest grid less to see than the one before. What lies outside of either image, or
/// in parts of them that are exactly constant (padding beyond the field of view), counts in no cost. Returns the blocks
/// found, in the order of the points; those that left the fixed image, show too little of themselves there or are no
/// better found than chance finds are absent. Threads do not change the result. Formulas: docs/method.md. Throws
/// InvalidInput on non-finite voxels or positions, sizes that differ, options out of range, and when no block lies in
/// both images; Cancelled.
std::vector<BlockMatch> match_blocks(const MatchingTemplate& moving, const imaging::Volume& fixed,
                                     const Eigen::Matrix3Xd& predicted, const BlockMatchingOptions& options = {},
                                     Observer& observer = silent_observer());

/// The matches that agree with a local affine motion of their neighbours, fitted by least trimmed squares (Rousseeuw
/// 1984, concentration steps of Rousseeuw and Van Driessen 2006). Residuals are taken along what the blocks show: a
/// block on a plane edge is judged across the edge alone.
std::vector<BlockMatch> consistent_matches(const std::vector<BlockMatch>& matches,
                                           const ConsistencyOptions& options = {});

}  // namespace tissuewarp::registration
