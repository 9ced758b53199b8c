#pragma once
/// What messages of OpenIGTLink say, in LPS mm: this file's functions are the one border to the wire, where everything
/// is RAS (images too, whose coordinate byte 3D Slicer passes over).

#include "imaging/volume.hpp"
#include "server/wire.hpp"

#include <Eigen/Geometry>

#include <string>
#include <variant>
#include <vector>

namespace tissuewarp::server {

struct NamedPoint {
    std::string name, group;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< LPS mm
};
using NamedPoints = std::vector<NamedPoint>;

/// A value at every point.
struct PointArray {
    std::string name;
    Eigen::RowVectorXd values;
};

struct PolyData {
    Eigen::Matrix3Xd points;               ///< 3 × P, LPS mm
    Eigen::Matrix3Xd normals;              ///< 3 × P, or 3 × 0
    std::vector<std::vector<int>> lines;   ///< points along each
    Eigen::Matrix3Xi triangles;            ///< 3 × T; polygons of other sizes are passed over
    std::vector<PointArray> point_arrays;  ///< only written
};

struct Text {
    std::string text;
};

/// What a device says of itself.
struct Status {
    int code = 1;      ///< 1: OK, 2: error, 6: busy, 12: not understood, …
    std::string name;  ///< of the error; at most 20 bytes
    std::string text;
};

/// Of types that the server does not know.
struct Other {};

using Message = std::variant<Other, Text, Status, Eigen::Isometry3d, NamedPoints, PolyData, imaging::Volume>;

/// Throws BadMessage where the body contradicts itself, InvalidInput where it is well formed and says what cannot be
/// used: places that are no numbers, a transform that is not rigid, a part of an image.
Message decode(const Frame& frame);

/// Bodies of messages.
Bytes encode(const Text& text);
Bytes encode(const Status& status);
Bytes encode(const Eigen::Isometry3d& transform);
Bytes encode(const NamedPoints& points);
Bytes encode(const PolyData& mesh);
/// One component of any depth, or three of float32: vectors in LPS, sent in RAS. Throws InvalidInput for a grid that
/// the message cannot hold: more than 65535 voxels along an axis.
Bytes encode(const imaging::Volume& image);

/// "POINT", …: of what `encode` made of it.
const char* type_of(const Message& message);

}  // namespace tissuewarp::server
