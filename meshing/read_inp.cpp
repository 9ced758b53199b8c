// Tetrahedra of Abaqus' input files: *NODE and *ELEMENT, TYPE=C3D4, in one part.

#include "core/text_table.hpp"
#include "meshing/detail/tetrahedra_formats.hpp"

#include <algorithm>

namespace tissuewarp::meshing::detail {

namespace {

std::vector<std::string_view> between_commas(std::string_view line) {
    std::vector<std::string_view> entries;
    for (std::size_t start = 0; start <= line.size();) {
        const std::size_t comma = std::min(line.find(',', start), line.size());
        entries.push_back(trimmed(line.substr(start, comma - start)));
        start = comma + 1;
    }
    return entries;
}

class InpReader {
public:
    explicit InpReader(FileReader& file) : file_(file) {}

    RawTetrahedra read() {
        while (file_.remaining() > 0) {
            const std::string_view line = trimmed(file_.line());
            if (line.empty() || line.starts_with("**")) continue;
            if (line.starts_with("*"))
                begin(between_commas(line));
            else if (in_ == In::Nodes)
                add_node(between_commas(line));
            else if (in_ == In::Tetrahedra)
                add_tetrahedron(between_commas(line));
        }
        return std::move(mesh_);
    }

private:
    enum class In { Nodes, Tetrahedra, Other };

    FileReader& file_;
    In in_ = In::Other;
    int label_ = 0;
    std::map<std::string, int> label_of_set_;
    RawTetrahedra mesh_;

    void begin(const std::vector<std::string_view>& words) {
        const std::string keyword = lower_case(words.front());
        in_ = keyword == "*node" ? In::Nodes : In::Other;
        if (keyword != "*element") return;
        std::string type, set;
        for (const std::string_view word : words) {
            const std::size_t equals = std::min(word.find('='), word.size());
            const std::string name = lower_case(trimmed(word.substr(0, equals)));
            const std::string_view value = trimmed(word.substr(std::min(equals + 1, word.size())));
            if (name == "type") type = lower_case(value);
            if (name == "elset") set = value;
        }
        if (type.starts_with("c3d") && !type.starts_with("c3d4"))
            file_.refuse("has elements " + type + "; only linear tetrahedra (C3D4) are read");
        if (!type.starts_with("c3d4")) return;
        in_ = In::Tetrahedra;
        label_ = label_of_set_.try_emplace(set, static_cast<int>(label_of_set_.size()) + 1).first->second;
        if (!set.empty()) mesh_.label_names[label_] = set;
    }

    void add_node(const std::vector<std::string_view>& entries) {
        if (entries.size() < 4) file_.fail("has a node of fewer than three coordinates");
        mesh_.add_node(file_.to_integer(entries[0]),
                       {file_.to_number(entries[1]), file_.to_number(entries[2]), file_.to_number(entries[3])}, file_);
    }

    void add_tetrahedron(const std::vector<std::string_view>& entries) {
        if (entries.size() < 5) file_.fail("has a C3D4 of fewer than four nodes");
        std::array<long long, 4> nodes{};
        for (std::size_t k = 0; k < 4; ++k) nodes[k] = file_.to_integer(entries[k + 1]);
        mesh_.tets.push_back(nodes);
        mesh_.labels.push_back(label_);
    }
};

}  // namespace

RawTetrahedra read_inp(FileReader& file) {
    return InpReader(file).read();
}

}  // namespace tissuewarp::meshing::detail
