/// A liver bent by pressure and moved as a whole, solved by an independent finite-element code: registration from label
/// maps and from points over a third of its surface, scored at landmarks that it never saw.
#include "imaging/image_io.hpp"
#include "registration/field.hpp"
#include "registration/io/surface_points.hpp"
#include "registration/warp.hpp"
#include "tests/phantoms/claims.hpp"
#include "tests/support/folders.hpp"

namespace tissuewarp::registration {
namespace {

using ::testing::IsEmpty;

class Liver : public ::testing::Test {
protected:
    const std::filesystem::path liver = tissuewarp::test::source_folder() / "data" / "liver";
    const imaging::Volume moving = imaging::read_labels(liver / "preop_labels.nii.gz");

    /// Scores, and asks for a result that folds nowhere and that the program does not doubt.
    void expect_at_landmarks(double mean, double percentile_95, const UpdateResult& result) const {
        const TargetError error = claims::error_of(result, read_landmarks(liver / "landmarks.csv"));
        claims::expect({210, 10.11, mean, percentile_95}, error.before, error.after);
        claims::expect_unfolded(result.deformation, moving);
        EXPECT_THAT(texts(result.doubts), IsEmpty());
    }
};

TEST_F(Liver, FromLabels) {
    const auto fixed = imaging::read_labels(liver / "intraop_labels.nii.gz");
    const auto result = update(prepare(moving), {.labels = fixed}, claims::on_cpu());
    expect_at_landmarks(0.32, 0.81, result);
    const auto back = displacement_fixed_to_moving(result.deformation, fixed.geometry);
    EXPECT_GE(overlap(warp_labels(moving, back), fixed).at(0).dice, 0.99);  // 0.991; 0.861 before
}

TEST_F(Liver, FromAThirdOfItsSurface) {
    const auto points = read_surface_points(liver / "intraop_surface.ply", 0.7);
    const auto prepared = prepare(moving, claims::without_fixed_labels(moving));
    expect_at_landmarks(1.03, 2.40, update(prepared, {.surface = points}, claims::on_cpu()));
}

}  // namespace
}  // namespace tissuewarp::registration
