/// NRRD (.nrrd, .nhdr), after "Definition of NRRD File Format" of the Teem library.

#include "core/length_units.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/image_header.hpp"
#include "imaging/detail/text_headers.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

Scalar nrrd_type(const fs::path& path, const std::string& name) {
    static const std::map<std::string, Scalar> types = {{"signed char", Scalar::Int8},
                                                        {"int8", Scalar::Int8},
                                                        {"int8_t", Scalar::Int8},
                                                        {"uchar", Scalar::UInt8},
                                                        {"unsigned char", Scalar::UInt8},
                                                        {"uint8", Scalar::UInt8},
                                                        {"uint8_t", Scalar::UInt8},
                                                        {"short", Scalar::Int16},
                                                        {"short int", Scalar::Int16},
                                                        {"signed short", Scalar::Int16},
                                                        {"signed short int", Scalar::Int16},
                                                        {"int16", Scalar::Int16},
                                                        {"int16_t", Scalar::Int16},
                                                        {"ushort", Scalar::UInt16},
                                                        {"unsigned short", Scalar::UInt16},
                                                        {"unsigned short int", Scalar::UInt16},
                                                        {"uint16", Scalar::UInt16},
                                                        {"uint16_t", Scalar::UInt16},
                                                        {"int", Scalar::Int32},
                                                        {"signed int", Scalar::Int32},
                                                        {"int32", Scalar::Int32},
                                                        {"int32_t", Scalar::Int32},
                                                        {"uint", Scalar::UInt32},
                                                        {"unsigned int", Scalar::UInt32},
                                                        {"uint32", Scalar::UInt32},
                                                        {"uint32_t", Scalar::UInt32},
                                                        {"longlong", Scalar::Int64},
                                                        {"long long", Scalar::Int64},
                                                        {"long long int", Scalar::Int64},
                                                        {"signed long long", Scalar::Int64},
                                                        {"int64", Scalar::Int64},
                                                        {"int64_t", Scalar::Int64},
                                                        {"ulonglong", Scalar::UInt64},
                                                        {"unsigned long long", Scalar::UInt64},
                                                        {"uint64", Scalar::UInt64},
                                                        {"uint64_t", Scalar::UInt64},
                                                        {"unsigned long long int", Scalar::UInt64},
                                                        {"signed long long int", Scalar::Int64},
                                                        {"float", Scalar::Float32},
                                                        {"double", Scalar::Float64}};
    const auto found = types.find(lower_case(name));
    if (found == types.end())
        throw unusable(path, "type '" + name + "' is no type of grey values; convert it to int16 or float");
    return found->second;
}

/// Blank-separated words; what stands between double quotes is one, without them.
std::vector<std::string> words_of(const std::string& text) {
    std::vector<std::string> words;
    std::istringstream stream(text);
    for (char c = 0; stream >> c;) {
        std::string word;
        if (c == '"') {
            std::getline(stream, word, '"');
        } else {
            stream.unget();
            stream >> word;
        }
        words.push_back(word);
    }
    return words;
}

/// One entry per axis: a vector "(x,y,z)" or nothing for "none".
std::vector<std::optional<Eigen::Vector3d>> vectors_of(const fs::path& path, const std::string& text) {
    std::vector<std::optional<Eigen::Vector3d>> vectors;
    for (std::size_t at = text.find_first_not_of(" \t"); at != std::string::npos;
         at = text.find_first_not_of(" \t", at)) {
        const bool is_vector = text[at] == '(';
        std::size_t end = is_vector ? text.find(')', at) : text.find_first_of(" \t", at);
        end = end == std::string::npos ? text.size() : end + (is_vector ? 1 : 0);
        const std::string word = text.substr(at, end - at);
        at = end;
        if (lower_case(word) == "none") {
            vectors.emplace_back();
            continue;
        }
        const std::vector<double> numbers = numbers_in(word);
        if (!is_vector || numbers.size() < 3 || numbers.size() > 4)
            throw unreadable(path, "'" + word + "' of '" + text.substr(0, 200) +
                                       "' is no vector of three components; correct the header");
        vectors.emplace_back(Eigen::Vector3d(numbers[0], numbers[1], numbers[2]));
    }
    return vectors;
}

