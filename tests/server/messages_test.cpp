/// Messages there and back, and the one border between LPS and RAS.
#include "server/messages.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

namespace tissuewarp::server {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

template <class T>
T there_and_back(const char* type, const T& sent) {
    Bytes body = encode(sent);
    return std::get<T>(decode({{1, type, "", 0, body.size(), 0}, std::move(body)}));
}

Message decoded(const char* type, Bytes body) {
    return decode({{1, type, "", 0, body.size(), 0}, std::move(body)});
}

/// The big-endian float at this place.
float float_at(const Bytes& bytes, std::size_t at) {
    return Reader(ByteView(bytes).subspan(at)).f32();
}

TEST(Messages, PointsAreRasOnTheWire) {
    const Bytes body = encode(NamedPoints{{"vein", "", {1, 2, 3}}});
    ASSERT_EQ(body.size(), 136u);
    EXPECT_EQ(float_at(body, 100), -1);
    EXPECT_EQ(float_at(body, 104), -2);
    EXPECT_EQ(float_at(body, 108), 3);
    const NamedPoints back = there_and_back("POINT", NamedPoints{{"vein", "a group", {1, 2, 3}}});
    EXPECT_EQ(back[0].name, "vein");
    EXPECT_EQ(back[0].group, "a group");
    EXPECT_EQ(back[0].position, Eigen::Vector3d(1, 2, 3));
}

/// A point moved by the transform in RAS is the one moved by ours in LPS.
TEST(Messages, TransformsAreRasOnTheWire) {
    Eigen::Isometry3d lps = Eigen::Isometry3d::Identity();
    lps.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
    lps.translation() = Eigen::Vector3d(10, 20, -5);
    const Bytes body = encode(lps);
    Eigen::Matrix<double, 3, 4> ras;
    for (int k = 0; k < 12; ++k) ras(k % 3, k / 3) = float_at(body, 4 * static_cast<std::size_t>(k));
    const Eigen::Vector3d point(3, -4, 7), turn(-1, -1, 1);
    const Eigen::Vector3d moved = ras.leftCols(3) * turn.cwiseProduct(point) + ras.col(3);
    EXPECT_LT((turn.cwiseProduct(moved) - lps * point).norm(), 1e-5);
    EXPECT_TRUE(there_and_back("TRANSFORM", lps).isApprox(lps, 1e-6));
}

TEST(Messages, ATransformThatIsNotRigidIsRefused) {
    Eigen::Isometry3d scaled = Eigen::Isometry3d::Identity();
    scaled.linear() *= 1.1;
    EXPECT_THAT([&] { there_and_back("TRANSFORM", scaled); }, ThrowsMessage<InvalidInput>(HasSubstr("not rigid")));
}

TEST(Messages, MeshesWithArrays) {
    PolyData mesh;
    mesh.points = Eigen::Matrix3Xd::Random(3, 5).cast<float>().cast<double>();
    mesh.normals = mesh.points.colwise().normalized();
    mesh.lines = {{0, 1, 2}, {3, 4}};
    mesh.triangles = (Eigen::Matrix3Xi(3, 2) << 0, 1, 1, 2, 2, 3).finished();
    mesh.point_arrays = {{"abc", Eigen::RowVectorXd::LinSpaced(5, 0, 1)}, {"de", Eigen::RowVectorXd::Zero(5)}};
    const PolyData back = there_and_back("POLYDATA", mesh);
    EXPECT_EQ(back.points, mesh.points);
    EXPECT_LT((back.normals - mesh.normals).norm(), 1e-6);
    EXPECT_EQ(back.lines, mesh.lines);
    EXPECT_EQ(back.triangles, mesh.triangles);
    EXPECT_EQ(float_at(encode(mesh), 40), -float(mesh.points(0, 0)));
}

imaging::Volume image(int type) {
    imaging::Geometry grid;
    grid.size = {4, 3, 2};
    grid.spacing = {1, 2, 3};
    grid.origin = {-10, 20, 30};
    grid.direction.col(0) = Eigen::Vector3d(0, 1, 0);
    grid.direction.col(1) = Eigen::Vector3d(1, 0, 0);
    imaging::Volume volume(grid, type);
    for (std::size_t n = 0; n < volume.voxels.total() * volume.voxels.elemSize1(); ++n)
        volume.voxels.data[n] = static_cast<unsigned char>(n % 50);
    return volume;
}

TEST(Messages, ImagesArePlacedByTheirMiddle) {
    const Bytes body = encode(image(CV_16SC1));
    // Middle: index (1.5, 1, 0.5), LPS (-10 + 2, 20 + 1.5, 30 + 1.5).
    EXPECT_EQ(float_at(body, 12 + 36), 8);
    EXPECT_EQ(float_at(body, 12 + 40), -21.5);
    EXPECT_EQ(float_at(body, 12 + 44), 31.5);
    EXPECT_EQ(float_at(body, 12), 0);  // i runs along y: (0, -1, 0) in RAS
    EXPECT_EQ(float_at(body, 16), -1);
    EXPECT_EQ(body[5], 1);  // RAS
}

TEST(Messages, ImagesOfEveryType) {
    for (const int type : {CV_8UC1, CV_8SC1, CV_16UC1, CV_16SC1, CV_32SC1}) {
        const imaging::Volume sent = image(type), back = there_and_back("IMAGE", sent);
        EXPECT_TRUE(imaging::same_grid(sent.geometry, back.geometry, 1e-5));
        ASSERT_EQ(back.voxels.type(), type);
        EXPECT_EQ(std::memcmp(sent.voxels.data, back.voxels.data, sent.voxels.total() * sent.voxels.elemSize()), 0);
    }
}

TEST(Messages, BigEndianVoxelsAreTurned) {
    Bytes body = encode(image(CV_16SC1));
    body[4] = 1;
    const auto back = std::get<imaging::Volume>(decoded("IMAGE", body));
    EXPECT_EQ(back.data<std::int16_t>()[0], 0x0001);  // bytes 0, 1
}

TEST(Messages, VectorsOfAFieldAreRas) {
    imaging::Volume field(image(CV_8UC1).geometry, CV_32FC3);
    field.data<cv::Vec3f>()[0] = {1, 2, 3};
    const Bytes body = encode(field);
    float first[3];
    std::memcpy(first, body.data() + 72, sizeof first);
    EXPECT_EQ(first[0], -1);
    EXPECT_EQ(first[1], -2);
    EXPECT_EQ(first[2], 3);
    EXPECT_EQ(body[2], 3);
}

TEST(Messages, TextsAndStatus) {
    EXPECT_EQ(there_and_back("STRING", Text{"a text"}).text, "a text");
    const Status status = there_and_back("STATUS", Status{2, "doubted", "why"});
    EXPECT_EQ(status.code, 2);
    EXPECT_EQ(status.name, "doubted");
    EXPECT_EQ(status.text, "why");
}

TEST(Messages, BodiesThatContradictThemselves) {
    Bytes cut = encode(image(CV_16SC1));
    cut.pop_back();
    EXPECT_THROW(decoded("IMAGE", cut), BadMessage);
    EXPECT_THROW(decoded("POINT", Bytes(137)), BadMessage);
    EXPECT_THROW(decoded("STRING", {0, 3, 0, 9, 'x'}), BadMessage);
    EXPECT_THROW(decoded("POLYDATA", Bytes(20)), BadMessage);
    PolyData mesh;
    mesh.points = Eigen::Matrix3Xd::Zero(3, 2);
    mesh.lines = {{0, 1}};
    Bytes body = encode(mesh);
    body[body.size() - 1] = 2;  // of two points
    EXPECT_THAT([&] { decoded("POLYDATA", body); }, ThrowsMessage<BadMessage>(HasSubstr("names point 2 of 2")));
    body[body.size() - 9] = 200;  // points of the cell
    EXPECT_THROW(decoded("POLYDATA", body), BadMessage);
    body = encode(mesh);
    body[0] = 0xff;  // points
    EXPECT_THROW(decoded("POLYDATA", body), BadMessage);
}

TEST(Messages, PlacesThatAreNoNumbersAreRefused) {
    EXPECT_THAT(
        [&] {
            there_and_back("POINT", NamedPoints{{"", "", {NAN, 0, 0}}});
        },
        ThrowsMessage<InvalidInput>(HasSubstr("no numbers")));
    PolyData mesh;
    mesh.points = Eigen::Matrix3Xd::Constant(3, 1, INFINITY);
    EXPECT_THROW(there_and_back("POLYDATA", mesh), InvalidInput);
    imaging::Volume field(image(CV_8UC1).geometry, CV_32FC1);
    field.data<float>()[3] = NAN;
    EXPECT_THROW(there_and_back("IMAGE", field), InvalidInput);
}

TEST(Messages, PartsOfImagesAreRefused) {
    Bytes body = encode(image(CV_8UC1));
    body[61] = 1;  // an offset
    EXPECT_THAT([&] { decoded("IMAGE", body); }, ThrowsMessage<InvalidInput>(HasSubstr("in parts")));
}

}  // namespace
}  // namespace tissuewarp::server
