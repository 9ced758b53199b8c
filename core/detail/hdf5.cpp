#include "core/detail/hdf5.hpp"

#include "core/detail/hdf5_seal.hpp"
#include "core/errors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace tissuewarp {

namespace {

constexpr std::size_t chunk_bytes = 1 << 20;       // HDF5's default cache holds one such chunk
constexpr std::size_t compress_from_bytes = 4096;  // below, a chunk index costs more than it saves

template <class T>
hid_t memory_type() {
    if constexpr (std::is_same_v<T, double>)
        return H5T_NATIVE_DOUBLE;
    else if constexpr (std::is_same_v<T, float>)
        return H5T_NATIVE_FLOAT;
    else
        return H5T_NATIVE_INT;
}

/// In the file: little endian on every machine.
template <class T>
hid_t stored_type() {
    if constexpr (std::is_same_v<T, double>)
        return H5T_IEEE_F64LE;
    else if constexpr (std::is_same_v<T, float>)
        return H5T_IEEE_F32LE;
    else
        return H5T_STD_I32LE;
}

Hdf5Handle text_type() {
    Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type, H5T_VARIABLE);
    H5Tset_cset(type, H5T_CSET_UTF8);
    return type;
}

hsize_t count_of(const std::vector<hsize_t>& shape) {
    return std::accumulate(shape.begin(), shape.end(), hsize_t{1}, std::multiplies<>());
}

