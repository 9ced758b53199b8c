/// Updates that go on from the last one: as good as those from their beginning while an organ bends bit by bit, and
/// made from the beginning where what is seen does not agree with the last one.
#include "registration/course/go_on.hpp"

#include "core/errors.hpp"
#include "registration/field.hpp"
#include "registration/update.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/registration/textured_phantom.hpp"
#include "tests/support/label_shapes.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <optional>
#include <random>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using ::testing::HasSubstr;

/// An organ that bends by up to about `mm`.
class BendingOrgan {
public:
    explicit BendingOrgan(double mm) : mm_(mm) {}

    [[nodiscard]] Vector3d now(const Vector3d& x) const {
        return x + mm_ * Vector3d(0, 0, std::sin(x[0] / 28) + 0.3 * std::cos(x[1] / 20));
    }
    [[nodiscard]] imaging::Volume labels() const {
        imaging::Volume result = shapes::organ_labels(organ_);
        test::for_each_voxel(result, [&](const Vector3d& index, std::int64_t offset) {
            const Vector3d x = before(result.geometry.point(index));
            const bool inside = (x - organ_.centre).cwiseQuotient(organ_.semi_axes).squaredNorm() <= 1;
            const bool ball = (x - organ_.centre - organ_.inclusion).norm() <= organ_.inclusion_radius;
            result.data<std::int32_t>()[offset] = inside ? (ball ? 2 : 1) : 0;
        });
        return result;
    }
    [[nodiscard]] imaging::Volume image(unsigned seed) const {
        const test::Texture texture;
        return test::sampled(
            shapes::organ_labels(organ_).geometry, [&](const Vector3d& y) { return texture(before(y)); }, 0.05, seed);
    }
    /// Points of a share of its surface, a millimetre off.
    [[nodiscard]] SurfacePoints surface(double share, unsigned seed) const {
        std::mt19937_64 generator(seed);
        std::normal_distribution<double> normal;
        std::vector<Vector3d> points;
        while (points.size() < 1500) {
            const Vector3d way = Vector3d(normal(generator), normal(generator), normal(generator)).normalized();
            if (way[2] < 1 - 2 * share) continue;
            const Vector3d x = organ_.centre + way.cwiseProduct(organ_.semi_axes);
            const Vector3d error(normal(generator), normal(generator), normal(generator));
            points.push_back(now(x) + 0.5 * error);
        }
        SurfacePoints result;
        result.points = Eigen::Map<const Matrix3Xd>(points.front().data(), 3, Eigen::Index(points.size()));
        return result;
    }
    [[nodiscard]] PointPairs pairs(int count, unsigned seed) const {
        const Matrix3Xd all = targets();
        std::mt19937_64 generator(seed);
        std::normal_distribution<double> normal;
        PointPairs result{Matrix3Xd(3, count), Matrix3Xd(3, count), 0.5};
        for (int n = 0; n < count; ++n) {
            const Eigen::Index of = n * all.cols() / count;
            result.moving.col(n) = all.col(of);
            const Vector3d error(normal(generator), normal(generator), normal(generator));
            result.fixed.col(n) = now(all.col(of)) + 0.5 * error;
        }
        return result;
    }
    /// Three vessels, and points along them half a millimetre off.
    [[nodiscard]] Curves vessels(unsigned seed) const {
        std::mt19937_64 generator(seed);
        std::normal_distribution<double> normal;
        Curves result;
        result.deviation_mm = 0.5;
        result.fixed.resize(3, 120);
        for (int line = 0; line < 3; ++line) {
            Matrix3Xd along(3, 40);
            for (int n = 0; n < 40; ++n) {
                const double t = n / 20.0 - 1;
                Vector3d way = 0.7 * t * Vector3d::Unit(line);
                way[(line + 1) % 3] = 0.3 * t * t - 0.2 * line + 0.1;
                along.col(n) = organ_.centre + way.cwiseProduct(organ_.semi_axes);
                const Vector3d error(normal(generator), normal(generator), normal(generator));
                result.fixed.col(40 * line + n) = now(along.col(n)) + 0.5 * error;
            }
            result.moving.push_back(along);
        }
        return result;
    }
    /// Places within.
    [[nodiscard]] Matrix3Xd targets() const {
        std::vector<Vector3d> places;
        for (double x = -0.8; x < 0.9; x += 0.2)
            for (double y = -0.8; y < 0.9; y += 0.2)
                for (double z = -0.8; z < 0.9; z += 0.2)
                    if (Vector3d(x, y, z).norm() < 0.9)
                        places.emplace_back(organ_.centre + Vector3d(x, y, z).cwiseProduct(organ_.semi_axes));
        return Eigen::Map<const Matrix3Xd>(places.front().data(), 3, Eigen::Index(places.size()));
    }
    [[nodiscard]] double mean_error_mm(const UpdateResult& result) const {
        const Matrix3Xd from = targets(), found = PointTransform(result.deformation)(from);
        double sum = 0;
        for (Eigen::Index n = 0; n < from.cols(); ++n) sum += (found.col(n) - now(from.col(n))).norm();
        return sum / double(from.cols());
    }

private:
    double mm_;
    shapes::Organ organ_;