/// The header's world axes in LPS: column w is the LPS direction of world axis w. Any order and sign of the anatomical
/// axes is taken, long ("left-anterior-superior") and short ("LAS").
std::optional<Eigen::Matrix3d> anatomical_axes(const std::string& space) {
    std::vector<char> letters;
    std::string name = lower_case(space);
    if (name.find('-') == std::string::npos) {
        letters.assign(name.begin(), name.end());
    } else {
        static const std::map<std::string, char> axis_words = {{"left", 'l'},     {"right", 'r'},    {"posterior", 'p'},
                                                               {"anterior", 'a'}, {"superior", 's'}, {"inferior", 'i'},
                                                               {"time", 't'}};
        std::replace(name.begin(), name.end(), '-', ' ');
        for (const std::string& word : words_of(name)) {
            const auto found = axis_words.find(word);
            letters.push_back(found == axis_words.end() ? '?' : found->second);
        }
    }
    if (letters.size() == 4 && letters.back() == 't') letters.pop_back();
    if (letters.size() != 3) return std::nullopt;
    Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
    for (int world = 0; world < 3; ++world) {
        const std::string positive = "lps", negative = "rai";
        const char letter = letters[static_cast<std::size_t>(world)];
        if (const auto row = positive.find(letter); row != std::string::npos)
            axes(static_cast<Eigen::Index>(row), world) = 1.0;
        if (const auto row = negative.find(letter); row != std::string::npos)
            axes(static_cast<Eigen::Index>(row), world) = -1.0;
    }
    if (std::abs(std::abs(axes.determinant()) - 1.0) > 0.5) return std::nullopt;
    return axes;
}

/// World to LPS, with a note where the header does not name anatomical axes.
Eigen::Matrix3d world_to_lps(const fs::path& path, const std::string& space, std::vector<std::string>& notes) {
    if (space.empty()) {
        notes.emplace_back("the NRRD header names no space: its axes are taken as LPS");
        return Eigen::Matrix3d::Identity();
    }
    if (const auto axes = anatomical_axes(space)) return *axes;
    const std::string name = lower_case(space);
    for (const char* known : {"scanner-xyz", "3d-right-handed", "3d-left-handed"})
        if (name == known || name == std::string(known) + "-time") {
            notes.push_back("the NRRD space '" + space + "' names no anatomical axes: they are taken as LPS");
            return Eigen::Matrix3d::Identity();
        }
    throw unusable(path, "space '" + space +
                             "' names no three axes of a patient; write left-posterior-superior, "
                             "right-anterior-superior or another order of those words");
}

/// Axes of a file: three of space, and at most one of values.
struct Axes {
    std::array<std::size_t, 3> spatial{};
    std::optional<std::size_t> values;  ///< components, layers or volumes
};

class NrrdReader {
public:
    explicit NrrdReader(const fs::path& path) : path_(path), header_(read_nrrd_header(path)) {}

    ImageHeader read() {
        read_axes();
        read_geometry();
        read_layout();
        read_segments();
        return image_;
    }

private:
    const fs::path& path_;
    const TextHeader header_;
    ImageHeader image_;
    std::vector<double> sizes_;
    std::vector<std::string> kinds_;
    std::vector<std::optional<Eigen::Vector3d>> directions_;
    Axes axes_;
    bool vectors_turned_ = false;

    std::vector<std::string> words(const char* key) const { return words_of(header_.value(key)); }
    void require_per_axis(const char* key, std::size_t count) const {
        if (count != 0 && count != sizes_.size())
            throw unreadable(path_, "'" + std::string(key) + ": " + header_.value(key) + "' holds " +
                                        std::to_string(count) + " entries for " + std::to_string(sizes_.size()) +
                                        " axes; correct the header");
    }
    bool is_domain(std::size_t axis) const {
        if (kinds_.empty()) return directions_.empty();
        const std::string kind = lower_case(kinds_[axis]);
        return kind == "domain" || kind == "space" || kind == "time";
    }
    bool is_spatial(std::size_t axis) const {
        if (!directions_.empty()) return directions_[axis].has_value();
        if (kinds_.empty() || sizes_.size() == 3) return true;
        return is_domain(axis);
    }

