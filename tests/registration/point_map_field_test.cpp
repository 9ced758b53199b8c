// Maps of points as fields: composition, linear parts and inverses against closed forms; and their files.
#include "registration/io/point_map_field.hpp"
#include "registration/io/transform_file.hpp"

#include "core/errors.hpp"
#include "shapes.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <cmath>
#include <csignal>

namespace tissuewarp::registration {
namespace {

using Eigen::Affine3d;
using Eigen::Vector3d;
using imaging::Geometry;
using imaging::Volume;
using testing::HasSubstr;

constexpr double micrometre = 1e-3;

Geometry oblique_grid(int size = 24) {
    Geometry grid;
    grid.size = {size, size - 3, size - 5};
    grid.origin = {10, -20, 30};
    grid.spacing = {1.0, 1.5, 2.0};
    grid.direction = Eigen::AngleAxisd(0.3, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    return grid;
}

Affine3d some_affine() {
    Affine3d map = Affine3d::Identity();
    map.rotate(Eigen::AngleAxisd(0.4, Vector3d(3, -1, 2).normalized()));
    map.linear()(0, 1) += 0.1;
    map.pretranslate(Vector3d(40, -5, 12));
    return map;
}

template <class Vector>
Volume field_of(const Geometry& grid, const Vector& vector_at) {
    Volume field(grid, CV_32FC3);
    test::for_each_voxel(field, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d v = vector_at(grid.point(index));
        for (int c = 0; c < 3; ++c) field.data<cv::Vec3f>()[n][c] = static_cast<float>(v[c]);
    });
    return field;
}

Vector3d wave(const Vector3d& p) {
    return {2 * std::sin(p[1] / 9), 1.5 * std::cos(p[2] / 8), std::sin(p[0] / 7)};
}

std::string message_of(const auto& call) {
    try {
        call();
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

/// A third of the way from voxel to voxel, within the grid.
std::vector<Vector3d> places_in(const Geometry& grid) {
    std::vector<Vector3d> places;
    for (int k = 2; k < grid.size[2] - 2; k += 3)
        for (int j = 2; j < grid.size[1] - 2; j += 3)
            for (int i = 2; i < grid.size[0] - 2; i += 3) places.push_back(grid.point(Vector3d(i + 0.3, j + 0.6, k)));
    return places;
}

TEST(PointMapField, ALinearPartTakenOutLeavesTheMap) {
    const Geometry grid = oblique_grid();
    PointMap total;
    total.field = field_of(grid, wave);
    const PointMap parted = with_linear_part(*total.field, some_affine());
    const MappedPoint a(total), b(parted);
    for (const Vector3d& place : places_in(grid)) EXPECT_NEAR((a(place) - b(place)).norm(), 0, micrometre);
    const Vector3d outside = grid.point({-5, 3, 3});
    EXPECT_NEAR((b(outside) - some_affine() * outside).norm(), 0, 1e-9);
}

TEST(PointMapField, AFieldOnItsOwnGridIsTheMap) {
    PointMap map = with_linear_part(field_of(oblique_grid(), wave), some_affine());
    map.before = Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(-0.7, Vector3d::UnitY());
    const auto grid = own_grid(map);
    ASSERT_TRUE(grid.has_value());
    PointMap as_field;
    as_field.field = displacement_on(map, *grid);
    const MappedPoint a(map), b(as_field);
    for (const Vector3d& place : places_in(*grid)) EXPECT_NEAR((a(place) - b(place)).norm(), 0, micrometre);
    map.before.linear()(0, 0) *= 1.1;
    EXPECT_FALSE(own_grid(map).has_value());
    EXPECT_FALSE(own_grid(PointMap{}).has_value());
}

TEST(PointMapField, InversesUndoTheMap) {
    const Geometry grid = oblique_grid();
    PointMap map;
    map.field = field_of(grid, wave);
    map.after = some_affine();
    Geometry target = grid;  // where the map leads to
    target.origin = some_affine() * grid.origin;
    target.direction = Eigen::AngleAxisd(0.4, Vector3d(3, -1, 2).normalized()).toRotationMatrix() * grid.direction;
    const PointMap inverse = inverse_on(map, target);
    const MappedPoint forward(map), backward(inverse);
    int inside = 0;
    test::for_each_voxel(*inverse.field, [&](const Vector3d& index, std::int64_t) {
        const Vector3d x = target.point(index), y = backward(x);
        const Vector3d voxel = grid.index(y);
        if ((voxel.array() < 0).any() || voxel[0] > grid.size[0] - 1 || voxel[1] > grid.size[1] - 1 ||
            voxel[2] > grid.size[2] - 1)
            return;
        ++inside;
        EXPECT_NEAR((forward(y) - x).norm(), 0, 2 * micrometre);
    });
    EXPECT_GT(inside, 4000);
    const PointMap linear{some_affine(), {}, some_affine()};
    const MappedPoint there(linear), back(inverse_of_linear(linear));
    EXPECT_NEAR((back(there(Vector3d(1, 2, 3))) - Vector3d(1, 2, 3)).norm(), 0, 1e-9);
}

TEST(PointMapField, FoldsAndFlatMapsHaveNoInverse) {
    const Geometry grid = oblique_grid();
    PointMap folded;
    folded.field = field_of(grid, [](const Vector3d& p) { return Vector3d(8 * std::sin(p[0]), 0, 0); });
    EXPECT_THAT(message_of([&] { inverse_on(folded, grid); }), HasSubstr("cannot be inverted at"));
    PointMap flat;
    flat.after.linear()(2, 2) = 0;
    EXPECT_THAT(message_of([&] { inverse_of_linear(flat); }), HasSubstr("singular"));
    EXPECT_THAT(message_of([&] { inverse_of_linear(folded); }), HasSubstr("needs a grid"));
}

TEST(PointMapField, TheNearestLinearMapIsFoundAndItsDistanceSaid) {
    const Affine3d affine = some_affine();
    PointMap map;
    map.field = field_of(oblique_grid(), [&](const Vector3d& p) { return Vector3d(affine * p - p); });
    map.after = Eigen::Translation3d(1, 0, 0) * map.after;
    const NearestLinear found = nearest_linear(map);
    EXPECT_LT(found.furthest_mm, micrometre);
    EXPECT_TRUE(found.map.isApprox(Eigen::Translation3d(1, 0, 0) * affine, 1e-5));
    map.field = field_of(oblique_grid(), wave);
    EXPECT_GT(nearest_linear(map).furthest_mm, 0.5);
}

TEST(TransformFile, WhatIsWrittenIsReadBack) {
    const tissuewarp::test::TemporaryFolder folder;
    for (const int size : {20, 60}) {  // one piece, and some of which the last is not full
        const Geometry grid = oblique_grid(size);
        const Volume total = field_of(grid, wave);
        PointMap map = with_linear_part(total, some_affine());
        write_itk_transform(total, some_affine(), folder / "a.h5");
        const MappedPoint written(map), read(read_point_map(folder / "a.h5"));
        map.before = Eigen::Translation3d(0.5, 0.25, -0.125);
        write_itk_transform(map, folder / "b.h5");
        const MappedPoint written_after(map), read_after(read_point_map(folder / "b.h5"));
        for (const Vector3d& place : places_in(grid)) {
            EXPECT_NEAR((written(place) - read(place)).norm(), 0, 2 * micrometre);  // of steps of 1/512 mm
            EXPECT_NEAR((written_after(place) - read_after(place)).norm(), 0, 2 * micrometre);
        }
    }
    const PointMap linear{some_affine(), {}, some_affine()};
    write_itk_transform(linear, folder / "b.h5");
    write_itk_transform(linear, folder / "b.tfm");
    write_matrix(linear.after * linear.before, folder / "b.txt");
    for (const char* name : {"b.h5", "b.tfm", "b.txt"}) {
        const PointMap again = read_point_map(folder / name);
        EXPECT_TRUE((again.after * again.before).isApprox(linear.after * linear.before, 1e-14)) << name;
    }
}

TEST(TransformFile, WhatAFileCannotHoldIsRefusedAndLeavesNothing) {
    const tissuewarp::test::TemporaryFolder folder;
    const PointMap field = with_linear_part(field_of(oblique_grid(), wave), some_affine());
    EXPECT_THAT(message_of([&] { write_itk_transform(field, folder / "a.tfm"); }), HasSubstr("use .h5"));
    EXPECT_THAT(message_of([&] { write_itk_transform(field, folder / "a.xfm"); }), HasSubstr("names no transform"));
    EXPECT_THROW(write_itk_transform(field, folder / "none" / "a.h5"), IoError);
    EXPECT_TRUE(folder.is_empty());
}

TEST(TransformFile, ALimitOnFilesIsToldAndLeavesNothing) {
    const tissuewarp::test::TemporaryFolder folder;
    const PointMap map = with_linear_part(field_of(oblique_grid(60), wave), some_affine());
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    rlimit small = before;
    small.rlim_cur = 1 << 16;
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    const std::string message = message_of([&] { write_itk_transform(map, folder / "a.h5"); });
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
    EXPECT_THAT(message, HasSubstr("MiB while it is written"));
    EXPECT_TRUE(folder.is_empty());
    write_itk_transform(map, folder / "a.h5");
    EXPECT_FALSE(folder.is_empty());
}

}  // namespace
}  // namespace tissuewarp::registration