    [[nodiscard]] Vector3d before(const Vector3d& y) const {
        Vector3d x = y;
        for (int n = 0; n < 20; ++n) x -= now(x) - y;
        return x;
    }
};

PreparedModel prepared_organ() {
    PrepareOptions options;
    options.meshing.edge_length = 8;
    return prepare(shapes::organ_labels({}), options);
}

std::shared_ptr<const PreparedModel> organ() {
    return std::make_shared<const PreparedModel>(prepared_organ());
}

/// Which knows what a first image shows.
std::shared_ptr<const PreparedModel> textured_organ() {
    auto model = std::make_shared<PreparedModel>(prepared_organ());
    ImageModelOptions image;
    image.features.count = 800;
    image.blocks.grid_spacing_mm = model->labels.geometry.spacing[0];
    prepare_image(*model, test::sampled(model->labels.geometry, test::Texture()), image);
    return model;
}

UpdateOptions on_cpu() {
    UpdateOptions options;
    options.device = Device::Cpu;
    return options;
}

using Seen = std::function<Intraoperative(const BendingOrgan&, unsigned seed)>;

Intraoperative labels_of(const BendingOrgan& bent, unsigned) {
    return {.labels = bent.labels()};
}
Intraoperative surface_of(const BendingOrgan& bent, unsigned seed) {
    return {.surface = bent.surface(0.6, seed)};
}
Intraoperative pairs_of(const BendingOrgan& bent, unsigned seed) {
    return {.points = bent.pairs(25, seed)};
}

Intraoperative image_of(const BendingOrgan& bent, unsigned seed) {
    return {.image = bent.image(seed)};
}
Intraoperative vessels_of(const BendingOrgan& bent, unsigned seed) {
    return {.curves = bent.vessels(seed)};
}

class GoingOn : public ::testing::TestWithParam<Seen> {
protected:
    Updater updater{textured_organ(), on_cpu()};
};

// Six steps of 0.7 mm, with other noise in each.
TEST_P(GoingOn, IsAsGoodAsFromTheBeginning) {
    const Seen& seen = GetParam();
    UpdateResult last = updater.update(seen(BendingOrgan(2), 100));
    EXPECT_FALSE(last.beginning.at_last);
    double error = 0, from_beginning = 0;
    for (unsigned n = 1; n <= 6; ++n) {
        const BendingOrgan bent(2 + 0.7 * n);
        const Intraoperative now = seen(bent, n);
        last = updater.go_on(last, now);
        EXPECT_TRUE(last.beginning.at_last) << last.beginning.why;
        error += bent.mean_error_mm(last) / 6;
        from_beginning += bent.mean_error_mm(updater.update(now)) / 6;
    }
    EXPECT_LT(error, from_beginning + 0.02);
    EXPECT_LT(error, 3);
}

TEST_P(GoingOn, BeginsAnewWhereTissueHasJumped) {
    const Seen& seen = GetParam();
    const UpdateResult last = updater.update(seen(BendingOrgan(0), 1));
    Intraoperative far = seen(BendingOrgan(0), 2);
    const Vector3d shift(9, -5, 4);
    if (far.labels) far.labels->geometry.origin += shift;
    if (far.image) far.image->geometry.origin += shift;
    if (far.surface) far.surface->points.colwise() += shift;
    if (far.points) far.points->fixed.colwise() += shift;
    if (far.curves) far.curves->fixed.colwise() += shift;
    const UpdateResult now = updater.go_on(last, far), anew = updater.update(far);
    EXPECT_FALSE(now.beginning.at_last);
    EXPECT_THAT(now.beginning.why, HasSubstr(" mm"));
    EXPECT_EQ(now.deformation.displacement, anew.deformation.displacement);
    EXPECT_TRUE(now.deformation.placement.isApprox(anew.deformation.placement, 0));
}

TEST_P(GoingOn, KnowsTheFrameOfTheStart) {
    const Seen& seen = GetParam();
    const UpdateResult last = updater.update(seen(BendingOrgan(2), 1));
    Intraoperative started = seen(BendingOrgan(2.3), 2), plain = started;
    started.start = test::motion(4, {1, 2, 0}, {2, 1, -1});
    const UpdateResult from_start = updater.go_on(last, started), without = updater.go_on(last, plain);
    EXPECT_TRUE(from_start.beginning.at_last) << from_start.beginning.why;
    const Matrix3Xd a = from_start.deformation.deformed_nodes(), b = without.deformation.deformed_nodes();
    EXPECT_LT((a - b).colwise().norm().maxCoeff(), 0.5);  // labels are resampled on another grid
}

INSTANTIATE_TEST_SUITE_P(Data, GoingOn,
                         ::testing::Values(Seen(labels_of), Seen(surface_of), Seen(pairs_of), Seen(vessels_of),
                                           Seen(image_of)));

class GoOn : public ::testing::Test {
protected:
    Updater updater{organ(), on_cpu()};
};

