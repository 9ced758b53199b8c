#pragma once
/// The arrays of VTK's XML files of one piece: ascii, inline base64, raw or base64 appended, as they are or compressed
/// by zlib, with lengths of 32 or 64 bits, little-endian.
/// https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html

#include "meshing/detail/file_reader.hpp"

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp::meshing::detail {

/// The XML is scanned for tags; there is no general parser behind it.
struct XmlTag {
    std::string name;  ///< with a leading '/' on a closing tag
    std::map<std::string, std::string> attributes;
    bool empty = false;     ///< <tag/>
    std::size_t after = 0;  ///< position behind '>'

    /// Empty where there is none.
    [[nodiscard]] std::string attribute(const std::string& key) const;
};

class VtkXml {
public:
    /// Reads the tags of a file whose data set is of this type, UnstructuredGrid or PolyData. The file outlives this.
    /// Throws IoError, as all that follow.
    VtkXml(FileReader& file, const std::string& type);

    /// An attribute of the piece, such as NumberOfPoints, that counts things; 0 where it is missing.
    [[nodiscard]] std::size_t count(const std::string& attribute) const;

    /// An attribute of a section, such as Normals of PointData; empty where it is missing.
    [[nodiscard]] std::string attribute(const std::string& section, const std::string& key) const;

    /// Of all arrays, "Section/Name", as the file has them; that of the points is "Points/" whatever its name.
    [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
    [[nodiscard]] bool has(const std::string& name) const { return arrays_.contains(name); }
    /// True for an array of integers or floating-point numbers.
    [[nodiscard]] bool is_numeric(const std::string& name) const;

    /// The values of an array, all components of an entry in a row.
    [[nodiscard]] std::vector<double> values(const std::string& name) const;
    /// Exactly so many.
    [[nodiscard]] std::vector<double> values(const std::string& name, std::size_t size) const;
    /// The first text of an array of texts; empty where there is no such array.
    [[nodiscard]] std::string text(const std::string& name) const;

private:
    FileReader& file_;
    XmlTag piece_;
    std::map<std::string, XmlTag> sections_, arrays_;
    std::vector<std::string> names_;
    bool compressed_ = false;
    std::size_t header_bytes_ = 4;                   // of each length
    std::size_t appended_ = std::string_view::npos;  // position behind the underscore
    bool raw_appended_ = true;

    void take_root(const XmlTag& tag, const std::string& type);
    void take_appended(const XmlTag& tag);
    void take_array(const XmlTag& tag, const std::string& section);
    [[nodiscard]] std::string bytes_of(const XmlTag& tag) const;
};

}  // namespace tissuewarp::meshing::detail
