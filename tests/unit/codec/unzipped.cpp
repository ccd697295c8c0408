#include "tests/unit/codec/unzipped.h"

#include <memory>
#include <type_traits>

#include <archive.h>
#include <archive_entry.h>
#include <gtest/gtest.h>
#include <locale.h>

namespace isomesh::test {

std::map<std::string, std::string> unzipped(const std::string& bytes) {
  std::map<std::string, std::string> files;
  archive* reader = archive_read_new();
  archive_read_support_format_zip(reader);
  const std::unique_ptr<std::remove_pointer_t<locale_t>, decltype(&freelocale)> utf8(
      newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr), freelocale);
  const locale_t before = uselocale(utf8.get());  // or names beyond ASCII are not told
  EXPECT_EQ(archive_read_open_memory(reader, bytes.data(), bytes.size()), ARCHIVE_OK);
  archive_entry* entry = nullptr;
  while (archive_read_next_header(reader, &entry) == ARCHIVE_OK) {
    std::string content(static_cast<std::size_t>(archive_entry_size(entry)), '\0');
    EXPECT_EQ(archive_read_data(reader, content.data(), content.size()),
              static_cast<la_ssize_t>(content.size()));
    const char* name = archive_entry_pathname_utf8(entry);
    files[name == nullptr ? "" : name] = content;
  }
  archive_read_free(reader);
  uselocale(before);
  return files;
}

}  // namespace isomesh::test
