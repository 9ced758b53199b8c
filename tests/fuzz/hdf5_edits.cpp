#include "tests/fuzz/hdf5_edits.hpp"

#include "core/detail/hdf5.hpp"
#include "core/detail/hdf5_seal.hpp"

#include <cmath>
#include <limits>

namespace tissuewarp::fuzz {

namespace {

std::vector<std::string> datasets_of(hid_t file) {
    std::vector<std::string> names;
    H5Ovisit(
        file, H5_INDEX_NAME, H5_ITER_INC,
        [](hid_t, const char* name, const H5O_info_t* info, void* found) -> herr_t {
            if (info->type == H5O_TYPE_DATASET) static_cast<std::vector<std::string>*>(found)->emplace_back(name);
            return 0;
        },
        &names);
    return names;
}

double any_value(Random& random) {
    constexpr double values[] = {
        0, 1, -1, 2, 3, 7, 1e-3, 0.5, 1e3, 1e6, 1e12, 1e308, -1e308, 2147483647, -2147483648.0, 4e9, NAN, INFINITY};
    return values[random() % std::size(values)];
}

void change_values(hid_t file, const std::string& name, Random& random) {
    const Hdf5Handle data(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose);
    const Hdf5Handle type(H5Dget_type(data), H5Tclose), space(H5Dget_space(data), H5Sclose);
    const hssize_t count = H5Sget_simple_extent_npoints(space);
    if (count <= 0 || count > 1000000 || H5Tget_class(type) == H5T_STRING) return;
    std::vector<double> values(static_cast<std::size_t>(count));
    H5Dread(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    for (std::size_t left = 1 + random() % 3; left > 0; --left) values[random() % values.size()] = any_value(random);
    if (random() % 8 == 0) values.assign(values.size(), any_value(random));
    H5Dwrite(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
}

/// An empty dataset of any shape and type in its place.
void replace(hid_t file, const std::string& name, Random& random) {
    H5Ldelete(file, name.c_str(), H5P_DEFAULT);
    const int rank = static_cast<int>(random() % 5);
    constexpr hsize_t sizes[] = {0, 1, 2, 3, 4, 8, 100, 65536, 2147483648};
    std::vector<hsize_t> shape;
    for (int n = 0; n < rank; ++n) shape.push_back(sizes[random() % std::size(sizes)]);
    const hid_t types[] = {H5T_IEEE_F64LE, H5T_STD_I32LE, H5T_STD_I64BE, H5T_IEEE_F32LE, H5T_C_S1};
    const Hdf5Handle space(rank == 0 ? H5Screate(H5S_SCALAR) : H5Screate_simple(rank, shape.data(), nullptr), H5Sclose);
    const Hdf5Handle data(H5Dcreate2(file, name.c_str(), types[random() % std::size(types)], space, H5P_DEFAULT,
                                     H5P_DEFAULT, H5P_DEFAULT),
                          H5Dclose);
}

}  // namespace

bool edit_hdf5(const std::filesystem::path& path, Random& random) {
    const Hdf5Quiet quiet;
    Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
    const std::vector<std::string> names = datasets_of(file);
    if (names.empty()) return false;
    for (std::size_t left = 1 + random() % 2; left > 0; --left) {
        const std::string &name = names[random() % names.size()], &other = names[random() % names.size()];
        if (H5Lexists(file, name.c_str(), H5P_DEFAULT) <= 0) continue;
        switch (random() % 6) {
            case 0:
                H5Ldelete(file, name.c_str(), H5P_DEFAULT);
                break;
            case 1:
                replace(file, name, random);
                break;
            case 2:
                H5Ldelete(file, name.c_str(), H5P_DEFAULT);
                H5Lcreate_hard(file, other.c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
                break;
            default:
                change_values(file, name, random);
        }
    }
    file.close();
    if (bytes_at(path).starts_with("tissuewarp")) seal_hdf5(path);
    return true;
}

namespace {

/// Attributes of the root, of one text or number each.
void copy_attributes(hid_t from, hid_t to) {
    for (const char* name : {"format", "format_version"}) {
        const Hdf5Handle attribute(H5Aopen(from, name, H5P_DEFAULT), H5Aclose);
        if (!attribute.valid()) continue;
        const Hdf5Handle type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose),
            copy(H5Acreate2(to, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
        void* value = nullptr;
        H5Aread(attribute, type, &value);
        H5Awrite(copy, type, &value);
    }
}

}  // namespace

void copy_without_seal(const std::filesystem::path& from, const std::filesystem::path& to, bool checked) {
    const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    if (checked) H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_V18);
    const Hdf5Handle source(H5Fopen(from.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose),
        copy(H5Fcreate(to.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose);
    copy_attributes(source, copy);
    std::pair<hid_t, hid_t> files{source, copy};
    H5Literate(
        source, H5_INDEX_NAME, H5_ITER_INC, nullptr,
        [](hid_t, const char* name, const H5L_info_t*, void* both) -> herr_t {
            const auto& [source_file, copy_file] = *static_cast<std::pair<hid_t, hid_t>*>(both);
            return H5Ocopy(source_file, name, copy_file, name, H5P_DEFAULT, H5P_DEFAULT);
        },
        &files);
}

}  // namespace tissuewarp::fuzz
