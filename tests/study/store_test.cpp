/// Points in files: what is written comes back, what is damaged or foreign is refused.
#include "study/store.hpp"

#include "core/errors.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace tissuewarp::study {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

class StoreTest : public testing::Test {
protected:
    const fs::path folder =
        fs::path(testing::TempDir()) /
        (std::string("study-store-") + testing::UnitTest::GetInstance()->current_test_info()->name());
    const Provenance machine{{"processor", "two cores"}};
    void SetUp() override {
        fs::remove_all(folder);
        fs::create_directories(folder);
    }
    void TearDown() override { fs::remove_all(folder); }

    static Point full_point() {
        Point point;
        point.problem = "phantom:7";
        point.setting.elements = 12345;
        point.setting.element = tled::Element::T4;
        point.setting.physics = {Law::Ogden, 0.4, Hold::Soft};
        point.setting.solver = Solver::DynamicRelaxation;
        point.setting.tolerance_mm = 0.003;
        point.setting.arithmetic = tled::Scalar::Float64;
        point.setting.processor = tled::Processor::Gpu;
        point.elements = 12000;
        point.nodes = 3000;
        point.engine = "CPU float32, AVX-512, 2 threads";
        point.method = "say \"so\"";
        point.stages = {{"mesh", Phase::Preparation, {2.5}}, {"equilibrium", Phase::Operation, {0.5, 0.25}}};
        point.seconds = {0.75, 0.5};
        point.force_evaluations = 99;
        point.min_jacobian = 0.5;
        point.estimated_mm = 0.002;
        point.algebraic_mm = 0.0;  // a zero is not an absence
        point.target = TargetErrors{1, 0.9, 2, 3, 8};
        point.places = Eigen::Matrix3Xd::Random(3, 4);
        return point;
    }
    static Point failed_point() {
        Point point;
        point.problem = "cube";
        point.failure = "no admissible start";
        return point;
    }
};

TEST_F(StoreTest, EverythingComesBack) {
    const std::vector<Point> points{full_point(), failed_point()};
    write_measurements({{}, points, machine}, folder / "results.h5");
    const Measurements measured = read_measurements(folder / "results.h5");
    const std::vector<Point>& read = measured.points;
    ASSERT_EQ(read.size(), 2u);
    EXPECT_EQ(measured.provenance, machine);
    const Point &a = points[0], &b = read[0];
    EXPECT_EQ(a.problem, b.problem);
    EXPECT_EQ(a.setting, b.setting);
    EXPECT_EQ(a.elements, b.elements);
    EXPECT_EQ(a.engine, b.engine);
    EXPECT_EQ(a.method, b.method);
    EXPECT_EQ(a.seconds, b.seconds);
    ASSERT_EQ(b.stages.size(), 2u);
    EXPECT_EQ(b.stages[0].phase, Phase::Preparation);
    EXPECT_EQ(b.stages[1].seconds, a.stages[1].seconds);
    EXPECT_EQ(b.algebraic_mm, 0.0);
    EXPECT_FALSE(b.numerical || b.model || b.reference_mm);
    ASSERT_TRUE(b.target.has_value());
    EXPECT_EQ(b.target->percentile_95, 2);
    EXPECT_EQ(b.target->before, 8);
    EXPECT_EQ(a.places, b.places);
    EXPECT_EQ(read[1].failure, "no admissible start");
    EXPECT_TRUE(read[1].seconds.empty());
    EXPECT_EQ(read[1].places.cols(), 0);
}

// An interrupted study goes on: what is there is known again, nothing else is.
TEST_F(StoreTest, KnowsWhatItHolds) {
    {
        Store store(folder, machine);
        store.add(full_point());
        store.add(failed_point());
    }
    const Store again(folder, machine);
    EXPECT_EQ(again.points().size(), 2u);
    EXPECT_TRUE(again.holds("phantom:7", full_point().setting));
    EXPECT_TRUE(again.holds("cube", {}));
    EXPECT_FALSE(again.holds("cube", full_point().setting));
    EXPECT_FALSE(again.holds("phantom:8", full_point().setting));
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 2);  // no temporary files
}

// The page shows problems of earlier runs beside those of the last one.
TEST_F(StoreTest, RemembersProblemsWhoseBaseWasMeasured) {
    const ProblemSummary phantom{"phantom:7", "a blob", full_point().setting, true};
    {
        Store store(folder, machine);
        store.describe({"phantom:7", "an older story", {}, false});
        store.describe(phantom);
        store.describe({"brain", "not measured yet", {}, false});
        store.add(full_point());
    }
    const Store again(folder, machine);
    ASSERT_EQ(again.problems().size(), 1u);
    EXPECT_EQ(again.problems()[0].name, phantom.name);
    EXPECT_EQ(again.problems()[0].story, phantom.story);
    EXPECT_EQ(again.problems()[0].base, phantom.base);
    EXPECT_TRUE(again.problems()[0].registration);
}

TEST_F(StoreTest, TableHasAFieldForEveryName) {
    Store store(folder, machine);
    store.add(full_point());
    store.add(failed_point());
    const auto fields = [](const std::string& line) {
        bool inside = false;
        int count = 1;
        for (const char c : line) {
            if (c == '"') inside = !inside;
            if (c == ',' && !inside) ++count;
        }
        return count;
    };
    std::ifstream file(folder / "results.csv");
    std::string head, line;
    std::getline(file, head);
    int lines = 0;
    for (; std::getline(file, line); ++lines) EXPECT_EQ(fields(line), fields(head)) << line;
    EXPECT_EQ(lines, 2);
}

TEST_F(StoreTest, RefusesTimesOfAnotherMachine) {
    Store(folder, machine).add(full_point());
    EXPECT_THAT(
        [&] {
            Store(folder, {{"processor", "four cores"}});
        },
        ThrowsMessage<InvalidInput>(
            testing::AllOf(HasSubstr("two cores"), HasSubstr("four cores"), HasSubstr("--output"))));
}

TEST_F(StoreTest, RefusesWhatIsNoStudy) {
    std::ofstream(folder / "results.h5") << "nonsense";
    EXPECT_THROW(Store(folder, machine), Error);
}

}  // namespace
}  // namespace tissuewarp::study
