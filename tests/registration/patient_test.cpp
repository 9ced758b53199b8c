/// Patients as files: the image as it was given, and the model that read_prepared reads too.
#include "registration/prepared/patient_io.hpp"
#include "registration/prepared/prepared_io.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

namespace tissuewarp::registration {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

PreparedModel box() {
    imaging::Volume labels(test::plain_grid({30, 30, 30}, 1.0, {-5, -5, -5}), CV_32SC1);
    for (int k = 5; k < 25; ++k)
        for (int j = 5; j < 25; ++j)
            for (int i = 5; i < 25; ++i) labels.data<int>()[labels.offset(i, j, k)] = 1;
    return prepare(test::box_at({0, 0, 0}, {20, 20, 20}, {2, 2, 2}), labels);
}

TEST(Patient, ImagesOfEveryTypeComeBack) {
    const tissuewarp::test::TemporaryFolder folder;
    const PreparedModel model = box();
    for (const int type : {CV_8UC1, CV_8SC1, CV_16UC1, CV_16SC1, CV_32SC1, CV_32FC1, CV_64FC1}) {
        imaging::Volume image(test::oblique_grid({1, 2, 3}, {5, 4, 3}, {1, 2, 3}), type);
        cv::randu(image.voxels.reshape(1, 1), -100, 100);
        write_patient(model, image, "facts", folder / "a.tw");
        const Patient back = read_patient(folder / "a.tw");
        ASSERT_EQ(back.image.voxels.type(), type);
        EXPECT_EQ(
            std::memcmp(back.image.voxels.data, image.voxels.data, image.voxels.total() * image.voxels.elemSize()), 0);
        EXPECT_EQ(imaging::grid_distance(back.image.geometry, image.geometry), 0);
        EXPECT_EQ(back.facts, "facts");
        EXPECT_EQ(back.prepared.model.mesh.nodes, model.model.mesh.nodes);
    }
}

TEST(Patient, WithoutAnImage) {
    const tissuewarp::test::TemporaryFolder folder;
    write_patient(box(), {}, "", folder / "a.tw");
    EXPECT_TRUE(read_patient(folder / "a.tw").image.empty());
    EXPECT_EQ(read_prepared(folder / "a.tw").model.mesh.node_count(), 27);
}

TEST(Patient, AModelAloneIsNone) {
    const tissuewarp::test::TemporaryFolder folder;
    write_prepared(box(), folder / "a.tw");
    EXPECT_THAT([&] { read_patient(folder / "a.tw"); }, ThrowsMessage<InvalidInput>(HasSubstr("model alone")));
}

TEST(Patient, VectorsAreNoImageOfOne) {
    const tissuewarp::test::TemporaryFolder folder;
    const imaging::Volume vectors(test::plain_grid({2, 2, 2}), CV_32FC3);
    EXPECT_THROW(write_patient(box(), vectors, "", folder / "a.tw"), InvalidInput);
    EXPECT_TRUE(folder.is_empty());
}

}  // namespace
}  // namespace tissuewarp::registration
