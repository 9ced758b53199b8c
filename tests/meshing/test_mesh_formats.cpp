#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "scratch_folder.hpp"

#include <gmock/gmock.h>

namespace tissuewarp::meshing {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

using MeshFormats = ScratchFolder;

const char* const gmsh_2 = R"($MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
2 9 "skin"
3 7 "left lobe"
$EndPhysicalNames
$Nodes
6
10 0 0 0
11 10 0 0
12 0 10 0
13 0 0 10
14 10 10 10
15 99 99 99
$EndNodes
$Elements
3
1 2 2 9 1 10 11 12
2 4 2 7 1 10 11 12 13
3 4 2 0 5 11 14 12 13
$EndElements
)";

const char* const gmsh_4 = R"($MeshFormat
4.1 0 8
$EndMeshFormat
$Entities
1 0 0 2
1 0 0 0 0
1 0 0 0 10 10 10 1 7 0
2 0 0 0 10 10 10 0 0
$EndEntities
$Nodes
2 5 10 14
2 1 0 2
10
11
0 0 0
10 0 0
3 1 0 3
12
13
14
0 10 0
0 0 10
10 10 10
$EndNodes
$Elements
3 3 1 3
2 1 2 1
1 10 11 12
3 1 4 1
2 10 11 12 13
3 2 4 1
3 11 14 12 13
$EndElements
)";

const char* const abaqus = R"(*Heading
** made by hand
*Node, nset=all
1, 0., 0., 0.
2, 10., 0., 0.
 3, 0., 10., 0.
4, 0., 0., 1e1
5, 10., 10., 10.
*ELEMENT, TYPE=S3, ELSET=skin
1, 1, 2, 3
*Element, type=C3D4, elset=Liver
2, 1, 2, 3, 4
*Element, type=C3D4, elset=Tumour
3, 2, 5, 3, 4
*Nset, nset=held
1, 2
)";

std::string refusal(const std::filesystem::path& path) {
    try {
        (void)read_tetrahedra(path);
    } catch (const Error& problem) {
        return problem.what();
    }
    return {};
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
}

void expect_two_tetrahedra(const TetMesh& mesh) {
    EXPECT_EQ(mesh.node_count(), 5);
    ASSERT_EQ(mesh.tet_count(), 2);
    EXPECT_NEAR(tet_volumes(mesh)[0], 1000.0 / 6, 1e-9);
    EXPECT_EQ(mesh.nodes.col(mesh.tets(1, 1)), Eigen::Vector3d(10, 10, 10));
}

TEST_F(MeshFormats, GmshTwoHasGroupsOrVolumesAsLabels) {
    const MeshFile read = read_tetrahedra(file("a.msh", gmsh_2));
    expect_two_tetrahedra(read.mesh);
    EXPECT_THAT(read.mesh.labels, ElementsAre(7, 5));
    EXPECT_THAT(read.label_names, ElementsAre(Pair(7, "left lobe")));
    EXPECT_THAT(read.notes, ElementsAre(HasSubstr("1 nodes that no tetrahedron uses")));
}

TEST_F(MeshFormats, GmshFourLikewise) {
    const MeshFile read = read_tetrahedra(file("a.msh", gmsh_4));
    expect_two_tetrahedra(read.mesh);
    EXPECT_THAT(read.mesh.labels, ElementsAre(7, 2));
    EXPECT_THAT(read.notes, IsEmpty());
}

TEST_F(MeshFormats, AbaqusHasElementSetsAsLabels) {
    const MeshFile read = read_tetrahedra(file("a.inp", abaqus));
    expect_two_tetrahedra(read.mesh);
    EXPECT_THAT(read.mesh.labels, ElementsAre(1, 2));
    EXPECT_THAT(read.label_names, ElementsAre(Pair(1, "Liver"), Pair(2, "Tumour")));
}

