#include "imaging/detail/itk_image_io.hpp"

#include "core/errors.hpp"
#include "imaging/detail/itk_voxels.hpp"
#include "imaging/detail/nifti_voxels.hpp"
#include "imaging/detail/wide_integers.hpp"

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <nifti1_io.h>

#include <algorithm>
#include <limits>
#include <new>
#include <sstream>

namespace tissuewarp::imaging::detail {

namespace {

using ImageIo = itk::ImageIOBase::Pointer;
using Component = itk::ImageIOBase::IOComponentType;

ImageIo make_image_io(Format format) {
    switch (format) {
        case Format::Nifti:
            nifti_set_debug_level(0);  // the library prints its errors otherwise; ours become exceptions
            return itk::NiftiImageIO::New().GetPointer();
        case Format::Nrrd:
            return itk::NrrdImageIO::New().GetPointer();
        case Format::MetaImage:
            return itk::MetaImageIO::New().GetPointer();
    }
    return nullptr;
}

int opencv_depth(Component component) {
    switch (component) {
        case Component::UCHAR:
            return CV_8U;
        case Component::CHAR:
            return CV_8S;
        case Component::USHORT:
            return CV_16U;
        case Component::SHORT:
            return CV_16S;
        case Component::INT:
            return CV_32S;
        case Component::FLOAT:
            return CV_32F;
        case Component::DOUBLE:
            return CV_64F;
        default:
            return -1;
    }
}

Component itk_component(int depth) {
    switch (depth) {
        case CV_8U:
            return Component::UCHAR;
        case CV_8S:
            return Component::CHAR;
        case CV_16U:
            return Component::USHORT;
        case CV_16S:
            return Component::SHORT;
        case CV_32S:
            return Component::INT;
        case CV_32F:
            return Component::FLOAT;
        case CV_64F:
            return Component::DOUBLE;
        default:
            throw InvalidInput("voxels of half precision cannot be written; convert them to float32");
    }
}

/// Integers of a type that OpenCV lacks.
template <class Wide>
cv::Mat narrowed(itk::ImageIOBase& io, const std::array<int, 3>& sizes, int channels) {
    std::vector<Wide> buffer(static_cast<std::size_t>(io.GetImageSizeInComponents()));
    io.Read(buffer.data());
    const bool fits = all_fit_int32(buffer);
    cv::Mat voxels(3, sizes.data(), CV_MAKETYPE(fits ? CV_32S : CV_64F, channels));
    if (fits)
        std::transform(buffer.begin(), buffer.end(), voxels.ptr<int>(), [](Wide v) { return static_cast<int>(v); });
    else
        std::transform(buffer.begin(), buffer.end(), voxels.ptr<double>(),
                       [](Wide v) { return static_cast<double>(v); });
    return voxels;
}

void require_scalar_or_vector(const itk::ImageIOBase& io, const std::filesystem::path& path) {
    const auto components = io.GetNumberOfComponents();
    const auto type = io.GetPixelType();
    using Pixel = itk::ImageIOBase::IOPixelType;
    const bool colour = type == Pixel::RGBA || (type == Pixel::RGB && io.GetComponentType() == Component::UCHAR);
    if ((components == 1 || components == 3) && !colour) return;
    throw InvalidInput("cannot use '" + path.string() + "': its voxels are '" +
                       itk::ImageIOBase::GetPixelTypeAsString(type) + "' of " + std::to_string(components) +
                       " components; give one grey value or a vector of three");
}

}  // namespace

std::string one_line(const itk::ExceptionObject& error) {
    std::string text = error.GetDescription();
    // ITK opens with "ITK ERROR: NiftiImageIO(0x…): ".
    if (const auto colon = text.rfind("): "); text.rfind("ITK ERROR", 0) == 0 && colon != std::string::npos)
        text = text.substr(colon + 3);
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text.substr(0, 300);
}

Geometry geometry_of(const itk::ImageIOBase& io) {
    Geometry geometry;
    const unsigned dimensions = std::min(io.GetNumberOfDimensions(), 3U);
    geometry.size = {1, 1, 1};
    for (unsigned axis = 0; axis < dimensions; ++axis) {
        geometry.size[axis] = static_cast<int>(io.GetDimensions(axis));
        geometry.origin[axis] = io.GetOrigin(axis);
        geometry.spacing[axis] = io.GetSpacing(axis);
        const std::vector<double> direction = io.GetDirection(axis);
        for (unsigned row = 0; row < 3; ++row) geometry.direction(row, axis) = direction[row];
    }
    return geometry;
}

cv::Mat read_voxels(itk::ImageIOBase& io, const Geometry& geometry, const std::filesystem::path& path) {
    for (unsigned axis = 3; axis < io.GetNumberOfDimensions(); ++axis)
        if (io.GetDimensions(axis) > 1)
            throw InvalidInput("cannot use '" + path.string() + "': it has " + std::to_string(io.GetDimensions(axis)) +
                               " volumes along axis " + std::to_string(axis) + "; extract one of them");
    itk::ImageIORegion region(io.GetNumberOfDimensions());
    for (unsigned axis = 0; axis < io.GetNumberOfDimensions(); ++axis) region.SetSize(axis, io.GetDimensions(axis));
    io.SetIORegion(region);
    const std::array<int, 3> sizes{geometry.size[2], geometry.size[1], geometry.size[0]};
    const auto channels = static_cast<int>(io.GetNumberOfComponents());
    if (const int depth = opencv_depth(io.GetComponentType()); depth >= 0) {
        cv::Mat voxels(3, sizes.data(), CV_MAKETYPE(depth, channels));
        io.Read(voxels.data);
        return voxels;
    }
    switch (io.GetComponentType()) {
        case Component::UINT:
            return narrowed<unsigned int>(io, sizes, channels);
        case Component::LONG:
            return narrowed<long>(io, sizes, channels);
        case Component::ULONG:
            return narrowed<unsigned long>(io, sizes, channels);
        case Component::LONGLONG:
            return narrowed<long long>(io, sizes, channels);
        case Component::ULONGLONG:
            return narrowed<unsigned long long>(io, sizes, channels);
        default:
            throw InvalidInput("cannot use '" + path.string() + "': voxels of type '" +
                               itk::ImageIOBase::GetComponentTypeAsString(io.GetComponentType()) +
                               "' are not supported; convert them to int16 or float32");
    }
}

Volume read_through_itk(const std::filesystem::path& path, Format format) {
    try {
        const ImageIo io = make_image_io(format);
        io->SetFileName(path.string());
        io->ReadImageInformation();
        const Geometry geometry = geometry_of(*io);
        require_valid(geometry, path.c_str());
        if (format == Format::Nifti) return {geometry, read_nifti_voxels(path, read_nifti_header(path))};
        require_scalar_or_vector(*io, path);
        return {geometry, read_voxels(*io, geometry, path)};
    } catch (const itk::ExceptionObject& error) {
        throw IoError("cannot read '" + path.string() + "': " + one_line(error) + "; check or convert the file");
    } catch (const std::bad_alloc&) {
        throw IoError("cannot read '" + path.string() + "': it does not fit into memory");
    }
}

void write_through_itk(const Volume& volume, const std::filesystem::path& path, Format format) {
    try {
        const ImageIo io = make_image_io(format);
        const Geometry& grid = volume.geometry;
        io->SetNumberOfDimensions(3);
        itk::ImageIORegion region(3);
        for (unsigned axis = 0; axis < 3; ++axis) {
            io->SetDimensions(axis, static_cast<unsigned>(grid.size[axis]));
            io->SetOrigin(axis, grid.origin[axis]);
            io->SetSpacing(axis, grid.spacing[axis]);
            const Eigen::Vector3d direction = grid.direction.col(axis);
            io->SetDirection(axis, std::vector<double>(direction.data(), direction.data() + 3));
            region.SetSize(axis, static_cast<itk::SizeValueType>(grid.size[axis]));
        }
        io->SetIORegion(region);
        io->SetComponentType(itk_component(volume.voxels.depth()));
        io->SetNumberOfComponents(static_cast<unsigned>(volume.channels()));
        io->SetPixelType(volume.channels() == 1 ? itk::ImageIOBase::IOPixelType::SCALAR
                                                : itk::ImageIOBase::IOPixelType::VECTOR);
        io->SetUseCompression(format != Format::Nifti);
        io->SetCompressionLevel(1);
        io->SetFileName(path.string());
        io->Write(volume.voxels.data);
    } catch (const itk::ExceptionObject& error) {
        throw IoError("cannot write '" + path.string() + "': " + one_line(error));
    }
}

}  // namespace tissuewarp::imaging::detail
