#include "server/import/dicom/elements/text.h"

#include "server/import/dicom/elements/character_sets.h"
#include "server/import/dicom/elements/tags.h"

namespace isomesh::import::dicom {
namespace {

// Implicit elements do not declare that they are names.
TextKind kind_of(Tag tag) {
  return tag == kPatientName || tag == kReferringPhysician ? TextKind::kPersonName
                                                           : TextKind::kText;
}

}  // namespace

std::string utf8(const DataSet& data, Tag tag) {
  const std::string_view text = data.text(tag);
  if (text.empty()) return {};
  const std::string_view terms =
      data.character_set ? without_padding(*data.character_set) : std::string_view();
  return decoded(text, terms, kind_of(tag));
}

}  // namespace isomesh::import::dicom
