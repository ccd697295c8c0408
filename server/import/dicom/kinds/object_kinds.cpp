#include "server/import/dicom/kinds/object_kinds.h"

#include <algorithm>
#include <string_view>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/volume/object_classes.h"

namespace isomesh::import::dicom {
std::optional<std::string> reason_to_ignore(const DicomFile& file) {
  const DataSet& data = file.data();
  if (data.find(kDirectoryRecordSequence) != nullptr) return "it is a directory of DICOM files";
  const std::string_view sop_class = data.text(kSopClassUid);
  const auto kind = volume::kind_without_images(
      sop_class.empty() ? std::string_view(file.meta().sop_class_uid) : sop_class);
  if (kind) {
    return "it is " + std::string(*kind) + " (modality " + in_quotes(data.text(kModality)) + ")";
  }
  if (data.find(kRows) == nullptr && !file.pixels()) {
    return "it is not an image (modality " + in_quotes(data.text(kModality)) + ")";
  }
  const auto types = data.texts(kImageType);
  if (std::ranges::find(types, "LOCALIZER") != types.end()) return "it is a localiser";
  return std::nullopt;
}

}  // namespace isomesh::import::dicom
