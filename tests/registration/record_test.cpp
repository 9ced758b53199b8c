/// Records and prepared models survive the disk bit by bit, and what is damaged or foreign is refused in words.
#include "registration/record.hpp"
#include "core/detail/hdf5_seal.hpp"
#include "registration/io/stored_model.hpp"
#include "registration/prepared/prepared_io.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/folders.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cstdlib>
#include <fstream>
#include <limits>

namespace tissuewarp::registration {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A box of two labels, 6 × 4 × 4 cells of 5 mm, in an oblique label map.
PreparedModel prepared_box() {
    meshing::TetMesh mesh = test::box_at({-15, -10, -10}, {30, 20, 20}, {6, 4, 4}, 0.1);
    for (int tet = 0; tet < mesh.tet_count(); ++tet) mesh.labels[tet] = mesh.nodes(0, mesh.tets(0, tet)) < -1 ? 1 : 7;
    imaging::Volume labels(test::oblique_grid({0, 0, 0}, {31, 23, 21}, {1.5, 1.6, 1.7}), CV_32SC1);
    test::for_each_voxel(labels, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        const Eigen::Vector3d p = labels.geometry.point(index);
        const bool inside = (p.cwiseAbs().array() < Eigen::Array3d(15, 10, 10)).all();
        labels.data<int>()[offset] = inside ? (p[0] < 0 ? 1 : 7) : 0;
    });
    PrepareOptions options;
    options.materials[7] = tled::neo_hookean_iso(9.1, 0.31);
    options.default_material = tled::neo_hookean_lnj(3.3, 0.49);
    options.meshing.label_edge_length[7] = 3.25;
    options.meshing.labels = {1, 7};
    options.data_stiffness = 2.7;
    options.tangential_ratio = 0.013;
    return prepare(std::move(mesh), labels, options);
}

const PreparedModel& prepared() {
    static const PreparedModel model = prepared_box();
    return model;
}

UpdateResult some_result() {
    UpdateResult result;
    result.deformation = test::deformed_by(prepared().model.mesh, [](const Eigen::Vector3d& p) {
        return Eigen::Vector3d(0.1 * p[0], 0.3 * std::sin(p[1] / 7), -0.05 * p[2] + 1e-300);
    });
    result.deformation.placement = test::motion(12.0, {1, 2, 3}, {4.0, -5.5, 1.0 / 3.0});
    result.alignment = {result.deformation.placement, 0.731};
    result.rounds = {{15.0, 120, 150, 11, 1.25, 6.0, 900, 0.04}, {4.0, 140, 150, 0, 0.5, 0.1, 400, 0.02}};
    result.engine = "CPU, 2 threads";
    result.times = {{"alignment", 1.5}, {"round 1", 0.25}};
    result.doubts = {{"labels.unmatched", 0.8, 1, "only 80 % of the boundary was matched"}};
    return result;
}

RecordInfo some_info() {
    return {{{"input/moving_labels", std::string(64, 'a')}, {"device", "llvmpipe µ"}},
            "[meshing]\nedge_length = 5.0  # \"mm\"\n"};
}

