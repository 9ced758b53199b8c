// The short formats: stereolithography (ascii, binary) and Wavefront OBJ.

#include "core/text_table.hpp"
#include "meshing/detail/surface_formats.hpp"

#include <map>

namespace tissuewarp::meshing::detail {

namespace {

/// STL repeats the corners of every triangle; identical coordinates become one node.
class NodeMerger {
public:
    explicit NodeMerger(RawSurface& surface) : surface_(surface) {}

    long long index(const Eigen::Vector3d& position) {
        const auto [entry, added] = index_.try_emplace(std::array{position[0], position[1], position[2]},
                                                       static_cast<long long>(surface_.nodes.size()));
        if (added) surface_.nodes.push_back(position);
        return entry->second;
    }

private:
    RawSurface& surface_;
    std::map<std::array<double, 3>, long long> index_;
};

void require_finite(const Eigen::Vector3d& position, const FileReader& file) {
    if (!position.allFinite()) file.refuse("has a coordinate that is not finite");  // a map cannot order NaN
}

RawSurface read_binary_stl(FileReader& file, std::size_t count) {
    RawSurface surface;
    surface.take_free_text(file.text().substr(0, 80));
    NodeMerger merger(surface);
    file.seek(84);
    for (std::size_t t = 0; t < count; ++t) {
        file.skip(12);  // the facet's normal
        std::array<long long, 3> triangle;
        for (long long& node : triangle) {
            Eigen::Vector3d position;
            for (double& x : position) x = file.binary<float>();
            require_finite(position, file);
            node = merger.index(position);
        }
        surface.triangles.push_back(triangle);
        file.skip(2);
    }
    return surface;
}

RawSurface read_ascii_stl(FileReader& file) {
    RawSurface surface;
    surface.take_free_text(file.line());
    NodeMerger merger(surface);
    std::vector<long long> corners;
    bool ended = false;
    for (std::string_view word = file.token(); !word.empty(); word = file.token()) {
        if (word == "vertex") {
            Eigen::Vector3d position;
            for (double& x : position) x = file.number();
            require_finite(position, file);
            corners.push_back(merger.index(position));
        } else if (word == "endloop") {
            if (corners.size() != 3) file.fail("has a facet that is no triangle");
            surface.add_polygon(corners);
            corners.clear();
        } else if (word == "endsolid") {
            ended = true;
        }
    }
    if (!ended || !corners.empty()) file.fail("ends before its data do");
    return surface;
}

/// "v x y z w": a fourth number is a weight, by which the others are to be divided; six are a place and a colour.
void require_weight_of_one(std::string_view vertex, const FileReader& file) {
    const std::vector<std::string> words = words_of(vertex);
    if (words.size() == 5 && file.to_number(words[4]) != 1)
        file.refuse("has a vertex with the weight " + words[4] + " ('" + std::string(vertex.substr(0, 60)) +
                    "'); divide x, y and z by it and leave it out");
}

}  // namespace

RawSurface read_stl(FileReader& file) {
    // Binary files may begin with "solid" too: their size decides.
    std::string found;
    if (const std::size_t bytes = file.text().size(); bytes >= 84) {
        file.seek(80);
        const std::uint32_t count = file.binary<std::uint32_t>();
        const std::size_t expected = 84 + 50 * std::size_t{count};
        if (bytes == expected) return read_binary_stl(file, count);
        found = ": it has " + std::to_string(bytes) + " bytes, and the " + std::to_string(count) +
                " triangles that it states take " + std::to_string(expected);
        file.seek(0);
    }
    if (!file.text().starts_with("solid")) file.fail("is neither an ascii STL file nor a complete binary one" + found);
    return read_ascii_stl(file);
}

RawSurface read_obj(FileReader& file) {
    RawSurface surface;
    while (file.remaining() > 0) {
        const std::string_view line = file.line();
        if (line.starts_with('#')) {
            surface.take_free_text(line.substr(1));
        } else if (line.starts_with("v ") || line.starts_with("v\t")) {
            const std::size_t next = file.position();
            file.seek(static_cast<std::size_t>(line.data() - file.text().data()) + 1);
            Eigen::Vector3d position;
            for (double& x : position) x = file.number();
            require_weight_of_one(line, file);
            surface.nodes.push_back(position);
            file.seek(next);
        } else if (line.starts_with("f ") || line.starts_with("f\t")) {
            const std::size_t next = file.position();
            file.seek(static_cast<std::size_t>(line.data() - file.text().data()) + 1);
            std::vector<long long> corners;
            for (std::string_view word = file.token(); !word.empty() && word.data() < line.data() + line.size();
                 word = file.token()) {
                const long long index = file.to_integer(word.substr(0, word.find('/')));  // v/vt/vn
                corners.push_back(index > 0 ? index - 1 : index + static_cast<long long>(surface.nodes.size()));
            }
            if (corners.size() < 3) file.fail("has a face of fewer than three nodes");
            surface.add_polygon(corners);
            file.seek(next);
        }
    }
    return surface;
}

}  // namespace tissuewarp::meshing::detail
