#include "server/import/archives/archive.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <functional>
#include <memory>
#include <set>
#include <span>

#include <archive.h>
#include <archive_entry.h>
#include <fcntl.h>
#include <locale.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/import/limits.h"
#include "server/import/source/old_encodings.h"
#include "server/import/source/source.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kTarBlock = 512;
constexpr std::size_t kTarRecord = 20 * kTarBlock;

[[noreturn]] void throw_archive_error(archive* source) {
  const char* reason = ::archive_error_string(source);
  throw_unusable("The archive is damaged or truncated: " +
                 in_quotes(reason == nullptr ? "no reason known" : reason) + ".");
}

// Reads the leading octal digits of a field in a TAR's header.
std::uint64_t octal(std::string_view text) {
  std::uint64_t value = 0;
  const std::size_t first = text.find_first_not_of(' ');
  for (const char digit : text.substr(std::min(first, text.size()))) {
    if (digit < '0' || digit > '7') break;
    value = value * 8 + static_cast<std::uint64_t>(digit - '0');
  }
  return value;
}

// True for members that are hidden or in a hidden folder, such as those of version control, and for
// the files that macOS adds to archives. A Zarr's metadata are hidden files, too, but needed.
bool is_hidden(std::string_view name) {
  constexpr std::array<std::string_view, 3> kOfZarr = {".zarray", ".zattrs", ".zgroup"};
  while (!name.empty()) {
    const std::string_view part = name.substr(0, name.find('/'));
    if (part == name && std::ranges::find(kOfZarr, part) != kOfZarr.end()) return false;
    if (part == "__MACOSX" || (part.starts_with('.') && part != "." && part != "..")) return true;
    name.remove_prefix(std::min(part.size() + 1, name.size()));
  }
  return false;
}

// A file name made from the safe characters of a member's name.
std::string plain_name(std::string_view name) {
  constexpr std::size_t kLongest = 100;
  std::string plain(base_of(name).substr(0, kLongest));
  std::ranges::replace_if(plain, std::not_fn(is_plain), '_');
  return plain;
}

// Null if the machine lacks it.
locale_t utf8_locale() {
  static const locale_t locale = ::newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr);
  return locale;
}

// The library drops names that a ZIP declares as UTF-8 if the locale cannot represent them. It
// keeps those of a TAR, and would compose their letters in this locale: then they could differ from
// the names in a header.
class NamesInUtf8 {
 public:
  explicit NamesInUtf8(bool is_zip) : before_(::uselocale(is_zip ? utf8_locale() : nullptr)) {}
  ~NamesInUtf8() { ::uselocale(before_); }
  NamesInUtf8(const NamesInUtf8&) = delete;
  NamesInUtf8& operator=(const NamesInUtf8&) = delete;

 private:
  locale_t before_;
};

class OpenArchive {
 public:
  explicit OpenArchive(const InputFile& file)
      : file_(file), archive_(::archive_read_new()), is_zip_(is_zip(file.text(0, 4))) {
    if (!archive_) throw Error(ErrorCode::kInternal, "archive_read_new failed.");
    // The end of a ZIP alone; the library takes it for damaged.
    if (file.text(0, 4) == "PK\x05\x06") throw_empty_archive();
    // Read a ZIP by its central directory, which shows whether members are missing.
    ::archive_read_support_format_zip_seekable(archive_.get());
    ::archive_read_support_format_tar(archive_.get());
    constexpr std::size_t kArchivePieceBytes = std::size_t{1} << 17;
    if (::archive_read_open_fd(archive_.get(), file.descriptor(), kArchivePieceBytes) !=
        ARCHIVE_OK) {
      throw_archive_error(archive_.get());
    }
  }

  // Returns the next member; null after the last.
  archive_entry* next() {
    // If the rest of the last member is missing, the archive was truncated.
    if (in_member_ && ::archive_read_data_skip(archive_.get()) != ARCHIVE_OK) {
      throw_archive_error(archive_.get());
    }
    before_next_ = static_cast<std::uint64_t>(::archive_filter_bytes(archive_.get(), 0));
    archive_entry* entry = nullptr;
    const NamesInUtf8 names(is_zip_);
    const int status = ::archive_read_next_header(archive_.get(), &entry);
    in_member_ = false;
    if (status == ARCHIVE_EOF) return nullptr;
    // The library warns of a TAR's names that the locale cannot represent, and keeps them.
    if (status != ARCHIVE_OK && status != ARCHIVE_WARN) throw_archive_error(archive_.get());
    in_member_ = true;
    return entry;
  }

  std::size_t read(std::span<std::byte> target) {
    const la_ssize_t count = ::archive_read_data(archive_.get(), target.data(), target.size());
    // Warnings are errors here: the library warns of wrong checksums.
    if (count < 0) throw_archive_error(archive_.get());
    return static_cast<std::size_t>(count);
  }