class Records : public testing::Test {
protected:
    fs::path folder = fs::path(testing::TempDir()) /
                      (std::string("records-") + testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::path path = folder / "record.h5";
    void SetUp() override { fs::create_directories(folder); }
    void TearDown() override { fs::remove_all(folder); }

    void write() const { write_record(prepared(), some_result(), some_info(), path); }

    /// Changes one value of a dataset behind the writer's back.
    template <class T>
    void poke(const char* dataset, std::size_t index, T value) const {
        const hid_t type = std::is_same_v<T, double> ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT;
        const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
        const hid_t data = H5Dopen2(file, dataset, H5P_DEFAULT);
        const hid_t space = H5Dget_space(data);
        std::vector<T> values(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
        ASSERT_GE(H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
        values.at(index) = value;
        ASSERT_GE(H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
        H5Sclose(space);
        H5Dclose(data);
        H5Fclose(file);
        seal_hdf5(path);
    }

    void set_version(int version) const {
        const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
        const hid_t attribute = H5Aopen(file, "format_version", H5P_DEFAULT);
        ASSERT_GE(H5Awrite(attribute, H5T_NATIVE_INT, &version), 0);
        H5Aclose(attribute);
        H5Fclose(file);
        seal_hdf5(path);
    }

    /// Materials as version 1 had them: the moduli of the two neo-Hookean laws.
    void make_materials_old(const std::string& group) const {
        const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
        const hid_t data = H5Dopen2(file, (group + "/parameters").c_str(), H5P_DEFAULT);
        const hid_t space = H5Dget_space(data);
        std::vector<double> values(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
        ASSERT_GE(H5Dread(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
        H5Sclose(space);
        H5Dclose(data);
        const hsize_t laws = values.size() / 8;
        for (const auto& [name, place] : {std::pair{"/shear_modulus", 0}, std::pair{"/volumetric_modulus", 1}}) {
            std::vector<double> moduli(laws);
            for (std::size_t n = 0; n < laws; ++n) moduli[n] = values[8 * n + static_cast<std::size_t>(place)];
            const hid_t row = H5Screate_simple(1, &laws, nullptr);
            const hid_t written =
                H5Dcreate2(file, (group + name).c_str(), H5T_NATIVE_DOUBLE, row, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
            ASSERT_GE(H5Dwrite(written, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, moduli.data()), 0);
            H5Dclose(written);
            H5Sclose(row);
        }
        ASSERT_GE(H5Ldelete(file, (group + "/parameters").c_str(), H5P_DEFAULT), 0);
        H5Fclose(file);
        seal_hdf5(path);
    }

    void remove_dataset(const char* name) const {
        const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
        ASSERT_GE(H5Ldelete(file, name, H5P_DEFAULT), 0);
        H5Fclose(file);
        seal_hdf5(path);
    }
};

TEST_F(Records, ComeBackBitByBit) {
    write();
    const Record record = read_record(path);
    const UpdateResult result = some_result();
    EXPECT_EQ(record.format_version, 2);
    EXPECT_EQ(record.deformation.mesh.nodes, prepared().model.mesh.nodes);
    EXPECT_EQ(record.deformation.mesh.tets, prepared().model.mesh.tets);
    EXPECT_EQ(record.deformation.mesh.labels, prepared().model.mesh.labels);
    EXPECT_EQ(record.deformation.displacement, result.deformation.displacement);
    EXPECT_EQ(record.deformation.placement.matrix(), result.deformation.placement.matrix());
    EXPECT_EQ(record.element, prepared().model.element);
    EXPECT_EQ(record.provenance, some_info().provenance);
    EXPECT_EQ(record.parameters_toml, some_info().parameters_toml);
    EXPECT_EQ(record.moving_grid.size, prepared().labels.geometry.size);
    EXPECT_EQ(record.moving_grid.origin, prepared().labels.geometry.origin);
    EXPECT_EQ(record.moving_grid.spacing, prepared().labels.geometry.spacing);
    EXPECT_EQ(record.moving_grid.direction, prepared().labels.geometry.direction);
    ASSERT_EQ(record.materials.size(), 2u);
    const auto& soft = std::get<tled::NeoHookeanLnJ>(record.materials.at(1));
    const auto& stiff = std::get<tled::NeoHookeanIso>(record.materials.at(7));
    EXPECT_EQ(soft.lame_lambda, std::get<tled::NeoHookeanLnJ>(prepared().model.materials.at(1)).lame_lambda);
    EXPECT_EQ(stiff.bulk_modulus, std::get<tled::NeoHookeanIso>(prepared().model.materials.at(7)).bulk_modulus);
    EXPECT_EQ(stiff.shear_modulus, std::get<tled::NeoHookeanIso>(prepared().model.materials.at(7)).shear_modulus);
}

TEST_F(Records, HoldHowTheSurroundingsMoved) {
    UpdateResult result = some_result();
    imaging::Volume mask(test::oblique_grid({1, 2, 3}, {13, 7, 5}, {1.1, 1.3, 0.9}), CV_8UC1);
    cv::RNG random(4);
    for (std::int64_t n = 0; n < mask.geometry.voxel_count(); ++n)
        mask.data<std::uint8_t>()[n] = random.uniform(0.0, 1.0) < 0.4;
    mask.data<std::uint8_t>()[0] = 1;  // the run of 0 that begins is empty
    result.deformation.surroundings = {test::motion(11.0, {1, 2, 3}, {4.5, -5.5, 1.0 / 3.0}), mask};
    write_record(prepared(), result, some_info(), path);
    const auto back = read_record(path).deformation.surroundings;
    ASSERT_TRUE(back);
    EXPECT_EQ(back->motion.matrix(), result.deformation.surroundings->motion.matrix());
    EXPECT_TRUE(imaging::same_grid(back->rigid.geometry, mask.geometry, 1e-12));
    EXPECT_EQ(cv::norm(back->rigid.voxels, mask.voxels, cv::NORM_INF), 0);
    EXPECT_FALSE(back->slide);
    EXPECT_EQ(read_record(path).format_version, 2);
    result.deformation.surroundings->slide = true;
    write_record(prepared(), result, some_info(), path);
    EXPECT_TRUE(read_record(path).deformation.surroundings->slide);
    EXPECT_EQ(read_record(path).format_version, 4);  // older programs must not drag along what slides
    for (const int wrong : {-1, 1 << 30, 2}) {
        write_record(prepared(), result, some_info(), path);
        poke<int>("surroundings/runs", 0, wrong);
        EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("do not fill its grid")));
    }
    write_record(prepared(), result, some_info(), path);
    poke<double>("surroundings/motion", 0, 2.0);
    EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("the motion of the surroundings")));
    write();
    EXPECT_FALSE(read_record(path).deformation.surroundings);
}

TEST_F(Records, HoldBodiesThatMovedOnTheirOwn) {
    UpdateResult result = some_result();
    imaging::Volume mask(test::plain_grid({11, 9, 7}), CV_8UC1);
    cv::RNG random(5);
    for (std::int64_t n = 0; n < mask.geometry.voxel_count(); ++n)
        mask.data<std::uint8_t>()[n] = static_cast<std::uint8_t>(random.uniform(0, 4));
    result.deformation.surroundings = {test::motion(11, {1, 2, 3}, {4.5, -5.5, 0.1}), mask};
    result.deformation.surroundings->bodies = {test::motion(3, {0, 1, 0}, {1, 2, 3}),
                                               test::motion(-7, {1, 1, 0}, {0, 0, 1.0 / 3})};
    write_record(prepared(), result, some_info(), path);
    const Record record = read_record(path);
    EXPECT_EQ(record.format_version, 5);  // older programs must not leave bones where the organ goes
    const Surroundings& back = *record.deformation.surroundings;
    ASSERT_EQ(back.bodies.size(), 2u);
    for (std::size_t n = 0; n < 2; ++n)
        EXPECT_EQ(back.bodies[n].matrix(), result.deformation.surroundings->bodies[n].matrix());
    EXPECT_EQ(cv::norm(back.rigid.voxels, mask.voxels, cv::NORM_INF), 0);
    poke<int>("surroundings/values", 0, 4);
    EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("do not fill its grid")));
    write_record(prepared(), result, some_info(), path);
    poke<double>("surroundings/body 1", 0, 2.0);
    EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("of a rigid neighbour")));
}

