#include "tests/unit/import/dicom/csa_writer.h"

#include <algorithm>
#include <cstdint>

namespace isomesh::import::test {
namespace {

std::string number(std::uint64_t value) {
  std::string bytes;
  for (unsigned shift = 0; shift < 32; shift += 8)
    bytes += static_cast<char>(value >> shift & 0xFF);
  return bytes;
}

std::string filled(std::string text, std::size_t size) {
  text.resize(size, '\0');
  return text;
}

}  // namespace

std::string csa_header(const CsaFields& fields, bool is_newer) {
  std::string bytes = is_newer ? "SV10\4\3\2\1" : "";
  bytes += number(fields.size()) + number(77);
  for (const auto& [name, values] : fields) {
    bytes += filled(name, 64) + number(values.size()) + filled("FD", 4) + number(4);
    // Scanners write six items, whatever is in them.
    const std::size_t items = std::max<std::size_t>(values.size(), 6);
    bytes += number(items) + number(205);
    for (std::size_t item = 0; item < items; ++item) {
      const std::string value = item < values.size() ? values[item] + '\0' : "";
      const std::size_t length = value.size();
      bytes += number(length) + number(length) + number(77) + number(length);
      bytes += filled(value, (length + 3) / 4 * 4);
    }
  }
  return bytes;
}

}  // namespace isomesh::import::test