    void read_axes() {
        sizes_ = numbers_in(header_.value("sizes"));
        values_of(path_, sizes_);
        const std::vector<double> dimension = numbers_in(header_.value("dimension"));
        if (dimension.size() != 1 || dimension[0] != static_cast<double>(sizes_.size()))
            throw unreadable(path_, "dimension '" + header_.value("dimension") + "' does not fit sizes '" +
                                        header_.value("sizes") + "'; the header is damaged");
        directions_ = vectors_of(path_, header_.value("space directions"));
        kinds_ = words("kinds");
        require_per_axis("space directions", directions_.size());
        require_per_axis("kinds", kinds_.size());
        std::vector<std::size_t> spatial;
        for (std::size_t axis = 0; axis < sizes_.size(); ++axis) {
            if (is_spatial(axis) && spatial.size() < 3) {
                spatial.push_back(axis);
            } else if (sizes_[axis] > 1.0) {
                if (axes_.values)
                    throw unusable(path_, "its size " + text_of(sizes_) +
                                              " holds more than volumes of one kind of "
                                              "value; extract one volume");
                axes_.values = axis;
            }
        }
        std::vector<double> grid;
        for (const std::size_t axis : spatial) grid.push_back(sizes_[axis]);
        if (grid.size() < 3) grid = sizes_;
        if (spatial.size() < 3)
            throw unusable(path_, "its size " + text_of(grid) +
                                      " is a two-dimensional image; give a volume of three "
                                      "dimensions");
        require_three_dimensions(path_, grid);
        std::copy_n(spatial.begin(), 3, axes_.spatial.begin());
        for (std::size_t i = 0; i < 3; ++i)
            image_.geometry.size[i] = image_.voxels.size[i] = static_cast<int>(sizes_[spatial[i]]);
    }

    /// Millimetres of a unit that the header names.
    double unit(const std::string& name) const {
        if (name.empty() || name == "?" || name == "???") return 1.0;
        if (const auto millimetres = millimetres_per(name)) return *millimetres;
        throw unusable(path_, "'" + name + "' is no known unit of length; write mm, cm, m or um");
    }
    /// One factor for each axis of a list of units; a note where they are not millimetres.
    Eigen::Vector3d units(const char* key, const std::array<std::size_t, 3>& entries) {
        const std::vector<std::string> names = words(key);
        Eigen::Vector3d factors = Eigen::Vector3d::Ones();
        std::string text;
        for (std::size_t i = 0; i < 3; ++i) {
            if (entries[i] >= names.size()) continue;
            const std::string& name = names[entries[i]];
            factors[static_cast<Eigen::Index>(i)] = unit(name);
            if (text.find(name) == std::string::npos) text += (text.empty() ? "" : ", ") + name;
        }
        if (factors != Eigen::Vector3d::Ones())
            image_.notes.push_back("lengths are given in " + text + " and were converted to mm");
        return factors;
    }