TEST_F(Records, OfTheFirstVersionAreRead) {
    write();
    make_materials_old("materials");
    set_version(1);
    const Record record = read_record(path);
    EXPECT_EQ(record.format_version, 1);
    for (const auto& [label, material] : prepared().model.materials) {
        EXPECT_EQ(tled::law_name(record.materials.at(label)), tled::law_name(material));
        EXPECT_EQ(tled::law_parameters(record.materials.at(label)), tled::law_parameters(material));
    }
}

TEST_F(Records, HoldEveryLaw) {
    const tled::MaterialTable materials{
        {0, tled::NeoHookeanStable{1.0, 49.0}},
        {1, tled::Polynomial{0.3, 0.15, 0.08, 0.06, 0.04, 0.02, 50.0}},
        {2, tled::ArrudaBoyce{1.0, 1.1, 50.0}},
        {5, tled::Ogden{{tled::OgdenTerm{0.8, 2.5}, tled::OgdenTerm{-0.3, -3.0}}, 50.0}},
        {9, tled::TransverselyIsotropic{1.0, 50.0, 2.0, Eigen::Vector3d::UnitY()}},
    };
    {
        Hdf5Output file(path, "materials", 1);
        detail::write_materials(file, "materials", materials);
        file.close();
    }
    const Hdf5Input file(path, "materials", 1, 1);
    EXPECT_EQ(detail::read_materials(file, "materials"), materials);
}

