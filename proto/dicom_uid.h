#pragma once

#include <cstddef>
#include <string_view>

namespace isomesh {

// True for every UID that DICOM allows (PS3.5, 9.1): digits and dots, at most 64.
inline bool is_uid(std::string_view text) {
  constexpr std::size_t kLongest = 64;
  return !text.empty() && text.size() <= kLongest &&
         text.find_first_not_of("0123456789.") == std::string_view::npos && text.front() != '.' &&
         text.back() != '.' && text.find("..") == std::string_view::npos;
}

}  // namespace isomesh
