#include "server/hospital/objects/file_head.h"

#include "server/hospital/objects/data_set.h"
#include "server/hospital/objects/uid.h"

namespace isomesh::dicom {

std::string file_head(std::string_view sop_class, std::string_view instance,
                      std::string_view transfer_syntax) {
  DataSet meta;
  meta.set_bytes(0x00020001, "OB", std::string_view("\0\1", 2));
  meta.set(0x00020002, "UI", sop_class);
  meta.set(0x00020003, "UI", instance);
  meta.set(0x00020010, "UI", transfer_syntax);
  meta.set(0x00020012, "UI", name_based_uid("implementation"));
  meta.set(0x00020013, "SH", "ISOMESH " ISOMESH_VERSION);
  const std::string rest = meta.bytes();
  DataSet length;
  length.set_long(0x00020000, static_cast<std::uint32_t>(rest.size()));
  constexpr std::size_t kPreamble = 128;
  return std::string(kPreamble, '\0') + "DICM" + length.bytes() + rest;
}

}  // namespace isomesh::dicom
