// What ITK itself makes of a file: reads a transform (.h5, .tfm, .txt) or a displacement field (.nii, .nii.gz, .nrrd,
// .mha) by ITK's own readers, and maps points "x y z" of standard input, LPS mm, a line each. With "--types" it prints
// the names of the transform's parts instead.
#include <itkCompositeTransform.h>
#include <itkDisplacementFieldTransform.h>
#include <itkHDF5TransformIOFactory.h>
#include <itkImageFileReader.h>
#include <itkMetaImageIOFactory.h>
#include <itkNiftiImageIOFactory.h>
#include <itkNrrdImageIOFactory.h>
#include <itkTransformFileReader.h>
#include <itkTxtTransformIOFactory.h>

#include <cstdio>
#include <iostream>
#include <string>

namespace {

using Transform = itk::Transform<double, 3, 3>;
using Composite = itk::CompositeTransform<double, 3>;

bool is_field(const std::string& name) {
    return name.ends_with(".nii") || name.ends_with(".nii.gz") || name.ends_with(".nrrd") || name.ends_with(".mha");
}

Transform::Pointer read_field(const std::string& name) {
    using Field = itk::DisplacementFieldTransform<double, 3>;
    const auto reader = itk::ImageFileReader<Field::DisplacementFieldType>::New();
    reader->SetFileName(name);
    reader->Update();
    const auto transform = Field::New();
    transform->SetDisplacementField(reader->GetOutput());
    return transform.GetPointer();
}

Transform::Pointer read_transform(const std::string& name) {
    const auto reader = itk::TransformFileReaderTemplate<double>::New();
    reader->SetFileName(name);
    reader->Update();
    if (reader->GetTransformList()->size() != 1) throw std::runtime_error("the file holds not one transform");
    return dynamic_cast<Transform*>(reader->GetModifiableTransformList()->front().GetPointer());
}

void print_types(const Transform& transform) {
    std::cout << transform.GetNameOfClass() << "\n";
    if (const auto* composite = dynamic_cast<const Composite*>(&transform))
        for (unsigned n = 0; n < composite->GetNumberOfTransforms(); ++n)
            std::cout << composite->GetNthTransformConstPointer(n)->GetNameOfClass() << "\n";
}

}  // namespace

int main(int argc, char** argv) {
    itk::HDF5TransformIOFactory::RegisterOneFactory();
    itk::TxtTransformIOFactory::RegisterOneFactory();
    itk::NiftiImageIOFactory::RegisterOneFactory();
    itk::NrrdImageIOFactory::RegisterOneFactory();
    itk::MetaImageIOFactory::RegisterOneFactory();
    try {
        const std::string name = argv[1];
        const Transform::Pointer transform = is_field(name) ? read_field(name) : read_transform(name);
        if (argc > 2 && std::string(argv[2]) == "--types") {
            print_types(*transform);
            return 0;
        }
        for (Transform::InputPointType point; std::cin >> point[0] >> point[1] >> point[2];) {
            const auto mapped = transform->TransformPoint(point);
            std::printf("%.17g %.17g %.17g\n", mapped[0], mapped[1], mapped[2]);
        }
    } catch (const std::exception& error) {
        std::cerr << error.what() << "\n";
        return 1;
    }
    return 0;
}
