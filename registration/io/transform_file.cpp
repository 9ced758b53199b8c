#include "registration/io/transform_file.hpp"

#include "core/atomic_file.hpp"
#include "core/detail/hdf5.hpp"
#include "core/errors.hpp"
#include "imaging/image_io.hpp"

#include <itkAffineTransform.h>
#include <itkCompositeTransform.h>
#include <itkDisplacementFieldTransform.h>
#include <itkHDF5TransformIO.h>
#include <itkTransformFileWriter.h>
#include <itkTxtTransformIO.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

namespace tissuewarp::registration {

namespace {

using Affine = itk::AffineTransform<double, 3>;
using Composite = itk::CompositeTransform<double, 3>;
using Field = itk::DisplacementFieldTransform<double, 3>;

Affine::Pointer affine(const Eigen::Affine3d& map) {
    const auto result = Affine::New();
    Affine::MatrixType matrix;
    Affine::OutputVectorType offset;
    for (unsigned row = 0; row < 3; ++row) {
        for (unsigned column = 0; column < 3; ++column) matrix(row, column) = map.linear()(row, column);
        offset[row] = map.translation()[row];
    }
    result->SetMatrix(matrix);
    result->SetOffset(offset);
    return result;
}

Field::Pointer displacement_field(const imaging::Volume& volume) {
    using Image = Field::DisplacementFieldType;
    const imaging::Geometry& grid = volume.geometry;
    const auto image = Image::New();
    Image::SizeType size;
    Image::PointType origin;
    Image::SpacingType spacing;
    Image::DirectionType direction;
    for (unsigned axis = 0; axis < 3; ++axis) {
        size[axis] = static_cast<itk::SizeValueType>(grid.size[axis]);
        origin[axis] = grid.origin[axis];
        spacing[axis] = grid.spacing[axis];
        for (unsigned row = 0; row < 3; ++row) direction(row, axis) = grid.direction(row, axis);
    }
    image->SetRegions(size);
    image->SetOrigin(origin);
    image->SetSpacing(spacing);
    image->SetDirection(direction);
    image->Allocate();
    constexpr double step = imaging::displacement_step_mm;
    const auto* components = volume.data<float>();
    std::transform(components, components + 3 * grid.voxel_count(), image->GetBufferPointer()->GetDataPointer(),
                   [](float v) { return std::nearbyint(v / step) * step; });
    const auto result = Field::New();
    result->SetDisplacementField(image);
    return result;
}

/// A composition applies its last part first.
itk::TransformBaseTemplate<double>::Pointer itk_transform(const PointMap& map) {
    if (!map.field) return affine(map.after * map.before).GetPointer();
    const auto composite = Composite::New();
    composite->AddTransform(affine(map.after));
    composite->AddTransform(displacement_field(*map.field));
    if (!map.before.isApprox(Eigen::Affine3d::Identity())) composite->AddTransform(affine(map.before));
    return composite.GetPointer();
}

void write(const PointMap& map, itk::TransformIOBaseTemplate<double>& format, const std::filesystem::path& path) {
    const auto writer = itk::TransformFileWriterTemplate<double>::New();
    writer->SetTransformIO(&format);
    writer->SetInput(itk_transform(map));
    writer->SetUseCompression(true);
    writer->SetFileName(path.string());
    writer->Update();
}

/// HDF5 cannot recover from a disk that fills while it writes, and ends the process later: room for the parameters as
/// they are, unpacked, must be there before. What others write meanwhile is not foreseen.
void require_room(const PointMap& map, const std::filesystem::path& path) {
    constexpr std::int64_t rest = 1 << 20;  // of the file
    const std::int64_t bytes = rest + (map.field ? 24 * map.field->geometry.voxel_count() : 0);
    const int file = ::open(path.c_str(), O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0666);
    if (file < 0) throw IoError(std::strerror(errno));
    const int failure = ::posix_fallocate(file, 0, bytes);
    ::close(file);
    std::filesystem::remove(path);
    if (failure != 0)
        throw IoError(std::string(std::strerror(failure)) + "; it takes up to " + std::to_string(bytes >> 20) +
                      " MiB while it is written");
}

}  // namespace

void write_itk_transform(const PointMap& map, const std::filesystem::path& path) {
    const std::string extension = path.extension().string();
    const bool text = extension == ".tfm" || extension == ".txt";
    if (!text && extension != ".h5")
        throw InvalidInput("cannot write '" + path.string() + "': the extension '" + extension +
                           "' names no transform of ITK; use .h5, .tfm or .txt");
    if (text && map.field)
        throw InvalidInput("cannot write '" + path.string() +
                           "': text holds linear transforms only, and this one has a displacement field; use .h5");
    const Hdf5Quiet quiet;
    AtomicFile file(path);
    try {
        require_room(map, file.path());
        if (text)
            write(map, *itk::TxtTransformIOTemplate<double>::New(), file.path());
        else
            write(map, *itk::HDF5TransformIOTemplate<double>::New(), file.path());
    } catch (const itk::ExceptionObject& error) {
        throw IoError("cannot write '" + path.string() + "': " + error.GetDescription());
    } catch (const IoError& error) {
        throw IoError("cannot write '" + path.string() + "': " + error.what());
    }
    file.commit();
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