    void read_geometry() {
        const Eigen::Matrix3d to_lps = world_to_lps(path_, header_.value("space"), image_.notes);
        Eigen::Matrix3d columns = Eigen::Matrix3d::Identity();
        Eigen::Vector3d origin = Eigen::Vector3d::Zero();
        const Eigen::Vector3d millimetres =
            directions_.empty() ? read_axis_geometry(columns, origin) : read_world_geometry(columns, origin);
        columns = to_lps * columns;
        Geometry& grid = image_.geometry;
        for (int i = 0; i < 3; ++i) {
            const double length = columns.col(i).norm();
            require_spacing(path_, length, axes_.spatial[static_cast<std::size_t>(i)]);
            grid.spacing[i] = length;
            grid.direction.col(i) = columns.col(i) / length;
        }
        grid.origin = to_lps * origin;
        read_vector_axes(to_lps, millimetres);
    }
    /// "space directions" and "space origin": every world axis may have a unit of its own, whose millimetres return.
    Eigen::Vector3d read_world_geometry(Eigen::Matrix3d& columns, Eigen::Vector3d& origin) {
        for (int i = 0; i < 3; ++i) columns.col(i) = *directions_[axes_.spatial[static_cast<std::size_t>(i)]];
        const auto origins = vectors_of(path_, header_.value("space origin"));
        if (!origins.empty() && origins[0])
            origin = *origins[0];
        else
            image_.notes.emplace_back("the NRRD header states no space origin: (0, 0, 0) is taken");
        Eigen::Vector3d factors = units("space units", {0, 1, 2});
        if (words("space units").empty() && !words("units").empty()) {
            factors = units("units", axes_.spatial);
            if (factors != Eigen::Vector3d::Constant(factors[0]))
                throw unusable(path_, "its axes are of different units ('" + header_.value("units") +
                                          "') and its world of none; write 'space units'");
        }
        columns = factors.asDiagonal() * columns;
        origin = factors.cwiseProduct(origin);
        return factors;
    }
    /// "axis mins" or "axis maxs", whose older names have no blank.
    std::vector<double> axis_ends(const std::string& which) const {
        const std::vector<double> ends = numbers_in(header_.value("axis " + which) + header_.value("axis" + which));
        require_per_axis(("axis " + which).c_str(), ends.size());
        return ends;
    }
    /// Samples are centred on nodes, or in cells where the header does not say.
    bool is_node_centred(std::size_t axis) const {
        const std::vector<std::string> centers = words("centers").empty() ? words("centerings") : words("centers");
        return axis < centers.size() && lower_case(centers[axis]) == "node";
    }
    /// Along each axis of the file, NaN where the header does not say: "spacings", or what lies between "axis mins" and
    /// "axis maxs", the edges of cells or the places of nodes.
    std::vector<double> spacings(const std::vector<double>& mins) const {
        std::vector<double> result = numbers_in(header_.value("spacings"));
        require_per_axis("spacings", result.size());
        result.resize(sizes_.size(), NAN);
        const std::vector<double> maxs = axis_ends("maxs");
        for (std::size_t axis = 0; axis < sizes_.size() && !mins.empty() && !maxs.empty(); ++axis)
            if (std::isnan(result[axis]))
                result[axis] = (maxs[axis] - mins[axis]) / (sizes_[axis] - (is_node_centred(axis) ? 1.0 : 0.0));
        return result;
    }
    /// "spacings", "axis mins" and "axis maxs" along the axes themselves, whose units are "units".
    Eigen::Vector3d read_axis_geometry(Eigen::Matrix3d& columns, Eigen::Vector3d& origin) {
        const std::vector<double> mins = axis_ends("mins"), stated = spacings(mins);
        const Eigen::Vector3d factors = units("units", axes_.spatial);
        bool guessed = false;
        for (int i = 0; i < 3; ++i) {
            const std::size_t axis = axes_.spatial[static_cast<std::size_t>(i)];
            const double spacing = std::isnan(stated[axis]) ? 1.0 : stated[axis];
            guessed = guessed || std::isnan(stated[axis]);
            require_spacing(path_, spacing, axis);
            columns(i, i) = factors[i] * spacing;
            if (mins.empty() || std::isnan(mins[axis])) continue;
            origin[i] = factors[i] * (mins[axis] + (is_node_centred(axis) ? 0.0 : 0.5 * spacing));
        }
        if (guessed) image_.notes.emplace_back("the NRRD header states no spacing: voxels of 1 mm are taken");
        return factors;
    }
    /// Components are in the measurement frame, or in the world where there is none.
    void read_vector_axes(const Eigen::Matrix3d& to_lps, const Eigen::Vector3d& millimetres) {
        Eigen::Matrix3d to_world = Eigen::Matrix3d::Identity();
        const auto frame = vectors_of(path_, header_.value("measurement frame"));
        if (frame.size() == 3 && frame[0] && frame[1] && frame[2])
            for (int i = 0; i < 3; ++i) to_world.col(i) = *frame[static_cast<std::size_t>(i)];
        vectors_turned_ = !(to_lps * to_world).isIdentity(1e-6);
        image_.vector_axes = to_lps * millimetres.asDiagonal() * to_world;
        image_.converted = millimetres != Eigen::Vector3d::Ones();
    }

