#include "registration/io/itk_hdf5_writer.hpp"

#include "core/detail/hdf5.hpp"
#include "core/errors.hpp"
#include "imaging/image_io.hpp"

#include <libdeflate.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

constexpr std::int64_t most_chunk_voxels = std::int64_t{1} << 16;  // 768 KiB: a reader's cache of HDF5 holds one
constexpr int level = 1;                                           // of libdeflate

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

void require(bool done) {
    if (!done) throw IoError("HDF5 could not write all of it");
}

/// Bytes of the same rank side by side, as HDF5's filter shuffle leaves them.
std::vector<unsigned char> shuffled(const std::vector<float>& values) {
    const std::size_t count = values.size();
    const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
    std::vector<unsigned char> result(count * sizeof(float));
    for (std::size_t rank = 0; rank < sizeof(float); ++rank)
        for (std::size_t n = 0; n < count; ++n) result[rank * count + n] = bytes[n * sizeof(float) + rank];
    return result;
}

struct FreeCompressor {
    void operator()(libdeflate_compressor* compressor) const { libdeflate_free_compressor(compressor); }
};

/// A whole chunk of the dataset, rounded, shuffled and deflated; beyond the last voxel there is zero.
std::vector<unsigned char> packed_chunk(const FieldToWrite& field, std::int64_t first, std::int64_t chunk_voxels) {
    constexpr auto step = static_cast<float>(imaging::displacement_step_mm);
    std::vector<float> values(static_cast<std::size_t>(3 * chunk_voxels), 0.0F);
    field.vectors(first, std::min<std::int64_t>(chunk_voxels, field.grid.voxel_count() - first), values.data());
    for (float& value : values) value = std::nearbyint(value / step) * step;
    const std::vector<unsigned char> plain = shuffled(values);
    const std::unique_ptr<libdeflate_compressor, FreeCompressor> compressor(libdeflate_alloc_compressor(level));
    if (!compressor) throw IoError("libdeflate cannot start: out of memory");
    std::vector<unsigned char> packed(libdeflate_zlib_compress_bound(compressor.get(), plain.size()));
    packed.resize(libdeflate_zlib_compress(compressor.get(), plain.data(), plain.size(), packed.data(), packed.size()));
    if (packed.empty()) throw IoError("libdeflate cannot pack a piece of the field");
    return packed;
}

class Writer {
public:
    explicit Writer(const std::filesystem::path& path)
        : file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose) {
        require(file_.valid());
        group("/TransformGroup");
        text("/HDFVersion", std::to_string(H5_VERS_MAJOR) + "." + std::to_string(H5_VERS_MINOR) + "." +
                                std::to_string(H5_VERS_RELEASE));
    }

    /// The parts of a composite follow it; it has no parameters of its own.
    void composite() { text(begin() + "/TransformType", "CompositeTransform_double_3_3"); }

    void affine(const Eigen::Affine3d& map) {
        const std::string name = begin();
        std::array<double, 12> parameters{};
        RowMajor::Map(parameters.data()) = map.linear();
        Eigen::Vector3d::Map(&parameters[9]) = map.translation();
        text(name + "/TransformType", "AffineTransform_double_3_3");
        numbers(name + "/TransformParameters", parameters);
        numbers(name + "/TransformFixedParameters", std::array<double, 3>{});  // its centre
    }

    void displacement_field(const FieldToWrite& field) {
        const std::string name = begin();
        std::array<double, 18> grid{};
        for (std::size_t axis = 0; axis < 3; ++axis) grid[axis] = field.grid.size[axis];
        Eigen::Vector3d::Map(&grid[3]) = field.grid.origin;
        Eigen::Vector3d::Map(&grid[6]) = field.grid.spacing;
        RowMajor::Map(&grid[9]) = field.grid.direction;
        text(name + "/TransformType", "DisplacementFieldTransform_double_3_3");
        numbers(name + "/TransformFixedParameters", grid);
        vectors(name + "/TransformParameters", field);
    }

    void close() { require(file_.close()); }

private:
    Hdf5Handle file_;
    int transforms_ = 0;

    void group(const std::string& name) {
        require(Hdf5Handle(H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose).valid());
    }
    std::string begin() {
        const std::string name = "/TransformGroup/" + std::to_string(transforms_++);
        group(name);
        return name;
    }
    Hdf5Handle dataset(const std::string& name, hid_t type, hsize_t count, hid_t creation) {
        const Hdf5Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
        Hdf5Handle set(H5Dcreate2(file_, name.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose);
        require(set.valid());
        return set;
    }
    void text(const std::string& name, const std::string& value) {
        const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
        H5Tset_size(type, H5T_VARIABLE);
        const char* letters = value.c_str();
        const Hdf5Handle set = dataset(name, type, 1, H5P_DEFAULT);
        require(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, static_cast<const void*>(&letters)) >= 0);
    }
    template <std::size_t count>
    void numbers(const std::string& name, const std::array<double, count>& values) {
        const Hdf5Handle set = dataset(name, H5T_IEEE_F64LE, count, H5P_DEFAULT);
        require(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) >= 0);
    }

    /// Packs some chunks in parallel, and writes them as they are.
    void vectors(const std::string& name, const FieldToWrite& field) {
        const std::int64_t voxels = field.grid.voxel_count(), chunk_voxels = std::min(voxels, most_chunk_voxels),
                           chunks = (voxels + chunk_voxels - 1) / chunk_voxels;
        const auto chunk = static_cast<hsize_t>(3 * chunk_voxels);  // HDF5 allows none beyond the dataset
        const Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
        H5Pset_chunk(creation, 1, &chunk);
        H5Pset_shuffle(creation);
        H5Pset_deflate(creation, level);  // which readers need not know
        const Hdf5Handle set = dataset(name, H5T_IEEE_F32LE, static_cast<hsize_t>(3 * voxels), creation);
        // Bounds memory to about 5 MB a thread.
        const std::int64_t chunks_at_once = 2 * tbb::this_task_arena::max_concurrency();
        for (std::int64_t first = 0; first < chunks; first += chunks_at_once) {
            std::vector<std::vector<unsigned char>> packed(
                static_cast<std::size_t>(std::min(chunks_at_once, chunks - first)));
            tbb::parallel_for(std::size_t{0}, packed.size(), [&](std::size_t n) {
                packed[n] = packed_chunk(field, (first + static_cast<std::int64_t>(n)) * chunk_voxels, chunk_voxels);
            });
            for (std::size_t n = 0; n < packed.size(); ++n) {
                const hsize_t at = static_cast<hsize_t>(first + static_cast<std::int64_t>(n)) * chunk;
                require(H5Dwrite_chunk(set, H5P_DEFAULT, 0, &at, packed[n].size(), packed[n].data()) >= 0);
            }
        }
    }
};

}  // namespace

void write_composite(const Eigen::Affine3d& before, const FieldToWrite& field, const Eigen::Affine3d& after,
                     const std::filesystem::path& path) {
    const Hdf5Quiet quiet;
    Writer writer(path);
    writer.composite();  // which applies its last part first
    writer.affine(after);
    writer.displacement_field(field);
    if (!before.isApprox(Eigen::Affine3d::Identity())) writer.affine(before);
    writer.close();
}

void write_affine(const Eigen::Affine3d& map, const std::filesystem::path& path) {
    const Hdf5Quiet quiet;
    Writer writer(path);
    writer.affine(map);
    writer.close();
}

}  // namespace tissuewarp::registration::detail
