// Gmsh's meshes, ascii, versions 2.2 and 4.1 (Gmsh reference manual, "MSH file format").

#include "meshing/detail/tetrahedra_formats.hpp"

namespace tissuewarp::meshing::detail {

namespace {

constexpr int tetrahedron = 4;  // Gmsh's number of the type

/// Types of elements that fill space, other than tetrahedra of four nodes.
bool is_other_solid(long long type) {
    for (const long long other : {5, 6, 7, 11, 12, 13, 14, 17, 18, 19, 29, 30, 31})
        if (type == other) return true;
    return false;
}

class MshReader {
public:
    explicit MshReader(FileReader& file) : file_(file) {}

    RawTetrahedra read() {
        require_format();
        while (file_.remaining() > 0) {
            const std::string_view section = file_.token();
            if (section == "$PhysicalNames") read_names();
            if (section == "$Entities") read_entities();
            if (section == "$Nodes") new_ ? read_nodes() : read_old_nodes();
            if (section == "$Elements") new_ ? read_elements() : read_old_elements();
            if (section.starts_with("$") && !section.starts_with("$End")) leave(section.substr(1));
        }
        return std::move(mesh_);
    }

private:
    FileReader& file_;
    bool new_ = false;  // 4.1
    RawTetrahedra mesh_;
    std::map<long long, int> group_of_volume_;

    void require_format() {
        if (file_.token() != "$MeshFormat") file_.refuse("does not begin with $MeshFormat; it is no mesh of Gmsh");
        const std::string version(file_.token());
        if (version != "2.2" && version != "4.1")
            file_.refuse("is of Gmsh's format " + version + "; save it as version 2.2 or 4.1, ascii");
        if (file_.integer() != 0) file_.refuse("is binary; save it as ascii");
        new_ = version == "4.1";
        leave("MeshFormat");
    }

    void leave(std::string_view section) {
        const std::string end = "$End" + std::string(section);
        while (file_.remaining() > 0)
            if (file_.token() == end) return;
        file_.fail("ends before " + end);
    }

    void read_names() {
        for (std::size_t left = file_.count("names", 5); left > 0; --left) {
            const long long dimension = file_.integer(), group = file_.integer();
            const std::string_view rest = file_.line();
            const std::size_t first = rest.find('"'), last = rest.rfind('"');
            if (dimension == 3 && last > first)
                mesh_.label_names[static_cast<int>(group)] = rest.substr(first + 1, last - first - 1);
        }
    }

    /// What of a volume the physical groups are, of which the first counts.
    void read_entities() {
        std::array<std::size_t, 4> counts{};
        for (std::size_t& count : counts) count = file_.count("entities", 8);
        for (std::size_t dimension = 0; dimension < 4; ++dimension)
            for (std::size_t left = counts[dimension]; left > 0; --left) {
                const long long entity = file_.integer();
                for (int skipped = dimension == 0 ? 3 : 6; skipped > 0; --skipped) (void)file_.token();
                for (std::size_t groups = file_.count("physical groups", 1); groups > 0; --groups) {
                    const int group = static_cast<int>(file_.integer());
                    if (dimension == 3) group_of_volume_.try_emplace(entity, group);
                }
                if (dimension == 0) continue;
                for (std::size_t parts = file_.count("bounding entities", 1); parts > 0; --parts) (void)file_.token();
            }
    }

    Eigen::Vector3d place() {
        const double x = file_.number(), y = file_.number();
        return {x, y, file_.number()};
    }

    void read_old_nodes() {
        for (std::size_t left = file_.count("nodes", 7); left > 0; --left) {
            const long long number = file_.integer();
            mesh_.add_node(number, place(), file_);
        }
    }

    void read_nodes() {
        const std::size_t blocks = file_.count("blocks of nodes", 7);
        (void)file_.line();
        for (std::size_t left = blocks; left > 0; --left) {
            (void)file_.integer(), (void)file_.integer(), (void)file_.integer();
            std::vector<long long> numbers(file_.count("nodes", 7));
            for (long long& number : numbers) number = file_.integer();
            for (const long long number : numbers) {
                mesh_.add_node(number, place(), file_);
                (void)file_.line();  // parameters on a curve or surface
            }
        }
    }

    void add(long long type, int label) {
        if (is_other_solid(type))
            file_.refuse("has elements of Gmsh's type " + std::to_string(type) +
                         "; save linear tetrahedra (type 4) alone");
        if (type == tetrahedron) {
            std::array<long long, 4> nodes{};
            for (long long& node : nodes) node = file_.integer();
            mesh_.tets.push_back(nodes);
            mesh_.labels.push_back(label);
        }
        (void)file_.line();
    }

    void read_old_elements() {
        for (std::size_t left = file_.count("elements", 8); left > 0; --left) {
            (void)file_.integer();
            const long long type = file_.integer();
            std::vector<long long> tags(file_.count("tags", 1));
            for (long long& tag : tags) tag = file_.integer();
            const long long group = tags.empty() ? 0 : tags[0], volume = tags.size() > 1 ? tags[1] : 0;
            add(type, static_cast<int>(group > 0 ? group : volume > 0 ? volume : 1));
        }
    }

    void read_elements() {
        const std::size_t blocks = file_.count("blocks of elements", 7);
        (void)file_.line();
        for (std::size_t left = blocks; left > 0; --left) {
            (void)file_.integer();
            const long long volume = file_.integer(), type = file_.integer();
            const auto group = group_of_volume_.find(volume);
            const int label = group == group_of_volume_.end() ? static_cast<int>(volume) : group->second;
            const std::size_t elements = file_.count("elements", 4);
            for (std::size_t n = 0; n < elements; ++n) {
                (void)file_.integer();
                add(type, label);
            }
        }
    }
};

}  // namespace

RawTetrahedra read_msh(FileReader& file) {
    return MshReader(file).read();
}

}  // namespace tissuewarp::meshing::detail
