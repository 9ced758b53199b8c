#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"
#include "scratch_folder.hpp"
#include "tests/support/folders.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>

namespace tissuewarp::meshing {
namespace {

using Vtu = ScratchFolder;

TetMesh labelled_box() {
    TetMesh mesh = box_mesh({3, 2, 1}, {3, 2, 2}, 0.1);
    for (int t = 0; t < mesh.tet_count(); ++t) mesh.labels[t] = 1 + t % 4;
    return mesh;
}

void expect_equal(const TetMesh& a, const TetMesh& b) {
    EXPECT_EQ(a.nodes, b.nodes);
    EXPECT_EQ(a.tets, b.tets);
    EXPECT_EQ(a.labels, b.labels);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string ascii_tet(const std::string& nodes = "0 1 2 3", const std::string& points = "0 0 0  1 0 0  0 1 0  0 0 1") {
    return "<?xml version=\"1.0\"?>\n<!-- > a comment < -->\n<VTKFile type='UnstructuredGrid' version='0.1' "
           "byte_order='LittleEndian'>\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\n"
           "<Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">" +
           points +
           "</DataArray></Points>\n<Cells>\n<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">" + nodes +
           "</DataArray>\n<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\"> 4 </DataArray>\n"
           "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray>\n</Cells>\n</Piece>\n"
           "</UnstructuredGrid>\n</VTKFile>\n";
}

TEST_F(Vtu, RoundTripIsExact) {
    const TetMesh mesh = labelled_box();
    write_vtu(mesh, file("box.vtu"), {{"displacement", Eigen::MatrixXd::Random(3, mesh.node_count())}});
    expect_equal(read_vtu(file("box.vtu")), mesh);
}

TEST_F(Vtu, CellArraysAreReadByName) {
    const TetMesh mesh = labelled_box();
    const Eigen::MatrixXd fibre = Eigen::MatrixXd::Random(3, mesh.tet_count());
    write_vtu(mesh, file("box.vtu"), {}, {{"fibre", fibre}, {"J", Eigen::MatrixXd::Ones(1, mesh.tet_count())}});
    EXPECT_LT((read_vtu_cell_array(file("box.vtu"), "fibre") - fibre).norm(), 1e-5) << "float32 in the file";
    EXPECT_EQ(read_vtu_cell_array(file("box.vtu"), "label").cast<int>(), mesh.labels.transpose());
    try {
        read_vtu_cell_array(file("box.vtu"), "fiber");
        FAIL() << "accepted";
    } catch (const InvalidInput& error) {
        EXPECT_THAT(error.what(), ::testing::AllOf(::testing::HasSubstr("'fiber'"), ::testing::HasSubstr("'fibre'")));
    }
}

TEST_F(Vtu, LabelsMayHaveOtherNamesAndArraysThatAreNoneAreNoted) {
    const TetMesh mesh = labelled_box();
    write_vtu(mesh, file("label.vtu"));
    std::ifstream stream(file("label.vtu"), std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(stream), {});
    const auto named = [&](const std::string& name) {
        return read_tetrahedra(file("named.vtu", replaced(bytes, "Name=\"label\"", "Name=\"" + name + "\"")));
    };
    EXPECT_EQ(named("Label").mesh.labels, mesh.labels);
    EXPECT_TRUE(named("Label").notes.empty());
    EXPECT_EQ(named("gmsh:physical").mesh.labels, mesh.labels);
    EXPECT_THAT(named("gmsh:physical").notes, ::testing::Contains(::testing::HasSubstr("'gmsh:physical'")));
    EXPECT_EQ(named("material").mesh.labels, Eigen::VectorXi::Ones(mesh.tet_count()));
    EXPECT_THAT(named("material").notes,
                ::testing::Contains(::testing::HasSubstr("all its tetrahedra have label 1; where 'material' holds")));
}

TEST_F(Vtu, ReadsAsciiWithoutLabels) {
    const TetMesh mesh = read_vtu(file("tet.vtu", ascii_tet()));
    ASSERT_EQ(mesh.tet_count(), 1);
    EXPECT_EQ(mesh.labels[0], 1);
    EXPECT_EQ(mesh.nodes(2, 3), 1.0);
}

TEST_F(Vtu, TurnsAMeshOfTheOtherOrientation) {
    EXPECT_GT(tet_volumes(read_vtu(file("tet.vtu", ascii_tet("1 0 2 3"))))[0], 0.0);
}

TEST_F(Vtu, RefusesWhatItCannotUse) {
    EXPECT_THROW(read_vtu(file("absent.vtu")), IoError);
    EXPECT_THROW(read_vtu(file("empty.vtu", "")), IoError);
    EXPECT_THROW(read_vtu(file("text.vtu", "hello <world>")), IoError);
    EXPECT_THROW(read_vtu(file("index.vtu", ascii_tet("0 1 2 4"))), InvalidInput);
    EXPECT_THROW(read_vtu(file("negative.vtu", ascii_tet("0 1 2 -1"))), InvalidInput);
    EXPECT_THROW(read_vtu(file("fraction.vtu", ascii_tet("0 1 2 2.5"))), InvalidInput);
    EXPECT_THROW(read_vtu(file("nan.vtu", ascii_tet("0 1 2 3", "nan 0 0 1 0 0 0 1 0 0 0 1"))), InvalidInput);
    EXPECT_THROW(read_vtu(file("few.vtu", ascii_tet("0 1 2"))), IoError);
    EXPECT_THROW(read_vtu(file("flat.vtu", ascii_tet("0 1 2 2"))), InvalidInput);
    EXPECT_THROW(read_vtu(file("word.vtu", ascii_tet("0 1 2 x"))), IoError);
    const std::string good = ascii_tet();
    EXPECT_THROW(read_vtu(file("poly.vtu", replaced(good, "'UnstructuredGrid'", "'PolyData'"))), IoError);
    EXPECT_THROW(read_vtu(file("many.vtu", replaced(good, "\"4\"", "\"99999999999999\""))), IoError);
    EXPECT_THROW(read_vtu(file("lz4.vtu", replaced(good, "version='0.1'", "compressor='vtkLZ4DataCompressor'"))),
                 IoError);
}

TEST_F(Vtu, OtherCellsAreRefusedWithTheFileTheirTypeAndARemedy) {
    for (const char* type : {"12", "24"}) {  // linear hexahedra, quadratic tetrahedra
        const auto path = file("cells.vtu", replaced(ascii_tet(), ">10<", std::string(">") + type + "<"));
        try {
            read_vtu(path);
            ADD_FAILURE() << "accepted " << type;
        } catch (const InvalidInput& error) {
            using ::testing::HasSubstr;
            EXPECT_THAT(error.what(), ::testing::AllOf(HasSubstr("cells.vtu"), HasSubstr(std::string("type ") + type),
                                                       HasSubstr("only linear tetrahedra (10)")));
        }
    }
}

TEST_F(Vtu, EveryTruncationIsAnErrorAndNamesTheFile) {
    write_vtu(labelled_box(), file("box.vtu"));
    const std::string whole = bytes_of(file("box.vtu"));
    const std::size_t data = whole.find("<AppendedData");
    ASSERT_NE(data, std::string::npos);
    for (std::size_t length = 0; length < whole.size() - 40; length += 97) {
        try {
            read_vtu(file("cut.vtu", whole.substr(0, length)));
            ADD_FAILURE() << "read a file cut to " << length << " of " << whole.size() << " bytes";
        } catch (const Error& error) {
            ASSERT_THAT(error.what(), testing::HasSubstr("cut.vtu"));
        }
    }
}

TEST_F(Vtu, HugeLengthsAndOffsetsAreErrors) {
    write_vtu(labelled_box(), file("box.vtu"));
    std::string bytes = bytes_of(file("box.vtu"));
    EXPECT_THROW(read_vtu(file("offset.vtu", replaced(bytes, "offset=\"0\"", "offset=\"18446744073709551615\""))),
                 IoError);
    const std::size_t start = bytes.find('_', bytes.find("<AppendedData"));
    for (std::size_t b = 1; b <= 8; ++b) bytes[start + b] = '\xff';
    EXPECT_THROW(read_vtu(file("length.vtu", bytes)), IoError);
}

TEST_F(Vtu, RefusesArraysOfTheWrongLengthAndLeavesNoFile) {
    EXPECT_THROW(write_vtu(labelled_box(), file("box.vtu"), {{"short", Eigen::MatrixXd::Zero(1, 3)}}), InvalidInput);
    EXPECT_THROW(write_vtu(labelled_box(), file("no/such/folder.vtu")), IoError);
    EXPECT_FALSE(std::filesystem::exists(file("box.vtu")));
}

/// Standard output of a command, and whether it succeeded.
std::pair<std::string, bool> run(const std::string& command) {
    std::string output;
    FILE* pipe = ::popen(command.c_str(), "r");
    if (!pipe) return {"", false};
    std::array<char, 256> buffer;
    while (std::fgets(buffer.data(), buffer.size(), pipe)) output += buffer.data();
    return {output, ::pclose(pipe) == 0};
}

bool has_meshio() {
    return run("/usr/bin/python3 -c 'import meshio' 2>&1").second;
}

TEST_F(Vtu, MeshioReadsTheSameNumbers) {
    if (!has_meshio()) GTEST_SKIP() << "python3-meshio is not installed";
    const TetMesh mesh = labelled_box();
    const Eigen::MatrixXd displacement = Eigen::MatrixXd::Random(3, mesh.node_count());
    const Eigen::MatrixXd energy = Eigen::MatrixXd::Random(1, mesh.tet_count());
    write_vtu(mesh, file("box.vtu"), {{"displacement", displacement}}, {{"energy <1>", energy}});
    const auto [output, good] = run(std::string("/usr/bin/python3 ") +
                                    (tissuewarp::test::source_folder() / "tests/meshing/vtu_meshio.py").string() + " " +
                                    file("box.vtu").string());
    ASSERT_TRUE(good) << output;
    std::istringstream numbers(output);
    int points = 0, tets = 0, last = 0, labels = 0;
    double sum = 0, dy = 0, e = 0;
    numbers >> points >> tets >> sum >> last >> labels >> dy >> e;
    EXPECT_EQ(points, mesh.node_count());
    EXPECT_EQ(tets, mesh.tet_count());
    EXPECT_NEAR(sum, mesh.nodes.sum(), 1e-9);
    EXPECT_EQ(last, mesh.tets.col(mesh.tet_count() - 1).sum());
    EXPECT_EQ(labels, mesh.labels.sum());
    EXPECT_NEAR(dy, displacement(1, 3), 1e-6);
    EXPECT_NEAR(e, energy(0, 5), 1e-6);
}

TEST_F(Vtu, ReadsWhatMeshioWrites) {
    if (!has_meshio()) GTEST_SKIP() << "python3-meshio is not installed";
    const TetMesh mesh = labelled_box();
    write_vtu(mesh, file("box.vtu"));
    for (const char* mode : {"binary", "zlib", "ascii"}) {
        const auto [output, good] = run(std::string("/usr/bin/python3 ") +
                                        (tissuewarp::test::source_folder() / "tests/meshing/vtu_meshio.py").string() +
                                        " " + file("box.vtu").string() + " " + file("again.vtu").string() + " " + mode);
        ASSERT_TRUE(good) << output;
        const TetMesh again = read_vtu(file("again.vtu"));
        EXPECT_EQ(again.tets, mesh.tets) << mode;
        EXPECT_EQ(again.labels, mesh.labels) << mode;
        EXPECT_LT((again.nodes - mesh.nodes).cwiseAbs().maxCoeff(), 1e-9) << mode;
    }
}

}  // namespace
}  // namespace tissuewarp::meshing
