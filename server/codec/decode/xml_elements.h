// The elements of an XML file that is in memory; private to this folder.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/codec/decode/formats.h"

namespace isomesh::codec::decoding {

struct XmlElement {
  std::string path;  // "GIFTI/DataArray/Data"
  std::map<std::string, std::string, std::less<>> attributes;
  std::size_t begin = 0;  // of what is in it, in the file
  std::size_t end = 0;    // 0 where reading ended before it did

  // Throws Error kInternal where it is not there.
  std::string_view attribute(std::string_view name, MeshFormat format) const;
};

// All elements in the order in which they begin, as expat reads them, up to and with the first one
// of the name `last`, behind whose tag the file need not be XML; to the end where it is empty.
// Throws Error kInternal, with the format's name, where the file is not well-formed, and
// kCancelled.
std::vector<XmlElement> elements_of(Bytes file, MeshFormat format, std::string_view last,
                                    const mesh::Context& context);

}  // namespace isomesh::codec::decoding
