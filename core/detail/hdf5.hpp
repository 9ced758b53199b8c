#pragma once
/// HDF5 files behind handles that close themselves: typed arrays with units, texts, and refusal of what does not fit.

#include <hdf5.h>
#include <Eigen/Core>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp {

/// An HDF5 identifier and the function that gives it back.
class Hdf5Handle {
public:
    using Close = herr_t (*)(hid_t);

    Hdf5Handle() = default;
    Hdf5Handle(hid_t id, Close give_back) : id_(id), close_(give_back) {}
    ~Hdf5Handle() { close(); }
    Hdf5Handle(Hdf5Handle&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
    Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
        std::swap(id_, other.id_);
        std::swap(close_, other.close_);
        return *this;
    }

    [[nodiscard]] bool valid() const { return id_ >= 0; }
    operator hid_t() const { return id_; }  // NOLINT: every call of the C API takes it
    /// False when HDF5 could not complete what was pending: for a file, a full disk.
    bool close() { return id_ < 0 || close_(std::exchange(id_, H5I_INVALID_HID)) >= 0; }

private:
    hid_t id_ = H5I_INVALID_HID;
    Close close_ = nullptr;
};

/// While one lives, HDF5 does not print its errors: libraries never do.
class Hdf5Quiet {
public:
    Hdf5Quiet();
    ~Hdf5Quiet();
    Hdf5Quiet(const Hdf5Quiet&) = delete;
    Hdf5Quiet& operator=(const Hdf5Quiet&) = delete;

private:
    H5E_auto2_t function_ = nullptr;
    void* data_ = nullptr;
};

/// T is double or int, of arrays also float. Large arrays are shuffled, deflated and carry a checksum. Throws IoError.
class Hdf5Output {
public:
    Hdf5Output(const std::filesystem::path& path, const std::string& format, int version);

    /// A matrix of Eigen by columns: dataset (columns × rows), so that a point is a row of the dataset.
    template <class T>
    void columns(const std::string& name, const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>& values,
                 const std::string& units);
    template <class T>
    void vector(const std::string& name, const Eigen::Matrix<T, Eigen::Dynamic, 1>& values, const std::string& units);
    template <class T>
    void scalar(const std::string& name, T value, const std::string& units);
    /// Any shape, slowest index first.
    template <class T>
    void array(const std::string& name, const T* values, const std::vector<hsize_t>& shape, const std::string& units);
    void texts(const std::string& name, const std::vector<std::string>& values);
    /// Adds one entry of this shape to a dataset (entries × shape) that grows; the first makes it.
    void append(const std::string& name, const double* values, const std::vector<hsize_t>& shape,
                const std::string& units);
    /// A text about a dataset.
    void attribute(const std::string& object, const std::string& name, const std::string& value);
    /// Throws IoError when not everything reached the disk.
    void close();

private:
    Hdf5Quiet quiet_;
    std::filesystem::path path_;
    Hdf5Handle file_;
};

/// Throws IoError on what cannot be read, InvalidInput on another format, version, type or shape, and on NaN.
class Hdf5Input {
public:
    /// Files of this format up to `newest_version` are read; what a version lacks is the reader's to know.
    Hdf5Input(const std::filesystem::path& path, const std::string& format, int newest_version, int oldest_version);

    [[nodiscard]] int version() const { return version_; }

    /// A dataset (columns × `rows`) as an Eigen matrix (`rows` × columns).
    template <class T>
    [[nodiscard]] Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> columns(const std::string& name, int rows) const;
    /// `size` −1 takes any.
    template <class T>
    [[nodiscard]] Eigen::Matrix<T, Eigen::Dynamic, 1> vector(const std::string& name, Eigen::Index size = -1) const;
    template <class T>
    [[nodiscard]] T scalar(const std::string& name) const;
    /// Fills memory for exactly this shape.
    template <class T>
    void array(const std::string& name, T* values, const std::vector<hsize_t>& shape) const;
    /// How many entries of this shape a dataset holds that Hdf5Output::append made.
    [[nodiscard]] hsize_t entries(const std::string& name, const std::vector<hsize_t>& shape) const;
    /// One of them, which may hold NaN. `index` is below entries().
    void entry(const std::string& name, hsize_t index, double* values, const std::vector<hsize_t>& shape) const;
    /// Whether there is a group or dataset of this name, `a/b/c`.
    [[nodiscard]] bool holds(const std::string& name) const;
    /// Throws unless the dataset has this shape: before memory is set aside for it.
    void require_shape(const std::string& name, const std::vector<hsize_t>& wanted) const;
    [[nodiscard]] std::vector<std::string> texts(const std::string& name) const;
    /// The one text of a dataset with one.
    [[nodiscard]] std::string text(const std::string& name) const;

private:
    [[nodiscard]] Hdf5Handle dataset(const std::string& name) const;
    [[nodiscard]] std::vector<hsize_t> shape(hid_t dataset, const std::string& name) const;
    [[noreturn]] void refuse(const std::string& name, const std::string& reason) const;
    void require_format(const std::string& format, int newest_version, int oldest_version);

    Hdf5Quiet quiet_;
    std::filesystem::path path_;
    Hdf5Handle file_;
    int version_ = 0;
};

}  // namespace tissuewarp
