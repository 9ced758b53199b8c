#include "server/messages.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::server {

namespace {

using Eigen::Vector3d;

/// LPS to RAS and back.
Vector3d turned(const Vector3d& place) {
    return {-place.x(), -place.y(), place.z()};
}

Vector3d read_place(Reader& reader) {
    const double x = reader.f32(), y = reader.f32(), z = reader.f32();
    return turned({x, y, z});
}

void write_place(Writer& writer, const Vector3d& place) {
    const Vector3d ras = turned(place);
    for (int axis = 0; axis < 3; ++axis) writer.f32(ras[axis]);
}

void require_finite(const Vector3d& place, const char* what) {
    constexpr double most_mm = 1e5;
    if (!place.allFinite() || place.cwiseAbs().maxCoeff() > most_mm)
        throw InvalidInput(std::string(what) + " lies nowhere: its coordinates are no numbers of mm");
}

/// Columns of rotation, then the translation.
Eigen::Isometry3d read_transform(ByteView content) {
    if (content.size() != 48) throw BadMessage("a transform has 48 bytes");
    Reader reader(content);
    Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
    for (int column = 0; column < 3; ++column) {
        Vector3d axis = read_place(reader);
        if (column < 2) axis = -axis;  // F R F: the columns of x and y change their sign too
        transform.linear().col(column) = axis;
    }
    transform.translation() = read_place(reader);
    require_finite(transform.translation(), "the transform");
    constexpr double rounding = 1e-3;
    const Eigen::Matrix3d r = transform.linear();
    if (!r.allFinite() || !(r.transpose() * r).isIdentity(rounding) || r.determinant() < 0)
        throw InvalidInput("the transform is not rigid; send rotation and translation");
    transform.linear() = Eigen::Quaterniond(r).normalized().toRotationMatrix();
    return transform;
}

NamedPoints read_points(ByteView content) {
    constexpr std::size_t bytes_of_one = 136;
    if (content.size() % bytes_of_one != 0) throw BadMessage("points have 136 bytes each");
    Reader reader(content);
    NamedPoints points;
    while (reader.left() > 0) {
        NamedPoint& point = points.emplace_back();
        point.name = reader.text(64);
        point.group = reader.text(32);
        reader.take(4);  // colour
        point.position = read_place(reader);
        reader.take(24);  // radius, owner
        require_finite(point.position, "a point");
    }
    return points;
}

Text read_text(ByteView content) {
    Reader reader(content);
    reader.u16();  // encoding: US-ASCII or UTF-8
    const std::size_t length = reader.u16();
    if (length > reader.left()) throw BadMessage("a text is shorter than it says");
    const ByteView text = reader.take(length);
    return {{text.begin(), text.end()}};
}

Status read_status(ByteView content) {
    Reader reader(content);
    Status status;
    status.code = reader.u16();
    reader.u64();  // sub-code
    status.name = reader.text(20);
    status.text = reader.text(reader.left());
    return status;
}

}  // namespace

// messages_mesh.cpp and messages_image.cpp
PolyData read_mesh(ByteView content);
imaging::Volume read_image(ByteView content);

Message decode(const Frame& frame) {
    const ByteView content = content_of(frame.header, frame.body);
    const std::string& type = frame.header.type;
    if (type == "TRANSFORM") return read_transform(content);
    if (type == "POINT") return read_points(content);
    if (type == "POLYDATA") return read_mesh(content);
    if (type == "IMAGE") return read_image(content);
    if (type == "STRING") return read_text(content);
    if (type == "STATUS") return read_status(content);
    return Other{};
}

const char* type_of(const Message& message) {
    static constexpr const char* names[] = {"", "STRING", "STATUS", "TRANSFORM", "POINT", "POLYDATA", "IMAGE"};
    return names[message.index()];
}

Bytes encode(const Text& text) {
    const std::string_view cut = std::string_view(text.text).substr(0, 65535);
    Writer writer;
    writer.u16(3);  // US-ASCII, of which UTF-8 is the continuation that clients show
    writer.u16(static_cast<std::uint16_t>(cut.size()));
    writer.text(cut, cut.size());
    return std::move(writer.bytes());
}

Bytes encode(const Status& status) {
    Writer writer;
    writer.u16(static_cast<std::uint16_t>(status.code));
    writer.u64(0);
    writer.text(status.name, 20);
    writer.text(status.text, status.text.size() + 1);
    return std::move(writer.bytes());
}

Bytes encode(const Eigen::Isometry3d& transform) {
    Writer writer;
    for (int column = 0; column < 3; ++column)
        write_place(writer, (column < 2 ? -1.0 : 1.0) * transform.linear().col(column));
    write_place(writer, transform.translation());
    return std::move(writer.bytes());
}

Bytes encode(const NamedPoints& points) {
    Writer writer;
    for (const NamedPoint& point : points) {
        writer.text(point.name, 63);
        writer.u8(0);
        writer.text(point.group, 31);
        writer.u8(0);
        for (const std::uint8_t channel : {255, 255, 0, 255}) writer.u8(channel);
        write_place(writer, point.position);
        writer.f32(0);
        writer.text("", 20);
    }
    return std::move(writer.bytes());
}

}  // namespace tissuewarp::server
