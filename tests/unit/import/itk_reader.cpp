#include "tests/unit/import/itk_reader.h"

#include <algorithm>

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

namespace isomesh::import::test {
namespace {

itk::ImageIOBase::Pointer make_reader(ItkFormat format) {
  switch (format) {
    case ItkFormat::kNifti:
      return itk::NiftiImageIO::New().GetPointer();
    case ItkFormat::kNrrd:
      return itk::NrrdImageIO::New().GetPointer();
    case ItkFormat::kMetaImage:
      break;
  }
  return itk::MetaImageIO::New().GetPointer();
}

}  // namespace

std::optional<Geometry> itk_geometry(ItkFormat format, const std::filesystem::path& path) {
  itk::Object::SetGlobalWarningDisplay(false);
  const itk::ImageIOBase::Pointer reader = make_reader(format);
  try {
    reader->SetFileName(path.string());
    reader->ReadImageInformation();
  } catch (const itk::ExceptionObject&) {
    return std::nullopt;
  }
  Geometry geometry;
  const std::size_t axes = std::min<std::size_t>(reader->GetNumberOfDimensions(), 3);
  for (std::size_t axis = 0; axis < axes; ++axis) {
    const auto index = static_cast<unsigned>(axis);
    geometry.origin[axis] = reader->GetOrigin(index);
    geometry.spacing[axis] = reader->GetSpacing(index);
    const std::vector<double> direction = reader->GetDirection(index);
    for (std::size_t row = 0; row < std::min(axes, direction.size()); ++row) {
      geometry.direction[row * 3 + axis] = direction[row];
    }
  }
  return geometry;
}

}  // namespace isomesh::import::test