/// Files are complete when they appear, so no lock is needed, and file systems without locks work.
Hdf5Handle access() {
    Hdf5Handle list(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_fclose_degree(list, H5F_CLOSE_STRONG);
    H5Pset_file_locking(list, false, true);
    return list;
}

Hdf5Handle sealed() {
    Hdf5Handle list(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
    H5Pset_userblock(list, hdf5_seal_bytes);
    return list;
}

Hdf5Handle creation(const std::vector<hsize_t>& shape, std::size_t value_bytes) {
    Hdf5Handle list(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    const std::size_t bytes = count_of(shape) * value_bytes;
    if (shape.empty() || bytes < compress_from_bytes) return list;
    std::vector<hsize_t> chunk = shape;
    const std::size_t row_bytes = bytes / shape[0];
    chunk[0] = std::clamp<hsize_t>(chunk_bytes / row_bytes, 1, shape[0]);
    H5Pset_chunk(list, static_cast<int>(chunk.size()), chunk.data());
    H5Pset_shuffle(list);
    H5Pset_deflate(list, 3);
    H5Pset_fletcher32(list);
    return list;
}

Hdf5Handle simple_space(const std::vector<hsize_t>& shape) {
    return {
        shape.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr),
        H5Sclose};
}

Hdf5Handle new_dataset(hid_t file, const std::string& name, hid_t type, const std::vector<hsize_t>& shape,
                       std::size_t value_bytes) {
    const Hdf5Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
    H5Pset_create_intermediate_group(links, 1);
    return {H5Dcreate2(file, name.c_str(), type, simple_space(shape), links, creation(shape, value_bytes), H5P_DEFAULT),
            H5Dclose};
}

/// Float64, one entry of the shape `one` (which begins with 1) to a chunk.
Hdf5Handle new_growing(hid_t file, const std::string& name, const std::vector<hsize_t>& one) {
    std::vector<hsize_t> most = one;
    most[0] = H5S_UNLIMITED;
    const Hdf5Handle space(H5Screate_simple(static_cast<int>(one.size()), one.data(), most.data()), H5Sclose);
    const Hdf5Handle list(H5Pcreate(H5P_DATASET_CREATE), H5Pclose), links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
    H5Pset_create_intermediate_group(links, 1);
    H5Pset_chunk(list, static_cast<int>(one.size()), one.data());
    H5Pset_shuffle(list);
    H5Pset_deflate(list, 3);
    H5Pset_fletcher32(list);
    return {H5Dcreate2(file, name.c_str(), H5T_IEEE_F64LE, space, links, list, H5P_DEFAULT), H5Dclose};
}

bool write_text_attribute(hid_t object, const std::string& name, const std::string& value) {
    const Hdf5Handle type = text_type();
    const Hdf5Handle attribute(H5Acreate2(object, name.c_str(), type, simple_space({}), H5P_DEFAULT, H5P_DEFAULT),
                               H5Aclose);
    const char* text = value.c_str();
    return attribute.valid() && H5Awrite(attribute, type, static_cast<const void*>(&text)) >= 0;
}

/// Empty when there is none of this name or it is no single variable-length text.
std::string read_text_attribute(hid_t object, const char* name) {
    const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
    if (!attribute.valid()) return {};
    const Hdf5Handle stored(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
    if (H5Tis_variable_str(stored) <= 0 || H5Sget_simple_extent_npoints(space) != 1) return {};
    const Hdf5Handle type = text_type();
    char* text = nullptr;
    if (H5Aread(attribute, type, static_cast<void*>(&text)) < 0 || text == nullptr) return {};
    std::string result = text;
    H5free_memory(text);
    return result;
}

/// −1 when there is none.
int read_int_attribute(hid_t object, const char* name) {
    const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
    if (!attribute.valid()) return -1;
    const Hdf5Handle stored(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
    int value = -1;
    if (H5Tget_class(stored) != H5T_INTEGER || H5Sget_simple_extent_npoints(space) != 1 ||
        H5Aread(attribute, H5T_NATIVE_INT, &value) < 0)
        return -1;
    return value;
}

}  // namespace

Hdf5Quiet::Hdf5Quiet() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

Hdf5Quiet::~Hdf5Quiet() {
    H5Eset_auto2(H5E_DEFAULT, function_, data_);
}

Hdf5Output::Hdf5Output(const std::filesystem::path& path, const std::string& format, int version)
    : path_(path), file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, sealed(), access()), H5Fclose) {
    if (!file_.valid()) throw IoError("cannot create '" + path_.string() + "'; is the folder there and writable?");
    const Hdf5Handle attribute(
        H5Acreate2(file_, "format_version", H5T_STD_I32LE, simple_space({}), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    if (!write_text_attribute(file_, "format", format) || !attribute.valid() ||
        H5Awrite(attribute, H5T_NATIVE_INT, &version) < 0)
        throw IoError("cannot write '" + path_.string() + "'");
}

template <class T>
void Hdf5Output::array(const std::string& name, const T* values, const std::vector<hsize_t>& shape,
                       const std::string& units) {
    const Hdf5Handle data = new_dataset(file_, name, stored_type<T>(), shape, sizeof(T));
    const bool empty = count_of(shape) == 0;
    if (!data.valid() || (!empty && H5Dwrite(data, memory_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) ||
        !write_text_attribute(data, "units", units))
        throw IoError("cannot write '" + name + "' to '" + path_.string() + "'; is the disk full?");
}

template <class T>
void Hdf5Output::columns(const std::string& name, const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>& values,
                         const std::string& units) {
    array(name, values.data(), {static_cast<hsize_t>(values.cols()), static_cast<hsize_t>(values.rows())}, units);
}

template <class T>
void Hdf5Output::vector(const std::string& name, const Eigen::Matrix<T, Eigen::Dynamic, 1>& values,
                        const std::string& units) {
    array(name, values.data(), {static_cast<hsize_t>(values.size())}, units);
}

template <class T>
void Hdf5Output::scalar(const std::string& name, T value, const std::string& units) {
    array(name, &value, {}, units);
}

void Hdf5Output::texts(const std::string& name, const std::vector<std::string>& values) {
    const Hdf5Handle type = text_type();
    const Hdf5Handle data = new_dataset(file_, name, type, {values.size()}, 0);
    std::vector<const char*> pointers;
    for (const std::string& value : values) {
        if (value.find('\0') != std::string::npos)
            throw InvalidInput("a text of '" + name + "' holds a zero byte, which a record cannot keep; remove it");
        pointers.push_back(value.c_str());
    }
    if (!data.valid() || (!values.empty() && H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT,
                                                      static_cast<const void*>(pointers.data())) < 0))
        throw IoError("cannot write '" + name + "' to '" + path_.string() + "'; is the disk full?");
}

void Hdf5Output::append(const std::string& name, const double* values, const std::vector<hsize_t>& shape,
                        const std::string& units) {
    std::vector<hsize_t> size{1}, start(shape.size() + 1, 0);
    size.insert(size.end(), shape.begin(), shape.end());
    const std::vector<hsize_t> one = size;
    const bool first = H5Lexists(file_, name.c_str(), H5P_DEFAULT) <= 0;
    const Hdf5Handle data =
        first ? new_growing(file_, name, one) : Hdf5Handle(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose);
    if (!first) {
        const Hdf5Handle before(H5Dget_space(data), H5Sclose);
        H5Sget_simple_extent_dims(before, size.data(), nullptr);
        start[0] = size[0]++;
    }
    const bool grown = data.valid() && H5Dset_extent(data, size.data()) >= 0;
    const Hdf5Handle space(grown ? H5Dget_space(data) : H5I_INVALID_HID, H5Sclose), entry = simple_space(one);
    if (!grown || H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, one.data(), nullptr) < 0 ||
        H5Dwrite(data, H5T_NATIVE_DOUBLE, entry, space, H5P_DEFAULT, values) < 0 ||
        (first && !write_text_attribute(data, "units", units)))
        throw IoError("cannot write '" + name + "' to '" + path_.string() + "'; is the disk full?");
}

void Hdf5Output::attribute(const std::string& object, const std::string& name, const std::string& value) {
    const Hdf5Handle opened(H5Oopen(file_, object.c_str(), H5P_DEFAULT), H5Oclose);
    if (!opened.valid() || !write_text_attribute(opened, name, value))
        throw IoError("cannot write '" + object + "' to '" + path_.string() + "'");
}

void Hdf5Output::close() {
    const bool flushed = H5Fflush(file_, H5F_SCOPE_GLOBAL) >= 0;
    if (!file_.close() || !flushed) throw IoError("cannot write '" + path_.string() + "'; is the disk full?");
    seal_hdf5(path_);
}

Hdf5Input::Hdf5Input(const std::filesystem::path& path, const std::string& format, int newest_version,
                     int oldest_version)
    : path_(path) {
    if (!std::filesystem::is_regular_file(path)) throw IoError("'" + path.string() + "' is not a file");
    require_unbroken_hdf5(path);
    file_ = Hdf5Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access()), H5Fclose);
    if (!file_.valid())
        throw IoError("'" + path.string() + "' cannot be read as HDF5; is it complete, and the file you meant?");
    require_format(format, newest_version, oldest_version);
}