TEST_F(Records, RefuseModelsThatTheyCannotHold) {
    tled::Model viscous = prepared().model, fibrous = viscous;
    viscous.viscosity[1] = {{{0.3, 1.0}}};
    fibrous.fibre = Eigen::Matrix3Xd::Constant(3, fibrous.mesh.tet_count(), std::sqrt(1.0 / 3));
    for (const tled::Model& model : {viscous, fibrous}) {
        Hdf5Output file(path, "model", 1);
        EXPECT_THROW(detail::write_model(file, model), InvalidInput);
    }
}

TEST_F(Records, HoldTheJacobianOfAnAffineMap) {
    UpdateResult result = some_result();
    result.deformation = test::deformed_by(prepared().model.mesh, [](const Eigen::Vector3d& p) {
        return Eigen::Vector3d(0.1 * p[0] + 0.2 * p[1], -0.05 * p[1], 0.02 * p[2]);
    });
    write_record(prepared(), result, some_info(), path);
    const Record record = read_record(path);
    ASSERT_EQ(record.jacobian.size(), prepared().model.mesh.tet_count());
    const double expected = 1.1 * 0.95 * 1.02;
    EXPECT_LT((record.jacobian.array() - expected).abs().maxCoeff(), 1e-12);
}

TEST_F(Records, OfEmptyListsComeBack) {
    UpdateResult result = some_result();
    result.rounds.clear();
    result.doubts.clear();
    write_record(prepared(), result, {}, path);
    EXPECT_TRUE(read_record(path).provenance.empty());
}

TEST_F(Records, LeaveNothingBesideThem) {
    write();
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);
}

TEST_F(Records, AreRefusedAtEveryTruncation) {
    write();
    const auto whole = fs::file_size(path);
    for (const double part : {0.0, 0.01, 0.3, 0.7, 0.999}) {
        write();
        fs::resize_file(path, static_cast<std::uintmax_t>(part * static_cast<double>(whole)));
        EXPECT_THROW(read_record(path), IoError) << part;
    }
}

TEST_F(Records, WithAFlippedByteAreRefused) {
    write();
    // Somewhere in the compressed nodes: the checksum tells.
    const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    const hid_t data = H5Dopen2(file, "mesh/nodes", H5P_DEFAULT);
    haddr_t address = 0;
    hsize_t bytes = 0, offset[2];
    unsigned filters = 0;
    const hid_t space = H5Dget_space(data);
    ASSERT_GE(H5Dget_chunk_info(data, space, 0, offset, &filters, &address, &bytes), 0);
    H5Sclose(space);
    H5Dclose(data);
    H5Fclose(file);
    std::fstream stream(path, std::ios::in | std::ios::out | std::ios::binary);
    const auto place = static_cast<std::streamoff>(address + bytes / 2);
    stream.seekg(place);
    const int byte = stream.get();
    stream.seekp(place);
    stream.put(static_cast<char>(byte ^ 1));
    stream.close();
    EXPECT_THROW(read_record(path), IoError);
}