  // Valid after the first member was read.
  bool is_tar() const {
    return (::archive_format(archive_.get()) & ARCHIVE_FORMAT_BASE_MASK) == ARCHIVE_FORMAT_TAR;
  }

  // A TAR ends with at least two blocks of zeros and nothing else. The library does not require
  // them, but without them the archive may have been truncated between two members.
  void require_end() const {
    if (!is_tar()) return;
    std::uint64_t at = (before_next_ + kTarBlock - 1) / kTarBlock * kTarBlock;
    if (file_.size() < at + 2 * kTarBlock) {
      throw_unusable("The archive is truncated: its end is missing.");
    }
    std::vector<std::byte> piece(std::size_t{1} << 17);
    while (const std::size_t count = file_.read(at, piece)) {
      const auto rest = std::span(piece).first(count);
      if (std::ranges::any_of(rest, [](std::byte b) { return b != std::byte{0}; })) {
        throw_unusable("The archive is followed by data that is not part of it.");
      }
      at += count;
    }
  }

 private:
  struct Free {
    void operator()(archive* object) const { ::archive_read_free(object); }
  };

  const InputFile& file_;
  std::unique_ptr<archive, Free> archive_;
  const bool is_zip_;
  std::uint64_t before_next_ = 0;
  bool in_member_ = false;
};

// In UTF-8, whatever the archive says: names are shown and chosen by people.
std::string name_of(archive_entry* entry, std::size_t number, OldEncoding otherwise) {
  for (const char* name : {::archive_entry_pathname_utf8(entry), ::archive_entry_pathname(entry)}) {
    if (name != nullptr) return as_utf8(name, otherwise);
  }
  return "member " + std::to_string(number);
}

bool is_regular(archive_entry* entry) {
  return ::archive_entry_filetype(entry) == AE_IFREG && ::archive_entry_hardlink(entry) == nullptr;
}

class Unpacker {
 public:
  Unpacker(const std::filesystem::path& source, const ArchiveLimits& limits)
      : file_(source), reader_(file_), limits_(limits) {}

  std::vector<ArchiveMember> unpack(const std::filesystem::path& folder, const MemberBound& bound) {
    std::vector<ArchiveMember> members;
    std::set<std::string> names;
    for_each_file([&](archive_entry* entry, const std::string& name) {
      if (base_of(name).empty()) {
        throw_unusable("The archive is damaged: its member " + std::to_string(entries_) +
                       " has no name.");
      }
      if (!names.insert(name).second) {
        throw_unusable("The archive contains the member " + in_quotes(name) + " twice.");
      }
      if (::archive_entry_size_is_set(entry) != 0) {
        check_total(static_cast<std::uint64_t>(::archive_entry_size(entry)));
      }
      const std::filesystem::path place = folder / std::to_string(entries_);
      std::filesystem::create_directory(place);
      ArchiveMember member = {.name = name, .path = place / plain_name(name)};
      if (unpack_one(member, bound)) members.push_back(member);
      if (!member.is_whole && ::archive_entry_size_is_set(entry) != 0) {
        members.back().bytes = static_cast<std::uint64_t>(::archive_entry_size(entry));
      }
    });
    reader_.require_end();
    if (names.empty()) throw_empty_archive();
    return members;
  }

  void unpack_whole(const std::map<std::string, std::filesystem::path>& places,
                    const std::map<std::filesystem::path, std::uint64_t>& most) {
    for_each_file([&](archive_entry*, const std::string& name) {
      const auto place = places.find(name);
      if (place == places.end()) return;
      const Descriptor target(::open(place->second.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC));
      if (target.number() < 0) throw_system_error("open", errno);
      write_rest(name, target, 0, most.at(place->second));
    });
  }

 private:
  template <class Use>
  void for_each_file(const Use& use) {
    while (archive_entry* entry = reader_.next()) {
      if (++entries_ > limits_.max_members) {
        throw Error(ErrorCode::kTooLarge, "The archive has more than the " +
                                              std::to_string(limits_.max_members) +
                                              " members that are accepted.");
      }
      const std::string name =
          name_of(entry, entries_, reader_.is_tar() ? OldEncoding::kLatin1 : OldEncoding::kIbm437);
      if (::archive_entry_is_encrypted(entry) != 0) {
        throw_unusable("The archive is encrypted. Send it without a password.");
      }
      // A TAR is not compressed, but its files can be sparse.
      if (reader_.is_tar() && ::archive_entry_sparse_count(entry) > 0) {
        throw_unusable("The archive contains sparse files, which are not accepted.");
      }
      if (is_regular(entry) && !is_hidden(name)) use(entry, name);
    }
  }

