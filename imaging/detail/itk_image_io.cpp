#include "imaging/detail/itk_image_io.hpp"

#include "core/errors.hpp"

#include <itkMetaDataObject.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <nifti1_io.h>

#include <algorithm>
#include <string>
#include <vector>

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

/// An ITK exception's message on one line, without ITK's file names and line numbers.
std::string one_line(const itk::ExceptionObject& error) {
    std::string text = error.GetDescription();
    // ITK opens with "ITK ERROR: NiftiImageIO(0x…): ".
    if (const auto colon = text.rfind("): "); text.rfind("ITK ERROR", 0) == 0 && colon != std::string::npos)
        text = text.substr(colon + 3);
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text.substr(0, 300);
}

}  // namespace

void write_through_itk(const Volume& volume, const std::filesystem::path& path, Format format,
                       std::optional<FieldType> type) {
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
        if (type && format == Format::Nrrd)
            itk::EncapsulateMetaData<std::string>(io->GetMetaDataDictionary(), field_type_key, name_of(*type));
        io->SetFileName(path.string());
        io->Write(volume.voxels.data);
    } catch (const itk::ExceptionObject& error) {
        throw IoError("cannot write '" + path.string() + "': " + one_line(error));
    }
}

}  // namespace tissuewarp::imaging::detail
