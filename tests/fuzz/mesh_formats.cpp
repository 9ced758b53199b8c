// Tetrahedra: VTU in the encodings of VTK, Gmsh 2.2 and 4.1, Abaqus.

#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"
#include "tests/fuzz/appended_fields.hpp"
#include "tests/fuzz/format.hpp"

#include <zlib.h>

#include <cstdint>

namespace tissuewarp::fuzz {

namespace {

void read_mesh(const std::filesystem::path& path, Digest& digest) {
    const meshing::MeshFile read = meshing::read_tetrahedra(path);
    digest.matrix(read.mesh.nodes);
    digest.matrix(read.mesh.tets);
    digest.matrix(read.mesh.labels);
    for (const auto& [label, name] : read.label_names) digest.text(std::to_string(label) + name);
}

void read_vtu(const std::filesystem::path& path, Digest& digest) {
    read_mesh(path, digest);
    try {
        digest.matrix(meshing::read_vtu_cell_array(path, "label"));
    } catch (const InvalidInput&) {  // it has none
    }
}

constexpr const char* nodes_text = "0 0 0 10 0 0 0 10 0 0 0 10 10 10 10";
constexpr const char* corners_text = "0 1 2 3 1 4 2 3";

std::string vtu(const std::string& attributes, const std::string& points, const std::string& corners,
                const std::string& format) {
    const auto array = [](const std::string& type, const std::string& name, const std::string& how,
                          const std::string& values) {
        return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" format=\"" + how + "\">" + values +
               "</DataArray>\n";
    };
    return "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"" +
           attributes + ">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"5\" NumberOfCells=\"2\">\n<Points>\n" +
           array("Float64", "Points\" NumberOfComponents=\"3", format, points) + "</Points>\n<Cells>\n" +
           array("Int32", "connectivity", format, corners) + array("Int32", "offsets", "ascii", "4 8") +
           array("UInt8", "types", "ascii", "10 10") + "</Cells>\n<CellData>\n" +
           array("Int32", "label", "ascii", "1 7") + "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

std::string base64(const std::string& bytes) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t at = 0; at < bytes.size(); at += 3) {
        std::uint32_t group = 0;
        const std::size_t held = std::min<std::size_t>(3, bytes.size() - at);
        for (std::size_t n = 0; n < 3; ++n)
            group = group << 8U | (n < held ? static_cast<unsigned char>(bytes[at + n]) : 0U);
        for (std::size_t n = 0; n < 4; ++n) text += n <= held ? digits[group >> (18 - 6 * n) & 63U] : '=';
    }
    return text;
}

template <class T>
std::string raw(const std::vector<T>& values) {
    return {reinterpret_cast<const char*>(values.data()), sizeof(T) * values.size()};
}

const std::vector<double> nodes{0, 0, 0, 10, 0, 0, 0, 10, 0, 0, 0, 10, 10, 10, 10};
const std::vector<std::int32_t> corners{0, 1, 2, 3, 1, 4, 2, 3};

/// Length, then the bytes.
std::string plain(const std::string& bytes) {
    return base64(raw(std::vector{static_cast<std::uint32_t>(bytes.size())}) + bytes);
}

/// One block: number of blocks, length of each, of the last (0: the same), packed length; then the block.
std::string compressed(const std::string& bytes) {
    std::string block(compressBound(bytes.size()), '\0');
    uLongf length = block.size();
    compress(reinterpret_cast<Bytef*>(block.data()), &length, reinterpret_cast<const Bytef*>(bytes.data()),
             bytes.size());
    block.resize(length);
    const auto whole = static_cast<std::uint32_t>(bytes.size());
    return base64(raw(std::vector<std::uint32_t>{1, whole, 0, static_cast<std::uint32_t>(length)})) + base64(block);
}

std::vector<Seed> vtu_seeds(const std::filesystem::path& folder) {
    meshing::TetMesh mesh = meshing::box_mesh({30, 20, 20}, {1, 1, 1});
    meshing::write_vtu(mesh, folder / "w.vtu");
    return {single("w.vtu", bytes_at(folder / "w.vtu")), single("a.vtu", vtu("", nodes_text, corners_text, "ascii")),
            single("b.vtu", vtu(" header_type=\"UInt32\"", plain(raw(nodes)), plain(raw(corners)), "binary")),
            single("z.vtu", vtu(" header_type=\"UInt32\" compressor=\"vtkZLibDataCompressor\"", compressed(raw(nodes)),
                                compressed(raw(corners)), "binary"))};
}

std::vector<Seed> msh_seeds(const std::filesystem::path&) {
    return {single("old.msh",
                   "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 9 \"skin\"\n3 7 \"lobe\"\n"
                   "$EndPhysicalNames\n$Nodes\n6\n10 0 0 0\n11 10 0 0\n12 0 10 0\n13 0 0 10\n14 10 10 10\n"
                   "15 99 99 99\n$EndNodes\n$Elements\n3\n1 2 2 9 1 10 11 12\n2 4 2 7 1 10 11 12 13\n"
                   "3 4 2 0 5 11 14 12 13\n$EndElements\n"),
            single("new.msh",
                   "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n1 0 0 2\n1 0 0 0 0\n"
                   "1 0 0 0 10 10 10 1 7 0\n2 0 0 0 10 10 10 0 0\n$EndEntities\n$Nodes\n2 5 10 14\n"
                   "2 1 0 2\n10\n11\n0 0 0\n10 0 0\n3 1 0 3\n12\n13\n14\n0 10 0\n0 0 10\n10 10 10\n"
                   "$EndNodes\n$Elements\n3 3 1 3\n2 1 2 1\n1 10 11 12\n3 1 4 1\n2 10 11 12 13\n"
                   "3 2 4 1\n3 11 14 12 13\n$EndElements\n")};
}

std::vector<Seed> inp_seeds(const std::filesystem::path&) {
    return {single("a.inp",
                   "*Heading\n** by hand\n*Node, nset=all\n1, 0., 0., 0.\n2, 10., 0., 0.\n 3, 0., 10., 0.\n"
                   "4, 0., 0., 1e1\n5, 10., 10., 10.\n*ELEMENT, TYPE=S3, ELSET=skin\n1, 1, 2, 3\n"
                   "*Element, type=C3D4, elset=Liver\n2, 1, 2, 3, 4\n*Element, type=C3D4, elset=Tumour\n"
                   "3, 2, 5, 3, 4\n*End Part\n")};
}

}  // namespace

std::vector<Format> mesh_formats() {
    return {
        {"vtu", vtu_seeds, read_vtu, appended_fields}, {"msh", msh_seeds, read_mesh}, {"inp", inp_seeds, read_mesh}};
}

}  // namespace tissuewarp::fuzz