TEST_F(Records, WithoutASealAreReadWhereTheirStructureIsSound) {
    const fs::path old = folder / "old.h5";
    const auto copy = [&] {  // as versions before the seal wrote them
        const hid_t from = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT),
                    to = H5Fcreate(old.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
        for (const char* name : {"mesh", "displacement"}) H5Ocopy(from, name, to, name, H5P_DEFAULT, H5P_DEFAULT);
        H5Fclose(to);
        H5Fclose(from);
    };
    write();
    copy();
    EXPECT_NO_THROW(require_unbroken_hdf5(old));
    const auto size = fs::file_size(old);
    std::ifstream stream(old, std::ios::binary);
    std::string bytes(size, '\0');
    stream.read(bytes.data(), static_cast<std::streamsize>(size));
    const std::size_t tree = bytes.find("TREE"), heap = bytes.find("HEAP");
    for (const std::size_t place : {std::size_t{40}, tree, heap, heap + 8, heap + 24}) {
        std::string damaged = bytes;
        damaged[place] = static_cast<char>(damaged[place] ^ 0x55);
        std::ofstream(old, std::ios::binary) << damaged;
        EXPECT_THROW(require_unbroken_hdf5(old), IoError) << place;
    }
}

TEST_F(Records, OfForeignFormatsAreRefused) {
    std::ofstream(path) << "not HDF5";
    EXPECT_THROW(read_record(path), IoError);
    EXPECT_THROW(read_record(folder / "missing.h5"), IoError);
    EXPECT_THROW(read_record(folder), IoError);
    H5Fclose(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT));
    EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("no file of tissuewarp")));
    write_prepared(prepared(), path);
    EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("a tissuewarp prepared model")));
}

TEST_F(Records, OfANewerVersionAreRefused) {
    write();
    set_version(6);
    EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("format version 6")));
}

TEST_F(Records, WithNodeIndicesOutOfRangeAreRefused) {
    for (const int index : {-1, prepared().model.mesh.node_count()}) {
        write();
        poke<int>("mesh/tetrahedra", 5, index);
        EXPECT_THROW(read_record(path), InvalidInput) << index;
    }
}

TEST_F(Records, WithValuesThatAreNotFiniteAreRefused) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    for (const char* name : {"mesh/nodes", "displacement", "placement", "jacobian", "materials/parameters"}) {
        write();
        poke<double>(name, 1, nan);
        EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr(name)));
    }
}

TEST_F(Records, WithAPlacementThatIsNotRigidAreRefused) {
    write();
    poke<double>("placement", 0, 2.0);
    EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("rigid")));
}

TEST_F(Records, WithoutOneOfTheirPartsAreRefused) {
    for (const char* name : {"mesh/labels", "displacement", "moving_grid/origin", "provenance/value", "element"}) {
        write();
        remove_dataset(name);
        EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr(name)));
    }
}

