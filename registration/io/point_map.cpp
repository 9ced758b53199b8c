#include "registration/io/point_map.hpp"

#include "core/file_message.hpp"
#include "imaging/image_io.hpp"
#include "registration/io/displacements.hpp"
#include "registration/io/itk_transform.hpp"

#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

namespace tissuewarp::registration {

namespace {

using detail::ItkTransform;

std::string bytes_of(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    std::string bytes(std::istreambuf_iterator<char>(stream), {});
    if (!stream.good() && !stream.eof()) throw IoError("'" + path.string() + "' cannot be read");
    return bytes;
}

std::vector<double> numbers(std::string text, const std::filesystem::path& path) {
    for (char& c : text)
        if (c == ',' || c == ';' || c == '[' || c == ']') c = ' ';
    std::istringstream stream(text);
    std::vector<double> result;
    std::string word;
    while (stream >> word) {
        std::size_t end = 0;
        double value = 0;
        try {
            value = std::stod(word, &end);
        } catch (const std::exception&) {
        }
        if (end != word.size() || !std::isfinite(value))
            throw InvalidInput("'" + path.string() + "' has '" + word.substr(0, 40) + "' where a number belongs");
        result.push_back(value);
    }
    return result;
}

/// "Transform: …", "Parameters: …", "FixedParameters: …", a line each.
std::vector<ItkTransform> itk_text(const std::string& text, const std::filesystem::path& path) {
    std::vector<ItkTransform> transforms;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) {
        if (line.ends_with('\r')) line.pop_back();
        const std::size_t colon = line.find(':');
        if (line.starts_with("#") || colon == std::string::npos) continue;
        const std::string key = line.substr(0, colon), value = line.substr(colon + 1);
        if (key == "Transform")
            transforms.push_back({value.substr(std::min(value.find_first_not_of(' '), value.size())), {}, {}});
        else if (transforms.empty())
            throw InvalidInput("'" + path.string() + "' has '" + key + "' before its transform");
        else if (key == "Parameters")
            transforms.back().parameters = numbers(value, path);
        else if (key == "FixedParameters")
            transforms.back().fixed = numbers(value, path);
    }
    return transforms;
}

/// Two arrays of Matlab's level 4, as ANTs' 0GenericAffine.mat: parameters, by the transform's name, and "fixed".
ItkTransform itk_matlab(const std::string& bytes, const std::filesystem::path& path) {
    ItkTransform transform;
    const auto damaged = [&] { return IoError("'" + path.string() + "' is no transform of ITK in Matlab's level 4"); };
    for (std::size_t at = 0; at < bytes.size();) {
        std::array<std::int32_t, 5> header{};  // type, rows, columns, imaginary part, length of the name
        if (bytes.size() - at < sizeof header) throw damaged();
        std::memcpy(header.data(), &bytes[at], sizeof header);
        at += sizeof header;
        const std::int64_t count = std::int64_t{header[1]} * header[2], width = header[0] == 10 ? 4 : 8;
        const bool known = header[0] == 0 || header[0] == 10;
        const auto left = static_cast<std::int64_t>(bytes.size() - at);
        if (!known || header[1] < 0 || header[2] < 0 || header[3] != 0 || header[4] < 1 || header[4] > left ||
            count > (left - header[4]) / width)
            throw damaged();
        const std::string name = &bytes[at];
        at += static_cast<std::size_t>(header[4]);
        std::vector<double> values;
        for (std::int64_t n = 0; n < count; ++n, at += static_cast<std::size_t>(width)) {
            double wide = 0;
            float narrow = 0;
            if (width == 8)
                std::memcpy(&wide, &bytes[at], 8);
            else
                std::memcpy(&narrow, &bytes[at], 4);
            values.push_back(width == 8 ? wide : double(narrow));
        }
        if (name != "fixed") transform.type = name;
        (name == "fixed" ? transform.fixed : transform.parameters) = std::move(values);
    }
    return transform;
}

PointMap matrix(const std::string& text, const std::filesystem::path& path) {
    const std::vector<double> values = numbers(text, path);
    const Eigen::RowVector4d last(0, 0, 0, 1);
    if (values.size() != 16 || !Eigen::RowVector4d::Map(&values[12]).isApprox(last))
        throw InvalidInput("'" + path.string() +
                           "' is no transform: give one of ITK (.tfm, .txt, .h5, .mat), a displacement field, or four "
                           "rows of four numbers, the last 0 0 0 1");
    PointMap map;
    map.after.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
    return map;
}

PointMap displacement_image(const std::filesystem::path& path) {
    const imaging::ReadResult read = imaging::read_volume_with_notes(path);
    const imaging::Volume& field = read.volume;
    if (field.channels() != 3)
        throw InvalidInput("'" + path.string() + "' has " + std::to_string(field.channels()) +
                           " component; a displacement field has three");
    PointMap map;
    map.field = field.as(CV_32F);
    require_displacements(*map.field, path);
    map.type = imaging::stated_field_type(path).value_or(imaging::FieldType::Resampling);
    map.notes = read.notes;
    return map;
}

PointMap read_checked(const std::filesystem::path& path) {
    const std::string extension = path.extension().string();
    if (extension != ".mat" && extension != ".h5" && imaging::is_image(path)) return displacement_image(path);
    const std::string bytes = bytes_of(path);
    if (bytes.starts_with("\x89HDF")) return detail::composed(detail::read_itk_hdf5(path), path);
    if (bytes.starts_with("#Insight Transform File")) return detail::composed(itk_text(bytes, path), path);
    if (extension == ".mat") return detail::composed({itk_matlab(bytes, path)}, path);
    return matrix(bytes, path);
}

}  // namespace

PointMap read_point_map(const std::filesystem::path& path) {
    return naming(path, [&] { return read_checked(path); });
}

}  // namespace tissuewarp::registration
