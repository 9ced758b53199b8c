// Transforms in HDF5 as itk::HDF5TransformIO writes them:
// /TransformGroup/<n>/Transform{Type,Parameters,FixedParameters}.

#include "core/detail/hdf5.hpp"
#include "core/detail/hdf5_seal.hpp"
#include "core/errors.hpp"
#include "registration/io/itk_transform.hpp"

namespace tissuewarp::registration::detail {

namespace {

bool holds(hid_t file, const std::string& name) {
    return H5Lexists(file, name.c_str(), H5P_DEFAULT) > 0;
}

class ItkFile {
public:
    explicit ItkFile(const std::filesystem::path& path) : path_(path), file_(opened(path), H5Fclose) {
        if (!file_.valid()) fail("cannot be opened as HDF5");
        if (!holds(file_, "/TransformGroup")) fail("holds no transform of ITK");
    }

    [[nodiscard]] std::vector<ItkTransform> transforms() const {
        std::vector<ItkTransform> result;
        for (int n = 0; holds(file_, group(n)); ++n)
            result.push_back(
                {text(group(n) + "/TransformType"), values(n, "Parameters"), values(n, "FixedParameters")});
        return result;
    }

private:
    Hdf5Quiet quiet_;
    const std::filesystem::path& path_;
    Hdf5Handle file_;
    /// Deflate saves a factor of 1032 at most.
    std::uintmax_t most_values_ = std::filesystem::file_size(path_) * 1032 / sizeof(float);

    static hid_t opened(const std::filesystem::path& path) {
        require_unbroken_hdf5(path);
        return H5Fopen(path.string().c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    }
    static std::string group(int n) { return "/TransformGroup/" + std::to_string(n); }
    [[noreturn]] void fail(const std::string& problem) const { throw IoError("'" + path_.string() + "' " + problem); }

    [[nodiscard]] std::string text(const std::string& name) const {
        const Hdf5Handle set(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose);
        if (!set.valid()) fail("lacks " + name);
        const Hdf5Handle type(H5Dget_type(set), H5Tclose);
        const Hdf5Handle space(H5Dget_space(set), H5Sclose);
        if (H5Tget_class(type) != H5T_STRING || H5Sget_simple_extent_npoints(space) != 1)
            fail("has not one text in " + name);
        if (H5Tis_variable_str(type) > 0) {
            char* read = nullptr;
            if (H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, static_cast<void*>(&read)) < 0 || !read)
                fail("has a damaged text in " + name);
            std::string result = read;
            H5free_memory(read);
            return result;
        }
        std::string result(H5Tget_size(type), '\0');
        if (H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, result.data()) < 0) fail("has a damaged text in " + name);
        return result.c_str();
    }

    /// Before ITK 5 the names lacked an s: TranformParameters. A composition has none.
    [[nodiscard]] std::vector<double> values(int n, const std::string& what) const {
        std::string name = group(n) + "/Transform" + what;
        if (!holds(file_, name)) name = group(n) + "/Tranform" + what;
        if (!holds(file_, name)) return {};
        const Hdf5Handle set(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose);
        const Hdf5Handle space(set.valid() ? H5Dget_space(set) : H5I_INVALID_HID, H5Sclose);
        const hssize_t count = space.valid() ? H5Sget_simple_extent_npoints(space) : -1;
        if (count < 0 || static_cast<std::uintmax_t>(count) > most_values_) fail("has damaged numbers in " + name);
        std::vector<double> result(static_cast<std::size_t>(count));
        if (count > 0 && H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, result.data()) < 0)
            fail("has damaged numbers in " + name);
        return result;
    }
};

}  // namespace

std::vector<ItkTransform> read_itk_hdf5(const std::filesystem::path& path) {
    return ItkFile(path).transforms();
}

}  // namespace tissuewarp::registration::detail
