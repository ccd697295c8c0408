// Texts of files that do not say how they are encoded.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::import {

enum class OldEncoding {
  kLatin1,
  kIbm437,  // the PC's, in which ZIPs have names (APPNOTE.TXT, appendix D)
};

// The text itself if it is valid UTF-8. Otherwise it is read in the old encoding.
std::string as_utf8(std::string_view text, OldEncoding otherwise);

}  // namespace isomesh::import
