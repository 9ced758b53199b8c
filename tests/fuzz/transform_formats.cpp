// Transforms of other programs: text, matrices, Matlab, HDF5, fields.

#include "imaging/image_io.hpp"
#include "registration/io/point_map.hpp"
#include "tests/fuzz/format.hpp"
#include "tests/fuzz/hdf5_edits.hpp"

#include <hdf5.h>

#include <cstring>

namespace tissuewarp::fuzz {

namespace {

void read_transform(const std::filesystem::path& path, Digest& digest) {
    const registration::PointMap map = registration::read_point_map(path);
    digest.matrix(map.before.matrix());
    digest.matrix(map.after.matrix());
    if (map.field) digest.voxels(map.field->voxels);
}

std::vector<Seed> text_seeds(const std::filesystem::path&) {
    const std::string head = "#Insight Transform File V1.0\n#Transform 0\n";
    return {single("a.tfm", head + "Transform: AffineTransform_double_3_3\nParameters: 1 0 0 0 1 0 0 0 1 5 -3 2.5\n"
                                   "FixedParameters: 1 2 3\n"),
            single("c.txt", head + "Transform: CompositeTransform_double_3_3\n#Transform 1\n"
                                   "Transform: Euler3DTransform_double_3_3\nParameters: 0.1 0.2 0 1 2 3\n"
                                   "FixedParameters: 0 0 0 0\n#Transform 2\n"
                                   "Transform: Similarity3DTransform_double_3_3\nParameters: 0 0 0.1 1 2 3 1.1\n"
                                   "FixedParameters: 0 0 0\n"),
            single("m.txt", "1 0 0 5\n0 1 0 -3\n0 0 1 2.5\n0 0 0 1\n"),
            single("n.txt", "[[1, 0, 0, 5],\n [0, 1, 0, -3],\n [0, 0, 1, 2.5],\n [0, 0, 0, 1]]\n")};
}

/// An array of Matlab's level 4.
std::string matlab_array(const std::string& name, const std::vector<double>& values) {
    const std::array<std::int32_t, 5> header{0, static_cast<std::int32_t>(values.size()), 1, 0,
                                             static_cast<std::int32_t>(name.size()) + 1};
    return std::string(reinterpret_cast<const char*>(header.data()), sizeof header) + name + '\0' +
           std::string(reinterpret_cast<const char*>(values.data()), 8 * values.size());
}

std::vector<Seed> matlab_seeds(const std::filesystem::path&) {
    return {single("a.mat", matlab_array("AffineTransform_double_3_3", {1, 0, 0, 0, 1, 0, 0, 0, 1, 5, -3, 2.5}) +
                                matlab_array("fixed", {1, 2, 3})),
            single("e.mat", matlab_array("Euler3DTransform_double_3_3", {0.1, 0.2, 0.3, 1, 2, 3}) +
                                matlab_array("fixed", {0, 0, 0}))};
}

std::vector<Field> matlab_fields(const std::string&) {
    std::vector<Field> fields;
    for (std::size_t at = 0; at < 20; at += 4) fields.push_back({at, 4, false});
    for (std::size_t at = 143; at < 163; at += 4) fields.push_back({at, 4, false});
    return fields;
}

void put_numbers(hid_t file, const std::string& name, const std::vector<double>& values) {
    const hsize_t count = values.size();
    const hid_t space = H5Screate_simple(1, &count, nullptr);
    const hid_t set = H5Dcreate2(file, name.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    H5Dclose(set);
    H5Sclose(space);
}

void put_text(hid_t file, const std::string& name, const std::string& text) {
    const hsize_t count = 1;
    const hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate_simple(1, &count, nullptr);
    H5Tset_size(type, H5T_VARIABLE);
    const hid_t set = H5Dcreate2(file, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const char* bytes = text.c_str();
    H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, static_cast<const void*>(&bytes));
    H5Dclose(set);
    H5Sclose(space);
    H5Tclose(type);
}

/// As itk::HDF5TransformIO writes a composition of an affine transform and a field of 2 × 2 × 2.
std::vector<Seed> hdf5_seeds(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / "composite.h5";
    const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    for (const char* group : {"/TransformGroup", "/TransformGroup/0", "/TransformGroup/1", "/TransformGroup/2"})
        H5Gclose(H5Gcreate2(file, group, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    put_text(file, "/TransformGroup/0/TransformType", "CompositeTransform_double_3_3");
    put_text(file, "/TransformGroup/1/TransformType", "AffineTransform_double_3_3");
    put_numbers(file, "/TransformGroup/1/TransformParameters", {1, 0, 0, 0, 1, 0, 0, 0, 1, 5, -3, 2.5});
    put_numbers(file, "/TransformGroup/1/TransformFixedParameters", {0, 0, 0});
    put_text(file, "/TransformGroup/2/TransformType", "DisplacementFieldTransform_double_3_3");
    put_numbers(file, "/TransformGroup/2/TransformFixedParameters",
                {2, 2, 2, 0, 0, 0, 2, 2, 2, 1, 0, 0, 0, 1, 0, 0, 0, 1});
    put_numbers(file, "/TransformGroup/2/TransformParameters", std::vector<double>(24, 0.5));
    H5Fclose(file);
    copy_without_seal(path, folder / "checked.h5", true);
    return {single("composite.h5", bytes_at(path)), single("checked.h5", bytes_at(folder / "checked.h5"))};
}

std::vector<Seed> field_seeds(const std::filesystem::path& folder) {
    imaging::Geometry grid;
    grid.size = {4, 3, 3};
    grid.spacing = {5, 5, 5};
    imaging::Volume field(grid, CV_32FC3);
    for (int i = 0; i < 108; ++i) field.data<float>()[i] = 0.01F * static_cast<float>(i);
    std::vector<Seed> seeds;
    for (const char* name : {"f.nii", "f.nrrd", "f.mha"}) {
        imaging::write_volume(field, folder / name);
        seeds.push_back(single(name, bytes_at(folder / name)));
    }
    return seeds;
}

}  // namespace

std::vector<Format> transform_formats() {
    return {{"transform-text", text_seeds, read_transform},
            {"transform-matlab", matlab_seeds, read_transform, matlab_fields},
            {"transform-hdf5", hdf5_seeds, read_transform, {}, edit_hdf5},
            {"transform-field", field_seeds, read_transform}};
}

}  // namespace tissuewarp::fuzz
