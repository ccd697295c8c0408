#include "tests/unit/import/archives.h"

#include <algorithm>
#include <memory>
#include <stdexcept>

#include <archive.h>
#include <archive_entry.h>
#include <zlib.h>

namespace isomesh::import::test {
namespace {

class Writer {
 public:
  Writer() : archive_(::archive_write_new()) {}
  ~Writer() { ::archive_write_free(archive_); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  archive* handle() const { return archive_; }

  void check(int status) const {
    // A warning is a name that this machine cannot spell.
    if (status < ARCHIVE_WARN) throw std::runtime_error(::archive_error_string(archive_));
  }

 private:
  archive* archive_;
};

void set_kind(archive_entry* entry, const Member& member) {
  switch (member.kind) {
    case Member::Kind::kFile:
      ::archive_entry_set_filetype(entry, AE_IFREG);
      ::archive_entry_set_size(entry, static_cast<la_int64_t>(member.bytes.size()));
      return;
    case Member::Kind::kFolder:
      return ::archive_entry_set_filetype(entry, AE_IFDIR);
    case Member::Kind::kLink:
      ::archive_entry_set_filetype(entry, AE_IFLNK);
      return ::archive_entry_set_symlink(entry, member.bytes.c_str());
    case Member::Kind::kHardLink:
      ::archive_entry_set_filetype(entry, AE_IFREG);
      return ::archive_entry_set_hardlink(entry, member.bytes.c_str());
    case Member::Kind::kDevice:
      return ::archive_entry_set_filetype(entry, AE_IFCHR);
  }
}

std::string written(const Writer& writer, const std::vector<Member>& members) {
  std::size_t room = std::size_t{1} << 20;
  for (const Member& member : members) room += member.bytes.size() + 4096;
  std::string file(room, '\0');
  std::size_t used = 0;
  writer.check(::archive_write_open_memory(writer.handle(), file.data(), file.size(), &used));
  for (const Member& member : members) {
    const std::unique_ptr<archive_entry, void (*)(archive_entry*)> entry(::archive_entry_new(),
                                                                         ::archive_entry_free);
    ::archive_entry_set_pathname(entry.get(), member.name.c_str());
    ::archive_entry_set_perm(entry.get(), 0644);
    set_kind(entry.get(), member);
    writer.check(::archive_write_header(writer.handle(), entry.get()));
    if (member.kind != Member::Kind::kFile) continue;
    ::archive_write_data(writer.handle(), member.bytes.data(), member.bytes.size());
  }
  writer.check(::archive_write_close(writer.handle()));
  file.resize(used);
  return file;
}

std::string little_endian(std::uint64_t value, int bytes) {
  std::string text;
  for (int at = 0; at < bytes; ++at) text += static_cast<char>(value >> (8 * at));
  return text;
}

std::string crc_of(std::string_view text) {
  const auto* bytes = reinterpret_cast<const Bytef*>(text.data());
  return little_endian(::crc32(0, bytes, static_cast<uInt>(text.size())), 4);
}

std::string ascii_of(std::string name) {
  std::ranges::replace_if(
      name, [](char c) { return static_cast<unsigned char>(c) >= 0x80; }, '_');
  return name;
}

}  // namespace

std::string zip(const std::vector<Member>& members, Locked locked) {
  const Writer writer;
  writer.check(::archive_write_set_format_zip(writer.handle()));
  if (locked == Locked::kYes) {
    writer.check(::archive_write_set_options(writer.handle(), "zip:encryption=zipcrypt"));
    writer.check(::archive_write_set_passphrase(writer.handle(), "secret"));
  }
  ::archive_write_set_bytes_in_last_block(writer.handle(), 1);
  return written(writer, members);
}

std::string tar(const std::vector<Member>& members) {
  const Writer writer;
  writer.check(::archive_write_set_format_pax_restricted(writer.handle()));
  ::archive_write_set_bytes_in_last_block(writer.handle(), 1);
  return written(writer, members);
}

std::string zip_in_utf8(const std::vector<Member>& members, Utf8Names names) {
  std::string file;
  std::string directory;
  for (const auto& [name, bytes, kind] : members) {
    const bool by_flag = names == Utf8Names::kFlag;
    const std::string told = by_flag ? name : ascii_of(name);
    const std::string field = "\x01" + crc_of(told) + name;
    const std::string extra = by_flag ? "" : "up" + little_endian(field.size(), 2) + field;
    // Both headers of a member have these: version, flags, no compression, time, sums and lengths.
    const std::string common = little_endian(20, 2) + little_endian(by_flag ? 0x800 : 0, 2) +
                               little_endian(0, 2) + little_endian(0x21'0000, 4) + crc_of(bytes) +
                               little_endian(bytes.size(), 4) + little_endian(bytes.size(), 4) +
                               little_endian(told.size(), 2) + little_endian(extra.size(), 2);
    directory += "PK\x01\x02" + little_endian(20, 2) + common + std::string(10, '\0') +
                 little_endian(file.size(), 4) + told + extra;
    file += "PK\x03\x04" + common + told + extra + bytes;
  }
  const std::string count = little_endian(members.size(), 2);
  return file + directory + "PK\x05\x06" + little_endian(0, 4) + count + count +
         little_endian(directory.size(), 4) + little_endian(file.size(), 4) + little_endian(0, 2);
}

std::string without_name(std::string tar, std::string_view name) {
  constexpr std::size_t kBlock = 512;
  for (std::size_t at = 0; at + kBlock <= tar.size(); at += kBlock) {
    const std::string_view field = std::string_view(tar).substr(at, name.size() + 1);
    if (field != std::string(name) + '\0') continue;
    // The field ends before it begins; the sum of its bytes is what it was.
    const auto first = tar.begin() + static_cast<std::ptrdiff_t>(at);
    const auto end = first + static_cast<std::ptrdiff_t>(name.size());
    std::rotate(first, end, end + 1);
    return tar;
  }
  throw std::logic_error("no member has that name");
}

}  // namespace isomesh::import::test