  // Returns false for an empty member.
  bool unpack_one(ArchiveMember& member, const MemberBound& bound) {
    const Descriptor target(
        ::open(member.path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    if (target.number() < 0) throw_system_error("open", errno);
    while (member.bytes < kBeginningBytes) {
      const std::size_t count = write_piece(target, kBeginningBytes - member.bytes);
      if (count == 0) return member.bytes > 0;
      member.bytes += count;
    }
    const auto most = bound(member.path);
    member.is_whole = most.has_value();
    member.bytes = most ? write_rest(member.name, target, member.bytes, *most) : 0;
    return true;
  }

  // Writes a member from byte `bytes` on. Returns its total size.
  std::uint64_t write_rest(const std::string& name, const Descriptor& target, std::uint64_t bytes,
                           std::uint64_t most) {
    while (const std::size_t count = write_piece(target, buffer_.size())) {
      bytes += count;
      if (bytes <= most) continue;
      throw_unusable("The archive's member " + in_quotes(name) + " has more than the " +
                     std::to_string(most) + " bytes that its header allows.");
    }
    return bytes;
  }

  std::size_t write_piece(const Descriptor& target, std::uint64_t most) {
    const auto piece = std::span(buffer_).first(std::min<std::uint64_t>(buffer_.size(), most));
    const std::size_t count = reader_.read(piece);
    check_total(count);
    total_ += count;
    write_all(target, piece.first(count));
    return count;
  }

  void check_total(std::uint64_t further) const {
    if (further > limits_.max_bytes - std::min(total_, limits_.max_bytes)) {
      throw Error(ErrorCode::kTooLarge, "The archive unpacks to more than the " +
                                            std::to_string(limits_.max_bytes) +
                                            " bytes that are accepted.");
    }
    if (reader_.is_tar() && total_ + further > file_.size()) {
      throw_unusable("The archive is truncated: its members have more bytes than it has.");
    }
    if (total_ + further > most_unpacked_bytes(file_.size())) {
      throw_unusable("The archive unpacks to more than " +
                     std::to_string(limits::kMostArchivePerByte) +
                     " times its size. Only decompression bombs do that.");
    }
  }

  InputFile file_;
  OpenArchive reader_;
  ArchiveLimits limits_;
  std::size_t entries_ = 0;
  std::uint64_t total_ = 0;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(std::size_t{1} << 18);
};

}  // namespace

void load_name_encoding() { utf8_locale(); }

void throw_empty_archive() {
  throw_unusable("The archive holds no file. Pack the files of the volume again.");
}

bool is_empty_tar(std::string_view file) {
  return (file.size() == 2 * kTarBlock || file.size() == kTarRecord) &&
         file.find_first_not_of('\0') == file.npos;
}

bool is_zip(std::string_view head) {
  return head.starts_with("PK\x03\x04") || head.starts_with("PK\x05\x06");
}

// A TAR is recognised by the checksum of its first header. The sum counts its own digits as spaces.
bool is_tar(std::string_view head) {
  constexpr std::size_t kChecksumAt = 148;
  constexpr std::size_t kChecksumBytes = 8;
  if (head.size() < kTarBlock || head[0] == '\0') return false;
  std::uint64_t sum = 0;
  for (std::size_t at = 0; at < kTarBlock; ++at) {
    const bool in_checksum = at >= kChecksumAt && at < kChecksumAt + kChecksumBytes;
    sum += in_checksum ? ' ' : static_cast<unsigned char>(head[at]);
  }
  return octal(head.substr(kChecksumAt, kChecksumBytes)) == sum;
}

std::uint64_t most_unpacked_bytes(std::uint64_t archive_bytes) {
  return std::max(limits::kNeverABomb, archive_bytes * limits::kMostArchivePerByte);
}

std::string_view folder_of(std::string_view name) {
  const std::size_t slash = name.rfind('/');
  return slash == std::string_view::npos ? std::string_view{} : name.substr(0, slash + 1);
}

std::string_view base_of(std::string_view name) { return name.substr(folder_of(name).size()); }

std::vector<ArchiveMember> unpack(const std::filesystem::path& archive,
                                  const std::filesystem::path& folder, const ArchiveLimits& limits,
                                  const MemberBound& bound) {
  return Unpacker(archive, limits).unpack(folder, bound);
}

void unpack_whole(const std::filesystem::path& archive, const std::vector<ArchiveMember>& members,
                  const std::map<std::filesystem::path, std::uint64_t>& most,
                  const ArchiveLimits& limits) {
  std::map<std::string, std::filesystem::path> places;
  for (const ArchiveMember& member : members) {
    if (most.contains(member.path)) places.emplace(member.name, member.path);
  }
  Unpacker(archive, limits).unpack_whole(places, most);
}

}  // namespace isomesh::import
