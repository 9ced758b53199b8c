#pragma once
/// Arrays of a VTK XML file as raw appended data, with lengths of 64 bits.

#include "meshing/mesh_io.hpp"

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

namespace tissuewarp::meshing::detail {

static_assert(std::endian::native == std::endian::little, "VTK's files are written in the machine's byte order");

/// With &, <, > and quotation marks as XML wants them.
std::string xml_escaped(const std::string& text);

/// Collects the header's <DataArray> elements and, in the same order, the bytes they refer to.
class VtkAppended {
public:
    template <class T>
    std::string array(const char* type, const std::string& name, std::ptrdiff_t components,
                      const std::vector<T>& values) {
        const std::string element = std::string("<DataArray type=\"") + type + "\" Name=\"" + xml_escaped(name) +
                                    "\" NumberOfComponents=\"" + std::to_string(components) +
                                    "\" format=\"appended\" offset=\"" + std::to_string(bytes_.size()) + "\"/>\n";
        const std::uint64_t size = values.size() * sizeof(T);
        append(&size, sizeof size);
        append(values.data(), size);
        return element;
    }

    [[nodiscard]] const std::string& bytes() const { return bytes_; }

private:
    void append(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }

    std::string bytes_;
};

/// The elements of arrays as float32. Throws InvalidInput unless each has a column for each of `count` nodes or cells,
/// which `what` names.
std::string float_arrays(VtkAppended& data, const std::vector<MeshArray>& arrays, Eigen::Index count, const char* what);

}  // namespace tissuewarp::meshing::detail
