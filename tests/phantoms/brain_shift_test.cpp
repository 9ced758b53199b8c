/// The real head with a simulated craniotomy, solved by an independent finite-element code: registration from
/// everything that README.md states a figure for, scored at the landmarks that moved, which it never saw.
#include "imaging/image_io.hpp"
#include "registration/io/surface_points.hpp"
#include "tests/phantoms/claims.hpp"
#include "tests/support/folders.hpp"

namespace tissuewarp::registration {
namespace {

class BrainShift : public ::testing::Test {
protected:
    const std::filesystem::path head = tissuewarp::test::source_folder() / "data" / "brainshift";
    const imaging::Volume moving = imaging::read_labels(head / "preop_labels.nii.gz");

    /// Scores, and asks for a result that folds nowhere and that the program does not doubt.
    void expect_at_moved_landmarks(double mean, double percentile_95, const UpdateResult& result) const {
        const TargetError error = claims::error_of(result, read_landmarks(head / "landmarks.csv"));
        claims::expect({57, 3.83, mean, percentile_95}, error.moved_before, error.moved_after);
        claims::expect_unfolded(result.deformation, moving);
        EXPECT_THAT(texts(result.doubts), ::testing::IsEmpty());
    }

    [[nodiscard]] UpdateResult from_image(const std::string& name, bool align) const {
        const auto prepared = claims::prepared_with_image(moving, imaging::read_volume(head / "preop.nii.gz"),
                                                          claims::without_fixed_labels(moving));
        return update(prepared, {.image = imaging::read_volume(head / name)}, claims::on_cpu(align));
    }
};

TEST_F(BrainShift, FromLabels) {
    const auto fixed = imaging::read_labels(head / "intraop_labels.nii.gz");
    expect_at_moved_landmarks(0.26, 0.53, update(prepare(moving), {.labels = fixed}, claims::on_cpu()));
}

TEST_F(BrainShift, FromTheCompleteImage) {
    expect_at_moved_landmarks(0.14, 0.28, from_image("intraop.nii.gz", true));
}

TEST_F(BrainShift, FromAThirdOfTheHeadNoisyInThickSlicesAndOfAnotherContrast) {
    expect_at_moved_landmarks(0.19, 0.36, from_image("intraop_degraded.nii.gz", false));
}

TEST_F(BrainShift, FromAPatchOfTheSurface) {
    const auto patch = read_surface_points(head / "intraop_surface.ply", 0.3);
    const auto prepared = prepare(moving, claims::without_fixed_labels(moving));
    expect_at_moved_landmarks(0.67, 1.11, update(prepared, {.surface = patch}, claims::on_cpu(false)));
}

}  // namespace
}  // namespace tissuewarp::registration
