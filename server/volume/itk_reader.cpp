#include "server/volume/itk_reader.h"

#include <algorithm>
#include <mutex>

#include <itkMetaImageIO.h>
#include <itkNrrdImageIO.h>

#include "proto/error.h"
#include "server/volume/files.h"
#include "server/volume/source.h"

namespace isomesh::volume {
namespace {

itk::ImageIOBase::Pointer make_reader(FileFormat format) {
  if (format == FileFormat::kNrrd) return itk::NrrdImageIO::New().GetPointer();
  return itk::MetaImageIO::New().GetPointer();
}

// NrrdIO keeps its error messages in globals.
std::mutex itk_mutex;

}  // namespace

Geometry read_itk_geometry(FileFormat format, const std::string& header,
                           const std::filesystem::path& scratch) {
  ScratchFile file(scratch, format == FileFormat::kNrrd ? ".nrrd" : ".mha");
  file.write(std::as_bytes(std::span(header)));
  const std::scoped_lock lock(itk_mutex);
  itk::Object::SetGlobalWarningDisplay(false);
  const itk::ImageIOBase::Pointer reader = make_reader(format);
  try {
    reader->SetFileName(file.path().string());
    reader->ReadImageInformation();
  } catch (const std::exception&) {
    // The text of ITK's exceptions holds paths.
    throw_unusable(
        "The header's description of space cannot be read: it contradicts itself or is "
        "not one of a volume.");
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

}  // namespace isomesh::volume
