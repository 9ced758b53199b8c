/// Phantoms whose tumour is resected.
#include "study/phantom.hpp"

#include "imaging/labels.hpp"
#include "registration/prepare.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace tissuewarp::study {
namespace {

Phantom patient(Family family, std::uint64_t seed) {
    PhantomOptions options;
    options.family = family;
    return random_phantom(seed, options);
}

const Phantom& resected() {
    static const Phantom phantom = patient(Family::Resected, 2);
    return phantom;
}

TEST(ResectionPhantom, HasACavityOfWhatIsGone) {
    const Phantom& gone = resected();
    ASSERT_EQ(gone.resected, std::vector<int>{2});
    const double before_ml = imaging::millilitres(imaging::mask_of(gone.moving_labels, 2));
    EXPECT_GT(before_ml, 9.5);
    EXPECT_LT(before_ml, 61);
    EXPECT_NE(gone.story.find("resected"), std::string::npos) << gone.story;
    const std::vector<int> left = imaging::labels_in(gone.fixed_labels);
    EXPECT_EQ(std::count(left.begin(), left.end(), 2), 0);
    const PhantomImages images = gone.images();
    const double after_ml = imaging::millilitres(images.cavity);
    EXPECT_GT(after_ml, 0.3 * before_ml);
    EXPECT_LT(after_ml, 1.2 * before_ml);
    cv::Scalar mean, deviation;
    cv::meanStdDev(images.fixed.voxels.reshape(1, 1), mean, deviation, images.cavity.voxels.reshape(1, 1));
    EXPECT_LT(deviation[0], 4);  // fluid or air, and noise
}

/// The same patient with the tumour in place: the same places are looked for, in another deformation.
TEST(ResectionPhantom, HasATwinThatIsWhole) {
    const Phantom &gone = resected(), whole = patient(Family::Unresected, 2);
    EXPECT_TRUE(whole.resected.empty());
    EXPECT_EQ(gone.targets.moving, whole.targets.moving);
    EXPECT_NE(gone.targets.fixed, whole.targets.fixed);
    EXPECT_EQ(cv::norm(gone.moving_labels.voxels, whole.moving_labels.voxels, cv::NORM_INF), 0.0);
}

}  // namespace
}  // namespace tissuewarp::study
