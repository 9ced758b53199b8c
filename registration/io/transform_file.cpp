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

#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>
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

/// A file in memory. HDF5 cannot recover from a disk that fills while it writes, and ends the process later; here it
/// never meets one.
class MemoryFile {
public:
    MemoryFile() : descriptor_(::memfd_create("transform", MFD_CLOEXEC)) {
        if (descriptor_ < 0) throw IoError(std::string("no file in memory: ") + std::strerror(errno));
    }
    ~MemoryFile() { ::close(descriptor_); }
    MemoryFile(const MemoryFile&) = delete;
    MemoryFile& operator=(const MemoryFile&) = delete;

    [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }
    [[nodiscard]] std::string bytes() const {
        std::ifstream stream(path(), std::ios::binary);
        std::ostringstream all;
        all << stream.rdbuf();
        return std::move(all).str();
    }

private:
    int descriptor_;
};

/// Limits on the size of files hold in memory too: room for the parameters as they are, unpacked.
void require_room(const PointMap& map) {
    constexpr std::uint64_t rest = 1 << 20;  // of the file
    const std::uint64_t bytes =
        rest + (map.field ? 24 * static_cast<std::uint64_t>(map.field->geometry.voxel_count()) : 0);
    rlimit limit{};
    if (::getrlimit(RLIMIT_FSIZE, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY && limit.rlim_cur < bytes)
        throw IoError("files are limited to " + std::to_string(limit.rlim_cur) +
                      " bytes (ulimit -f), and it may take " + std::to_string(bytes));
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
    std::string bytes;
    try {
        require_room(map);
        const MemoryFile file;
        if (text)
            write(map, *itk::TxtTransformIOTemplate<double>::New(), file.path());
        else
            write(map, *itk::HDF5TransformIOTemplate<double>::New(), file.path());
        bytes = file.bytes();
    } catch (const itk::ExceptionObject& error) {
        throw IoError("cannot write '" + path.string() + "': " + error.GetDescription());
    } catch (const IoError& error) {
        throw IoError("cannot write '" + path.string() + "': " + error.what());
    }
    write_file(bytes, path);
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
