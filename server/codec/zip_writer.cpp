#include "server/codec/zip_writer.h"

#include <exception>
#include <optional>

#include <archive.h>
#include <archive_entry.h>

#include "proto/error.h"

namespace isomesh::codec {

class ZipWriter::Library {
 public:
  Library(const Sink& sink, Compression compression, Sizes sizes)
      : sink_(sink), archive_(archive_write_new()) {
    std::string options = "zip:hdrcharset=UTF-8,";
    options += compression == Compression::kStored
                   ? "zip:compression=store"
                   : "zip:compression=deflate,zip:compression-level=1";
    if (sizes == Sizes::kBelow4GiB) options += ",zip:!zip64";
    check(archive_ ? archive_write_set_format_zip(archive_.get()) : ARCHIVE_FATAL);
    check(archive_write_set_options(archive_.get(), options.c_str()));
    check(archive_write_set_bytes_per_block(archive_.get(), 0));
    check(archive_write_open(archive_.get(), this, nullptr, take, nullptr));
  }

  // Freeing the archive may still write; discard that.
  ~Library() { is_over_ = true; }

  std::uint64_t begin(const std::string& name, std::optional<std::size_t> bytes) {
    const std::unique_ptr<archive_entry, Free> entry(archive_entry_new());
    check(entry ? ARCHIVE_OK : ARCHIVE_FATAL);
    archive_entry_set_pathname_utf8(entry.get(), name.c_str());
    archive_entry_set_filetype(entry.get(), AE_IFREG);
    archive_entry_set_perm(entry.get(), 0644);
    if (bytes) archive_entry_set_size(entry.get(), static_cast<la_int64_t>(*bytes));
    check(archive_write_header(archive_.get(), entry.get()));
    return written_;
  }

  void write(std::span<const std::byte> bytes) {
    const la_ssize_t taken = archive_write_data(archive_.get(), bytes.data(), bytes.size());
    check(taken == static_cast<la_ssize_t>(bytes.size()) ? ARCHIVE_OK : ARCHIVE_FATAL);
  }

  void finish() {
    check(archive_write_close(archive_.get()));
    is_over_ = true;
  }

 private:
  struct Free {
    void operator()(archive* all) const { archive_write_free(all); }
    void operator()(archive_entry* entry) const { archive_entry_free(entry); }
  };

  // An exception must not pass through the library. It reports success even after a failure,
  // because libarchive would otherwise leak its writer.
  static la_ssize_t take(archive* /*all*/, void* self, const void* bytes, std::size_t count) {
    auto& library = *static_cast<Library*>(self);
    try {
      if (!library.failure_ && !library.is_over_) {
        library.sink_(std::span(static_cast<const std::byte*>(bytes), count));
      }
    } catch (...) {
      library.failure_ = std::current_exception();
    }
    library.written_ += count;
    return static_cast<la_ssize_t>(count);
  }

  void check(int status) const {
    if (failure_) std::rethrow_exception(failure_);
    if (status == ARCHIVE_OK) return;
    const char* reason = archive_ ? archive_error_string(archive_.get()) : nullptr;
    throw Error(ErrorCode::kInternal, std::string("a ZIP could not be written: ") +
                                          (reason == nullptr ? "no memory" : reason));
  }

  const Sink& sink_;
  std::uint64_t written_ = 0;
  std::exception_ptr failure_;
  bool is_over_ = false;
  std::unique_ptr<archive, Free> archive_;  // destroyed first; may still write
};

ZipWriter::ZipWriter(const Sink& sink, Compression compression, Sizes sizes)
    : library_(std::make_unique<Library>(sink, compression, sizes)) {}

ZipWriter::~ZipWriter() = default;

std::uint64_t ZipWriter::add(const std::string& name, std::span<const std::byte> bytes) {
  const std::uint64_t begin = library_->begin(name, bytes.size());
  library_->write(bytes);
  return begin;
}

void ZipWriter::begin(const std::string& name) { library_->begin(name, std::nullopt); }

void ZipWriter::write(std::span<const std::byte> bytes) { library_->write(bytes); }

void ZipWriter::finish() { library_->finish(); }

}  // namespace isomesh::codec
