#include "registration/io/transform_file.hpp"

#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "registration/io/itk_hdf5_writer.hpp"
#include "registration/io/point_map_field.hpp"

#include <itkAffineTransform.h>
#include <itkTransformFileWriter.h>
#include <itkTxtTransformIO.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <string>

namespace tissuewarp::registration {

namespace {

void write_text(const Eigen::Affine3d& map, const std::filesystem::path& path) {
    const auto transform = itk::AffineTransform<double, 3>::New();
    itk::AffineTransform<double, 3>::MatrixType matrix;
    itk::AffineTransform<double, 3>::OutputVectorType offset;
    for (unsigned row = 0; row < 3; ++row) {
        for (unsigned column = 0; column < 3; ++column) matrix(row, column) = map.linear()(row, column);
        offset[row] = map.translation()[row];
    }
    transform->SetMatrix(matrix);
    transform->SetOffset(offset);
    const auto writer = itk::TransformFileWriterTemplate<double>::New();
    writer->SetTransformIO(itk::TxtTransformIOTemplate<double>::New());
    writer->SetInput(transform);
    writer->SetFileName(path.string());
    writer->Update();
}

/// HDF5 cannot recover from a disk that fills while it writes, and ends the process later: room for the vectors as they
/// are, unpacked, must be there before. What others write meanwhile is not foreseen.
void require_room(std::int64_t voxels, const std::filesystem::path& path) {
    constexpr std::int64_t rest = 1 << 20;  // of the file
    const std::int64_t bytes = rest + 12 * voxels;
    const int file = ::open(path.c_str(), O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0666);
    if (file < 0) throw IoError(std::strerror(errno));
    const int failure = ::posix_fallocate(file, 0, bytes);
    ::close(file);
    std::filesystem::remove(path);
    if (failure != 0)
        throw IoError(std::string(std::strerror(failure)) + "; it takes up to " + std::to_string(bytes >> 20) +
                      " MiB while it is written");
}

/// Calls write(path of a temporary file), and puts the file into its place.
template <class Write>
void write_complete(std::int64_t voxels, const std::filesystem::path& path, const Write& write) {
    AtomicFile file(path);
    try {
        require_room(voxels, file.path());
        write(file.path());
    } catch (const itk::ExceptionObject& error) {
        throw IoError("cannot write '" + path.string() + "': " + error.GetDescription());
    } catch (const IoError& error) {
        throw IoError("cannot write '" + path.string() + "': " + error.what());
    }
    file.commit();
}

bool is_text(const std::filesystem::path& path) {
    const std::string extension = path.extension().string();
    if (extension == ".tfm" || extension == ".txt") return true;
    if (extension == ".h5") return false;
    throw InvalidInput("cannot write '" + path.string() + "': the extension '" + extension +
                       "' names no transform of ITK; use .h5, .tfm or .txt");
}

void require_composite(const std::filesystem::path& path) {
    if (is_text(path))
        throw InvalidInput("cannot write '" + path.string() +
                           "': text holds linear transforms only, and this one has a displacement field; use .h5");
}

}  // namespace

void write_itk_transform(const PointMap& map, const std::filesystem::path& path) {
    if (!map.field) {
        const Eigen::Affine3d linear = map.after * map.before;
        const auto write = is_text(path) ? write_text : detail::write_affine;
        return write_complete(0, path, [&](auto& temporary) { write(linear, temporary); });
    }
    require_composite(path);
    const auto* stored = map.field->data<float>();
    const detail::FieldToWrite field{map.field->geometry, [&](std::int64_t first, std::int64_t count, float* vectors) {
                                         std::copy_n(stored + 3 * first, 3 * count, vectors);
                                     }};
    write_complete(field.grid.voxel_count(), path,
                   [&](auto& temporary) { detail::write_composite(map.before, field, map.after, temporary); });
}

void write_itk_transform(const imaging::Volume& displacement, const Eigen::Affine3d& linear,
                         const std::filesystem::path& path) {
    require_composite(path);
    const detail::FieldToWrite field{displacement.geometry, WithoutLinearPart(displacement, linear)};
    write_complete(field.grid.voxel_count(), path, [&](auto& temporary) {
        detail::write_composite(Eigen::Affine3d::Identity(), field, linear, temporary);
    });
}

void write_matrix(const Eigen::Affine3d& map, const std::filesystem::path& path) {
    std::string text;
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column) {
            std::array<char, 32> digits{};  // the shortest that read back to the same number
            const double value = map.matrix()(row, column);
            const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
            text.append(digits.data(), end).append(column < 3 ? " " : "\n");
        }
    write_file(text, path);
}

}  // namespace tissuewarp::registration
