/// Phantoms whose tumour is resected, and those that bulge through an opening.
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

/// The cavity meets the outside: what fills it is seen beside what is around the organ.
TEST(ResectionPhantom, MayBeOpenToTheOutside) {
    const Phantom gone = patient(Family::Opened, 2);
    EXPECT_NE(gone.story.find("through a corridor"), std::string::npos) << gone.story;
    const auto touches_outside = [](const imaging::Volume& hole, const auto& is_outside) {
        int touching = 0;
        const auto& size = hole.geometry.size;
        for (int k = 1; k < size[2]; ++k)
            for (int j = 0; j < size[1]; ++j)
                for (int i = 0; i < size[0]; ++i) {
                    const std::int64_t here = hole.offset(i, j, k), below = hole.offset(i, j, k - 1);
                    const auto* in = hole.data<std::uint8_t>();
                    touching += (in[here] && is_outside(below)) || (in[below] && is_outside(here));
                }
        return touching;
    };
    const imaging::Volume taken = imaging::mask_of(gone.moving_labels, 2);
    EXPECT_GT(touches_outside(taken, [&](std::int64_t n) { return gone.moving_labels.data<std::int32_t>()[n] == 0; }),
              10);
    const PhantomImages images = gone.images();
    EXPECT_GT(imaging::millilitres(images.cavity), 0.3 * imaging::millilitres(taken));
    EXPECT_LT(imaging::millilitres(images.cavity), 1.3 * imaging::millilitres(taken));
}

// What moves most moves out, towards where the surface is seen.
TEST(BulgedPhantom, IsSeenWhereItBulges) {
    PhantomOptions options;
    options.family = Family::Bulged;
    options.misplacement = Misplacement{};
    for (const std::uint64_t seed : {2, 3}) {
        const Phantom phantom = random_phantom(seed, options);
        const Eigen::Matrix3Xd &from = phantom.targets.moving, moved = phantom.targets.fixed - from;
        Eigen::Index most = 0;
        const double most_mm = moved.colwise().norm().maxCoeff(&most);
        const Eigen::Vector3d out = (phantom.surface.points.rowwise().mean() - from.rowwise().mean()).normalized();
        EXPECT_GT(most_mm, 2) << phantom.story;
        EXPECT_GT(moved.col(most).dot(out), 0.7 * most_mm) << phantom.story;
        EXPECT_GT((from.col(most) - from.rowwise().mean()).dot(out), 0) << phantom.story;
        EXPECT_NE(phantom.story.find("bulges"), std::string::npos) << phantom.story;
    }
}

}  // namespace
}  // namespace tissuewarp::study