    /// What the values of a voxel are: one, a vector, layers of a segmentation.
    void read_components() {
        if (!axes_.values) return;
        const std::size_t axis = *axes_.values;
        const double count = sizes_[axis];
        const std::string kind = kinds_.empty() ? "" : lower_case(kinds_[axis]);
        const bool segmented = !segments().empty();
        if (kind.find("color") != std::string::npos)
            throw unusable(path_,
                           "its voxels are colours ('" + kinds_[axis] + "'); give one grey value or a vector of three");
        if (!segmented && (count != 3.0 || is_domain(axis)))
            throw unusable(path_, "its voxels hold " + text_of({count}) + " values ('" + kind +
                                      "'); give one grey value or a vector of three, or extract one volume");
        if (!segmented && vectors_turned_)
            image_.notes.push_back("vectors were turned to LPS from the frame that the header names ('" +
                                   header_.value("space") + "')");
        if (!segmented && kind != "vector" && kind != "3-vector" && kind != "covariant-vector")
            image_.notes.push_back("three values a voxel of kind '" + kind + "' are taken as vectors");
        if (count > 512.0) throw unusable(path_, "it holds " + text_of({count}) + " layers, limit 512; give fewer");
        image_.voxels.channels = static_cast<int>(count);
        if (axis > axes_.spatial[0] && axis < axes_.spatial[2])
            throw unusable(path_, "its values lie between its axes of space; permute the axes");
        image_.voxels.planar = axis > axes_.spatial[2];
    }
    void read_layout() {
        StoredVoxels& voxels = image_.voxels;
        voxels.type = nrrd_type(path_, header_.value("type"));
        read_components();
        const std::string encoding = lower_case(header_.value("encoding")),
                          endian = lower_case(header_.value("endian"));
        if (encoding == "raw")
            voxels.packing = Packing::Raw;
        else if (encoding == "gzip" || encoding == "gz")
            voxels.packing = Packing::Deflate;
        else if (encoding == "text" || encoding == "txt" || encoding == "ascii")
            voxels.packing = Packing::Text;
        else if (encoding == "hex")
            voxels.packing = Packing::Hexadecimal;
        else
            throw unusable(path_, "encoding '" + header_.value("encoding") + "' is not read; save it as gzip or raw");
        const bool many_bytes = bytes_of(voxels.type) > 1 && voxels.packing != Packing::Text;
        if (many_bytes && endian != "little" && endian != "big")
            throw unusable(path_, "its header does not state the byte order ('endian') of its " +
                                      std::to_string(bytes_of(voxels.type)) + "-byte values; write little or big");
        voxels.swapped = many_bytes && (endian == "big") != (std::endian::native == std::endian::big);
        read_pieces(values_of(path_, sizes_) * bytes_of(voxels.type));
    }
    void read_pieces(std::uint64_t bytes) {
        StoredVoxels& voxels = image_.voxels;
        const std::string data = header_.value("data file");
        if (data.empty()) {
            voxels.pieces = {{path_, header_.bytes}};
        } else {
            const auto last = static_cast<std::size_t>(sizes_.back());
            const auto rows = static_cast<std::size_t>(values_of(path_, {sizes_.begin() + 1, sizes_.end()}));
            for (const fs::path& file : files_of(path_, header_, data, last, rows)) voxels.pieces.push_back({file, 0});
            require_file_count();
        }
        skip(bytes / voxels.pieces.size());
    }
    /// Files of slices: as many as the axes that they do not hold have entries.
    void require_file_count() const {
        const std::size_t files = image_.voxels.pieces.size();
        std::size_t expected = 1;
        for (std::size_t axis = sizes_.size(); axis-- > 0 && files != expected && axis > 0;)
            expected *= static_cast<std::size_t>(sizes_[axis]);
        if (files == expected && files > 0) return;
        throw unusable(path_, "its header names " + std::to_string(files) + " files for the " +
                                  text_of({sizes_.back()}) + " slices of its size " + text_of(sizes_) +
                                  "; name one file for each slice");
    }
    /// "line skip" and "byte skip": what comes before the voxels of each file; −1 counts from the end.
    void skip(std::uint64_t bytes) {
        const std::string line_text = header_.value("line skip") + header_.value("lineskip");
        const std::string byte_text = header_.value("byte skip") + header_.value("byteskip");
        const auto number = [&](const std::string& text) {
            if (text.empty()) return 0.0;
            const std::vector<double> numbers = numbers_in(text);
            if (numbers.size() != 1 || !(numbers[0] >= -1.0) || numbers[0] != std::floor(numbers[0]))
                throw unusable(path_, "a skip of '" + text + "' is no number of lines or bytes; correct the header");
            return numbers[0];
        };
        const double line_count = number(line_text), byte_count = number(byte_text);
        StoredVoxels& voxels = image_.voxels;
        if (line_count < 0.0 || (byte_count < 0.0 && voxels.packing != Packing::Raw))
            throw unusable(path_, "a skip of -1 counts bytes from the end of raw data only; correct the header");
        for (Piece& piece : voxels.pieces) {
            piece.offset = after_lines(piece, static_cast<std::uint64_t>(line_count));
            std::error_code failure;
            const std::uint64_t whole = fs::file_size(piece.file, failure);
            if (byte_count < 0.0 && !failure && whole >= piece.offset + bytes) piece.offset = whole - bytes;
            if (byte_count > 0.0 && voxels.packing != Packing::Deflate)
                piece.offset += static_cast<std::uint64_t>(byte_count);
        }
        if (byte_count > 0.0 && voxels.packing == Packing::Deflate)
            voxels.unpacked_skip = static_cast<std::uint64_t>(byte_count);
    }
    static std::uint64_t after_lines(const Piece& piece, std::uint64_t lines) {
        if (lines == 0) return piece.offset;
        std::ifstream file(piece.file, std::ios::binary);
        file.seekg(static_cast<std::streamoff>(piece.offset));
        std::string line;
        std::uint64_t offset = piece.offset;
        for (std::uint64_t i = 0; i < lines && std::getline(file, line); ++i) offset += line.size() + 1;
        return offset;
    }