void Hdf5Input::require_format(const std::string& format, int newest_version, int oldest_version) {
    const std::string found = read_text_attribute(file_, "format");
    if (found != format)
        throw InvalidInput("'" + path_.string() + "' is " + (found.empty() ? "no file of tissuewarp" : "a " + found) +
                           "; a " + format + " is wanted");
    version_ = read_int_attribute(file_, "format_version");
    if (version_ < oldest_version || version_ > newest_version)
        throw InvalidInput("'" + path_.string() + "' has format version " + std::to_string(version_) +
                           ", this program reads versions " + std::to_string(oldest_version) + " to " +
                           std::to_string(newest_version) +
                           (version_ > newest_version ? "; read it with the newer program that wrote it"
                                                      : "; write the file again with this program"));
}

void Hdf5Input::refuse(const std::string& name, const std::string& reason) const {
    throw InvalidInput("'" + path_.string() + "', dataset '" + name + "': " + reason);
}

bool Hdf5Input::holds(const std::string& name) const {
    for (std::size_t end = name.find('/'); end != std::string::npos; end = name.find('/', end + 1))
        if (H5Lexists(file_, name.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
    return H5Lexists(file_, name.c_str(), H5P_DEFAULT) > 0;
}

Hdf5Handle Hdf5Input::dataset(const std::string& name) const {
    Hdf5Handle data(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose);
    if (!data.valid()) refuse(name, "missing or damaged");
    return data;
}

std::vector<hsize_t> Hdf5Input::shape(hid_t data, const std::string& name) const {
    const Hdf5Handle space(H5Dget_space(data), H5Sclose);
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank < 0) refuse(name, "damaged");
    std::vector<hsize_t> sizes(static_cast<std::size_t>(rank));
    if (rank > 0) H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
    // Sizes are believed only as far as the file could hold them: deflate saves a factor of 1032 at the most.
    const double most = 1032.0 * static_cast<double>(std::filesystem::file_size(path_));
    double count = 1;
    for (const hsize_t size : sizes) count *= static_cast<double>(size);
    if (count > most || count > std::numeric_limits<int>::max())
        refuse(name, "claims " + std::to_string(count) + " values, more than the file can hold");
    return sizes;
}

void Hdf5Input::require_shape(const std::string& name, const std::vector<hsize_t>& wanted) const {
    if (shape(dataset(name), name) != wanted)
        refuse(name, "another size than the format's or than that of its companions");
}

template <class T>
void Hdf5Input::array(const std::string& name, T* values, const std::vector<hsize_t>& wanted) const {
    const Hdf5Handle data = dataset(name);
    const Hdf5Handle type(H5Dget_type(data), H5Tclose);
    const H5T_class_t kind = std::is_floating_point_v<T> ? H5T_FLOAT : H5T_INTEGER;
    if (H5Tget_class(type) != kind || H5Tget_size(type) != sizeof(T)) refuse(name, "another type than the format's");
    require_shape(name, wanted);
    const hsize_t count = count_of(wanted);
    if (count > 0 && H5Dread(data, memory_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0)
        throw IoError("'" + path_.string() + "', dataset '" + name + "' is damaged");
    if constexpr (std::is_same_v<T, double>)
        if (!std::all_of(values, values + count, [](double v) { return std::isfinite(v); }))
            refuse(name, "holds values that are not finite");
}

hsize_t Hdf5Input::entries(const std::string& name, const std::vector<hsize_t>& wanted) const {
    const std::vector<hsize_t> found = shape(dataset(name), name);
    if (found.empty() || !std::equal(found.begin() + 1, found.end(), wanted.begin(), wanted.end()))
        refuse(name, "another size than the format's or than that of its companions");
    return found[0];
}

void Hdf5Input::entry(const std::string& name, hsize_t index, double* values,
                      const std::vector<hsize_t>& wanted) const {
    if (index >= entries(name, wanted)) refuse(name, "has no entry " + std::to_string(index));
    const Hdf5Handle data = dataset(name);
    const Hdf5Handle type(H5Dget_type(data), H5Tclose), space(H5Dget_space(data), H5Sclose);
    if (H5Tget_class(type) != H5T_FLOAT) refuse(name, "another type than the format's");
    std::vector<hsize_t> start(wanted.size() + 1, 0), one{1};
    start[0] = index;
    one.insert(one.end(), wanted.begin(), wanted.end());
    if (H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, one.data(), nullptr) < 0 ||
        H5Dread(data, H5T_NATIVE_DOUBLE, simple_space(one), space, H5P_DEFAULT, values) < 0)
        throw IoError("'" + path_.string() + "', dataset '" + name + "' is damaged");
}

template <class T>
Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> Hdf5Input::columns(const std::string& name, int rows) const {
    const std::vector<hsize_t> found = shape(dataset(name), name);
    if (found.size() != 2 || found[1] != static_cast<hsize_t>(rows))
        refuse(name, "a table with " + std::to_string(rows) + " columns is wanted");
    Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> values(rows, static_cast<Eigen::Index>(found[0]));
    array(name, values.data(), found);
    return values;
}

template <class T>
Eigen::Matrix<T, Eigen::Dynamic, 1> Hdf5Input::vector(const std::string& name, Eigen::Index size) const {
    const std::vector<hsize_t> found = shape(dataset(name), name);
    if (found.size() != 1 || (size >= 0 && found[0] != static_cast<hsize_t>(size)))
        refuse(name, size < 0 ? "a list is wanted" : "a list of " + std::to_string(size) + " values is wanted");
    Eigen::Matrix<T, Eigen::Dynamic, 1> values(static_cast<Eigen::Index>(found[0]));
    array(name, values.data(), found);
    return values;
}

template <class T>
T Hdf5Input::scalar(const std::string& name) const {
    T value{};
    array(name, &value, {});
    return value;
}

std::vector<std::string> Hdf5Input::texts(const std::string& name) const {
    const Hdf5Handle data = dataset(name);
    const Hdf5Handle stored(H5Dget_type(data), H5Tclose);
    const std::vector<hsize_t> sizes = shape(data, name);
    if (H5Tis_variable_str(stored) <= 0 || sizes.size() != 1) refuse(name, "a list of texts is wanted");
    std::vector<char*> pointers(sizes[0], nullptr);
    if (pointers.empty()) return {};
    const Hdf5Handle type = text_type();
    if (H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, static_cast<void*>(pointers.data())) < 0)
        throw IoError("'" + path_.string() + "', dataset '" + name + "' is damaged");
    std::vector<std::string> values;
    for (const char* text : pointers) values.emplace_back(text == nullptr ? "" : text);
    const Hdf5Handle space(H5Dget_space(data), H5Sclose);
    H5Dvlen_reclaim(type, space, H5P_DEFAULT, static_cast<void*>(pointers.data()));
    return values;
}