TEST_F(MeshFormats, AbaqusHasSetsOfElsetAsLabels) {
    const std::string one = replaced(replaced(abaqus, ", elset=Liver", ""), "*Element, type=C3D4, elset=Tumour\n", "");
    const std::string liver = "*Elset, elset=Liver, generate\n 2, 2, 1\n", tumour = "*ELSET, ELSET=Tumour\n3,\n",
                      both = "*Elset, elset=all\n2, 3\n";
    const MeshFile read = read_tetrahedra(file("a.inp", one + both + liver + tumour));
    EXPECT_THAT(read.mesh.labels, ElementsAre(2, 3));
    EXPECT_THAT(read.label_names, ElementsAre(Pair(2, "Liver"), Pair(3, "Tumour")));
    EXPECT_THAT(read.notes, ElementsAre(HasSubstr("are its labels: Liver, Tumour")));
    const std::string again = "*Elset, elset=Held\n2\n", section = "*Solid Section, elset=LIVER, material=M\n1.\n";
    EXPECT_THAT(refusal(file("b.inp", one + liver + again)), HasSubstr("element 2 in the sets Liver and Held"));
    EXPECT_THAT(read_tetrahedra(file("c.inp", one + liver + again + section)).mesh.labels, ElementsAre(2, 1));
    EXPECT_THAT(refusal(file("d.inp", one + "*Elset, elset=E\nLiver, Tumour\n")), HasSubstr("set E made of others"));
    const MeshFile known = read_tetrahedra(file("e.inp", abaqus + again));
    EXPECT_THAT(known.mesh.labels, ElementsAre(1, 2));
    EXPECT_THAT(known.notes, ElementsAre(HasSubstr("passed over: Held")));
}

TEST_F(MeshFormats, AbaqusFilesWhosePartsLieElsewhereAreRefused) {
    const std::string instance = std::string(abaqus) + "*Instance, name=a, part=b\n";
    EXPECT_THAT(refusal(file("a.inp", instance + "6., 0., 0.\n*End Instance\n")), HasSubstr("an *INSTANCE with '6."));
    EXPECT_EQ(refusal(file("b.inp", instance + "0., 0., 0.\n*End Instance\n")), "");
    EXPECT_THAT(refusal(file("c.inp", replaced(abaqus, "nset=all", "system=C"))), HasSubstr("'*Node, system=C'"));
    EXPECT_THAT(refusal(file("d.inp", std::string("*INCLUDE, INPUT=nodes.inp\n") + abaqus)),
                HasSubstr("'*INCLUDE, INPUT=nodes.inp'"));
    EXPECT_THAT(refusal(file("e.inp", std::string(abaqus) + "*Ngen\n1, 5, 1\n")), HasSubstr("*Ngen; write them all"));
}

TEST_F(MeshFormats, MeshesThatAreAllInvertedAreTurned) {
    const std::string inverted = replaced(replaced(abaqus, "1, 2, 3, 4\n", "2, 1, 3, 4\n"), "2, 5, 3, 4", "5, 2, 3, 4");
    const MeshFile read = read_tetrahedra(file("a.inp", inverted));
    EXPECT_GT(tet_volumes(read.mesh).minCoeff(), 0);
    EXPECT_THAT(read.notes, ElementsAre(HasSubstr("turned")));
}

TEST_F(MeshFormats, WhatCannotBeUsedIsRefusedWithTheReason) {
    EXPECT_THAT(refusal(file("a.inp", replaced(abaqus, "2, 5, 3, 4", "5, 2, 3, 4"))), HasSubstr("1 inverted elements"));
    EXPECT_THAT(refusal(file("b.inp", replaced(abaqus, "2, 5, 3, 4", "2, 8, 3, 4"))), HasSubstr("uses node 8"));
    EXPECT_THAT(refusal(file("c.inp", replaced(abaqus, "type=C3D4", "type=C3D10"))), HasSubstr("C3D4"));
    EXPECT_THAT(refusal(file("d.inp", replaced(abaqus, "5, 10.", "1, 10."))), HasSubstr("gives node 1 twice"));
    EXPECT_THAT(refusal(file("e.inp", "*Node\n1, 0, 0, 0\n")), HasSubstr("no linear tetrahedra"));
    EXPECT_THAT(refusal(file("a.msh", replaced(gmsh_2, "2.2 0", "4.0 0"))), HasSubstr("format 4.0"));
    EXPECT_THAT(refusal(file("b.msh", replaced(gmsh_2, "2.2 0", "2.2 1"))), HasSubstr("binary"));
    EXPECT_THAT(refusal(file("c.msh", replaced(gmsh_2, "3 4 2 0", "3 11 2 0"))), HasSubstr("type 11"));
    EXPECT_THAT(refusal(file("d.msh", replaced(gmsh_2, "$EndElements", ""))), HasSubstr("ends before $EndElements"));
    EXPECT_THAT(refusal(file("a.step", "")), HasSubstr(".vtu, .msh and .inp"));
}

}  // namespace
}  // namespace tissuewarp::meshing