    std::string segment_field(int number, const char* key) const {
        const auto found = header_.comments.find("Segment" + std::to_string(number) + "_" + key);
        return found == header_.comments.end() ? std::string() : found->second;
    }
    int segment_number(int number, const char* key, int otherwise) const {
        const std::string text = segment_field(number, key);
        if (text.empty()) return otherwise;
        const std::vector<double> values = numbers_in(text);
        if (values.size() != 1 || values[0] != std::floor(values[0]) || !(values[0] >= 0.0) || values[0] > 1e9)
            throw unusable(path_, "Segment" + std::to_string(number) + "_" + key + " '" + text +
                                      "' is no number from 0 on; correct the header");
        return static_cast<int>(values[0]);
    }
    /// Numbers of the segments, ascending; gaps are where one was deleted.
    std::set<int> segments() const {
        constexpr std::size_t most_digits = 6;
        const std::string prefix = "Segment";
        std::set<int> numbers;
        for (const auto& [key, value] : header_.comments) {
            const std::size_t end = key.find_first_not_of("0123456789", prefix.size());
            if (!key.starts_with(prefix) || end == std::string::npos || end == prefix.size()) continue;
            const std::string field = key.substr(end), digits = key.substr(prefix.size(), end - prefix.size());
            if ((field != "_ID" && field != "_LabelValue") || value.empty() || digits.size() > most_digits) continue;
            numbers.insert(std::stoi(digits));
        }
        return numbers;
    }
    void read_segments() {
        for (const int i : segments()) {
            Segment segment;
            segment.name = segment_field(i, "Name").empty() ? segment_field(i, "ID") : segment_field(i, "Name");
            // Versions of 3D Slicer before 4.11 wrote a layer a segment, and neither key.
            segment.value = segment_number(i, "LabelValue", 1);
            segment.layer = segment_number(i, "Layer", segment_field(i, "LabelValue").empty() ? i : 0);
            image_.segments.push_back(segment);
        }
    }
};

}  // namespace

ImageHeader read_nrrd_image_header(const fs::path& path) {
    return NrrdReader(path).read();
}

}  // namespace tissuewarp::imaging::detail
