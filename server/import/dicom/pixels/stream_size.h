// The size that the header of a compressed frame declares.
#pragma once

#include <cstdint>

namespace isomesh::import::dicom {

struct StreamSize {
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
  unsigned components = 0;
  unsigned bits = 0;
  bool is_signed = false;  // JPEG, JPEG-LS and JPEG XL have no sign
};

}  // namespace isomesh::import::dicom
