#include "server/codec/decode/zip_reader.h"

#include <type_traits>

#include <archive.h>
#include <archive_entry.h>
#include <locale.h>

namespace isomesh::codec::decoding {
namespace {

using Locale = std::unique_ptr<std::remove_pointer_t<locale_t>, decltype(&freelocale)>;

// Without it names beyond ASCII are not told. Made when the program starts: later that may be
// confined, and a locale is read from files.
const Locale utf8(newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr), freelocale);

}  // namespace

class ZipReader::Library {
 public:
  Library(Bytes file, MeshFormat format)
      : format_(format), archive_(archive_read_new(), archive_read_free) {
    check(utf8 != nullptr && archive_ != nullptr ? ARCHIVE_OK : ARCHIVE_FATAL);
    check(archive_read_support_format_zip_seekable(archive_.get()));
    check(archive_read_open_memory(archive_.get(), file.data(), file.size()));
  }

  std::optional<std::string> next() {
    const locale_t before = uselocale(utf8.get());
    archive_entry* entry = nullptr;
    const int status = archive_read_next_header(archive_.get(), &entry);
    const char* name = status == ARCHIVE_OK ? archive_entry_pathname_utf8(entry) : nullptr;
    std::optional<std::string> result;
    if (name != nullptr) result = name;
    uselocale(before);
    if (status == ARCHIVE_EOF) return std::nullopt;
    check(status);
    if (!result) refuse(format_, "the name of a file in it cannot be read");
    return result;
  }

  void read(const std::function<void(Bytes)>& take) {
    std::size_t read = 0;
    for (;;) {
      const void* data = nullptr;
      std::size_t bytes = 0;
      la_int64_t offset = 0;
      const int status = archive_read_data_block(archive_.get(), &data, &bytes, &offset);
      if (status == ARCHIVE_EOF) return;
      check(status);
      if (static_cast<std::size_t>(offset) != read) refuse(format_, "a file in it has a gap");
      read += bytes;
      take({static_cast<const std::byte*>(data), bytes});
    }
  }

 private:
  void check(int status) const {
    if (status == ARCHIVE_OK) return;
    const char* reason = archive_ ? archive_error_string(archive_.get()) : nullptr;
    refuse(format_,
           std::string("libarchive reports: ") + (reason == nullptr ? "no reason" : reason));
  }

  MeshFormat format_;
  std::unique_ptr<archive, decltype(&archive_read_free)> archive_;
};

ZipReader::ZipReader(Bytes file, MeshFormat format)
    : library_(std::make_unique<Library>(file, format)) {}

ZipReader::~ZipReader() = default;

std::optional<std::string> ZipReader::next() { return library_->next(); }

void ZipReader::read(const std::function<void(Bytes)>& take) { library_->read(take); }

}  // namespace isomesh::codec::decoding