std::string Hdf5Input::text(const std::string& name) const {
    const std::vector<std::string> values = texts(name);
    if (values.size() != 1) refuse(name, "one text is wanted");
    return values[0];
}

template void Hdf5Output::array<double>(const std::string&, const double*, const std::vector<hsize_t>&,
                                        const std::string&);
template void Hdf5Output::array<float>(const std::string&, const float*, const std::vector<hsize_t>&,
                                       const std::string&);
template void Hdf5Output::array<int>(const std::string&, const int*, const std::vector<hsize_t>&, const std::string&);
template void Hdf5Output::columns<double>(const std::string&, const Eigen::MatrixXd&, const std::string&);
template void Hdf5Output::columns<int>(const std::string&, const Eigen::MatrixXi&, const std::string&);
template void Hdf5Output::vector<double>(const std::string&, const Eigen::VectorXd&, const std::string&);
template void Hdf5Output::vector<int>(const std::string&, const Eigen::VectorXi&, const std::string&);
template void Hdf5Output::scalar<double>(const std::string&, double, const std::string&);
template void Hdf5Output::scalar<int>(const std::string&, int, const std::string&);
template void Hdf5Input::array<double>(const std::string&, double*, const std::vector<hsize_t>&) const;
template void Hdf5Input::array<float>(const std::string&, float*, const std::vector<hsize_t>&) const;
template void Hdf5Input::array<int>(const std::string&, int*, const std::vector<hsize_t>&) const;
template Eigen::MatrixXd Hdf5Input::columns<double>(const std::string&, int) const;
template Eigen::MatrixXi Hdf5Input::columns<int>(const std::string&, int) const;
template Eigen::VectorXd Hdf5Input::vector<double>(const std::string&, Eigen::Index) const;
template Eigen::VectorXi Hdf5Input::vector<int>(const std::string&, Eigen::Index) const;
template double Hdf5Input::scalar<double>(const std::string&) const;
template int Hdf5Input::scalar<int>(const std::string&) const;

}  // namespace tissuewarp