TEST_F(GoOn, TheSameDataLeaveTheOrganWhereItIs) {
    const Intraoperative seen = surface_of(BendingOrgan(3), 1);
    const UpdateResult first = updater.update(seen), again = updater.go_on(first, seen);
    const Matrix3Xd a = first.deformation.deformed_nodes(), b = again.deformation.deformed_nodes();
    EXPECT_LT((a - b).colwise().norm().mean(), 0.1);
    EXPECT_LT(again.rounds.size(), first.rounds.size());
}

TEST_F(GoOn, TheSameLastOneGivesTheSameBits) {
    const Intraoperative seen = surface_of(BendingOrgan(3), 1), next = surface_of(BendingOrgan(3.5), 2);
    const UpdateResult first = updater.update(seen), one = updater.go_on(first, next);
    Updater other(organ(), on_cpu());
    const UpdateResult there = other.go_on(other.update(seen), next);
    EXPECT_EQ(one.deformation.displacement, there.deformation.displacement);
}

TEST_F(GoOn, OtherDataBeginAnew) {
    const UpdateResult last = updater.update(surface_of(BendingOrgan(2), 1));
    const UpdateResult now = updater.go_on(last, pairs_of(BendingOrgan(2), 1));
    EXPECT_FALSE(now.beginning.at_last);
    EXPECT_THAT(now.beginning.why, HasSubstr("other kinds of data"));
}

TEST_F(GoOn, ManyMorePointsBeginAnew) {
    const UpdateResult last = updater.update({.points = BendingOrgan(2).pairs(10, 1)});
    const UpdateResult few = updater.go_on(last, {.points = BendingOrgan(2).pairs(11, 1)});
    EXPECT_TRUE(few.beginning.at_last) << few.beginning.why;
    // Counted from the update that sought the placement, however slowly they come.
    const UpdateResult many = updater.go_on(few, {.points = BendingOrgan(2).pairs(13, 1)});
    EXPECT_FALSE(many.beginning.at_last);
    EXPECT_THAT(many.beginning.why, HasSubstr("more is seen"));
}

TEST_F(GoOn, ThePlacementIsSoughtAgainAfterManyUpdates) {
    UpdateResult last = updater.update(pairs_of(BendingOrgan(2), 1));
    int in_a_row = 0;
    do last = updater.go_on(last, pairs_of(BendingOrgan(2), 1));
    while (last.beginning.at_last && ++in_a_row < 1000);
    EXPECT_EQ(in_a_row, detail::go_on_limits.most_in_a_row);
}

TEST_F(GoOn, AResultOfAnotherModelIsRefused) {
    PrepareOptions options;
    options.meshing.edge_length = 12;
    Updater other(prepare(shapes::organ_labels({}), options), on_cpu());
    const UpdateResult last = other.update(pairs_of(BendingOrgan(2), 1));
    EXPECT_THROW((void)updater.go_on(last, pairs_of(BendingOrgan(2), 1)), InvalidInput);
    EXPECT_THROW((void)updater.go_on({}, pairs_of(BendingOrgan(2), 1)), InvalidInput);
}

UpdateResult result_at(double x_mm, double residual_mm) {
    UpdateResult result;
    result.deformation = test::deformed_by(test::box_at({0, 0, 0}, {10, 10, 10}, {1, 1, 1}),
                                           [&](const Vector3d&) { return Vector3d(x_mm, 0, 0); });
    result.rounds.push_back({.mean_residual_mm = residual_mm});
    detail::CarriedOn carried;
    carried.nodes = result.deformation.mesh.nodes;
    result.carried_on = std::make_shared<const detail::CarriedOn>(carried);
    return result;
}

TEST(WhyBeginAnew, SaysWhatDoesNotAgree) {
    const UpdateResult last = result_at(0, 0.5);
    EXPECT_EQ(detail::why_begin_anew(last, result_at(3.9, 0.7)), std::nullopt);
    EXPECT_THAT(detail::why_begin_anew(last, result_at(4.1, 0.5)).value(), HasSubstr("moved by 4.10 mm"));
    EXPECT_THAT(detail::why_begin_anew(result_at(14, 0.5), result_at(15.5, 0.5)).value(),
                HasSubstr("since the placement"));
    EXPECT_THAT(detail::why_begin_anew(last, result_at(0, 0.74)).value(), HasSubstr("0.74 mm instead of 0.50"));
}

TEST(WhyBeginAnew, OnlyNewDoubtsCount) {
    UpdateResult last = result_at(0, 0.5), now = result_at(0, 0.5);
    now.doubts.push_back({"surface.outliers", 0.4, 0.5});
    EXPECT_THAT(detail::why_begin_anew(last, now).value(), HasSubstr("surface.outliers"));
    last.doubts.push_back({"surface.outliers", 0.4, 0.5, "", "", Severity::Notice});
    EXPECT_TRUE(detail::why_begin_anew(last, now));
    last.doubts.push_back({"surface.outliers", 0.4, 0.5});
    EXPECT_FALSE(detail::why_begin_anew(last, now));
    now.doubts.front().severity = Severity::Notice;
    EXPECT_FALSE(detail::why_begin_anew(result_at(0, 0.5), now));
}

}  // namespace
}  // namespace tissuewarp::registration