TEST_F(Records, OfPartsThatDisagreeInSizeAreRefused) {
    write();
    remove_dataset("displacement");
    const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hsize_t shape[] = {4, 3};
    const double zeros[12] = {};
    const hid_t space = H5Screate_simple(2, shape, nullptr);
    const hid_t data =
        H5Dcreate2(file, "displacement", H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    ASSERT_GE(H5Dwrite(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, zeros), 0);
    H5Dclose(data);
    H5Sclose(space);
    H5Fclose(file);
    seal_hdf5(path);
    EXPECT_THAT([&] { read_record(path); }, ThrowsMessage<InvalidInput>(HasSubstr("4 nodes")));
}

TEST_F(Records, AreNotWrittenOfResultsThatAreNotFinite) {
    UpdateResult result = some_result();
    result.deformation.displacement(1, 3) = std::numeric_limits<double>::infinity();
    EXPECT_THROW(write_record(prepared(), result, some_info(), path), InvalidInput);
    EXPECT_FALSE(fs::exists(path));
}

TEST_F(Records, AreNotWrittenIntoMissingFolders) {
    EXPECT_THROW(write_record(prepared(), some_result(), some_info(), folder / "none" / "r.h5"), IoError);
}

TEST_F(Records, AreReadByH5py) {
    if (std::system("/usr/bin/python3 -c 'import h5py, numpy' 2>/dev/null") != 0) GTEST_SKIP() << "no h5py";
    write();
    const std::string script = (tissuewarp::test::source_folder() / "tests/registration/check_record.py").string();
    const UpdateResult result = some_result();
    std::ofstream expected(folder / "expected.txt");
    expected.precision(17);
    expected << prepared().model.mesh.node_count() << ' ' << prepared().model.mesh.tet_count() << '\n'
             << prepared().model.mesh.nodes.transpose() << '\n'
             << result.deformation.displacement.transpose() << '\n'
             << result.deformation.placement.matrix() << '\n';
    expected.close();
    EXPECT_EQ(
        std::system(
            ("/usr/bin/python3 " + script + " " + path.string() + " " + (folder / "expected.txt").string()).c_str()),
        0);
}

TEST_F(Records, PreparedModelsComeBack) {
    write_prepared(prepared(), path);
    const PreparedModel back = read_prepared(path);
    const PreparedModel& model = prepared();
    EXPECT_EQ(back.model.mesh.nodes, model.model.mesh.nodes);
    EXPECT_EQ(back.model.mesh.tets, model.model.mesh.tets);
    EXPECT_EQ(back.model.mesh.labels, model.model.mesh.labels);
    EXPECT_EQ(back.model.element, model.model.element);
    EXPECT_EQ(back.labels.geometry.direction, model.labels.geometry.direction);
    EXPECT_EQ(back.labels.geometry.origin, model.labels.geometry.origin);
    EXPECT_EQ(cv::norm(back.labels.voxels, model.labels.voxels, cv::NORM_INF), 0.0);
    EXPECT_EQ(back.options.data_stiffness, model.options.data_stiffness);
    EXPECT_EQ(back.options.tangential_ratio, model.options.tangential_ratio);
    EXPECT_EQ(back.options.meshing.label_edge_length, model.options.meshing.label_edge_length);
    EXPECT_EQ(back.options.meshing.labels, model.options.meshing.labels);
    EXPECT_EQ(tled::shear_modulus(back.options.default_material), tled::shear_modulus(model.options.default_material));
    ASSERT_EQ(back.interfaces.nodes().size(), model.interfaces.nodes().size());
    EXPECT_EQ(back.stiffness.factor_nonzeros(), model.stiffness.factor_nonzeros());
    const Eigen::Matrix3Xd force = Eigen::Matrix3Xd::Ones(3, model.model.mesh.node_count());
    const Eigen::Matrix3Xd here = model.stiffness.solve(force), there = back.stiffness.solve(force);
    EXPECT_LT((here - there).cwiseAbs().maxCoeff(), 1e-9 * here.cwiseAbs().maxCoeff());
}

TEST_F(Records, PreparedModelsComeBackWithTheirCoarserOnes) {
    PreparedModel model = prepared_box();
    write_prepared(model, path);
    EXPECT_FALSE(read_prepared(path).coarse);
    model.coarse = std::make_unique<PreparedModel>(
        prepare(test::box_at({-15, -10, -10}, {30, 20, 20}, {3, 2, 2}, 0.1), model.labels, model.options));
    write_prepared(model, path);
    const PreparedModel back = read_prepared(path);
    ASSERT_TRUE(back.coarse);
    EXPECT_EQ(back.coarse->model.mesh.nodes, model.coarse->model.mesh.nodes);
    EXPECT_EQ(back.coarse->model.mesh.tets, model.coarse->model.mesh.tets);
    EXPECT_EQ(back.coarse->model.mesh.labels, model.coarse->model.mesh.labels);
    EXPECT_EQ(tled::shear_modulus(back.coarse->model.materials.at(1)),
              tled::shear_modulus(model.model.materials.at(1)));
    poke<int>("coarse_mesh/tetrahedra", 0, 1000000);
    EXPECT_THAT([&] { read_prepared(path); }, ThrowsMessage<InvalidInput>(HasSubstr("coarse_mesh")));
}

TEST_F(Records, PreparedModelsWithAWrongGridAreRefused) {
    write_prepared(prepared(), path);
    poke<int>("moving_labels/grid/size", 0, 1000000);
    EXPECT_THAT([&] { read_prepared(path); }, ThrowsMessage<InvalidInput>(HasSubstr("moving_labels/voxels")));
}

}  // namespace
}  // namespace tissuewarp::registration
