#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include <zlib.h>

#include "server/codec/encode.h"

namespace isomesh::codec {
namespace {

constexpr std::string_view kName = "isomesh.usda";
constexpr std::size_t kAlignment = 64;

struct File {
  std::uint32_t checksum = 0;
  std::uint64_t bytes = 0;
};

// A record of a ZIP: numbers of 16 and 32 bits, little-endian.
class Record {
 public:
  Record& two(std::uint32_t number) { return add(number, 2); }
  Record& four(std::uint32_t number) { return add(number, 4); }
  Record& text(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  Record& add(std::uint32_t number, int count) {
    for (int n = 0; n < count; ++n) bytes_ += static_cast<char>(number >> (8 * n) & 0xff);
    return *this;
  }

  std::string bytes_;
};

// The fields that the local header and the directory have in common.
void describe(const File& file, std::size_t extra_bytes, Record& record) {
  constexpr std::uint32_t kVersionNeeded = 10;
  constexpr std::uint32_t kFirstDay = 0x21;  // of 1980: equal surfaces give equal bytes
  const auto bytes = static_cast<std::uint32_t>(file.bytes);
  record.two(kVersionNeeded).two(0).two(0).two(0).two(kFirstDay);
  record.four(file.checksum).four(bytes).four(bytes);
  record.two(static_cast<std::uint32_t>(kName.size()));
  record.two(static_cast<std::uint32_t>(extra_bytes));
}

std::string header_of(const File& file) {
  constexpr std::size_t kFixedBytes = 30;
  constexpr std::size_t kExtra = kAlignment - kFixedBytes - kName.size();
  constexpr std::uint32_t kPadding = 0x1986;  // as Pixar's library marks it
  Record record;
  record.four(0x04034b50);
  describe(file, kExtra, record);
  record.text(kName).two(kPadding).two(kExtra - 4).text(std::string(kExtra - 4, '\0'));
  return record.bytes();
}

std::string directory_of(const File& file) {
  Record entry;
  entry.four(0x02014b50).two(10);
  describe(file, 0, entry);
  entry.two(0).two(0).two(0).four(0).four(0).text(kName);
  Record end;
  end.four(0x06054b50).two(0).two(0).two(1).two(1);
  end.four(static_cast<std::uint32_t>(entry.bytes().size()));
  end.four(static_cast<std::uint32_t>(kAlignment + file.bytes)).two(0);
  return entry.bytes() + end.bytes();
}

}  // namespace

std::optional<mesh::Topology> encode_usdz(const FileContent& content, const mesh::Context& context,
                                          const Sink& sink) {
  constexpr std::uint64_t kForTheRest = 1024;
  constexpr std::uint64_t kMostBytes = std::numeric_limits<std::uint32_t>::max() - kForTheRest;
  File file;
  encode_usda(content, context.part(0, 0.5), [&](std::span<const std::byte> piece) {
    file.checksum = static_cast<std::uint32_t>(
        crc32_z(file.checksum, reinterpret_cast<const Bytef*>(piece.data()), piece.size()));
    file.bytes += piece.size();
    if (file.bytes <= kMostBytes) return;
    throw Error(ErrorCode::kTooLarge,
                "The surface is larger than a USDZ file can be (4 GiB). Set \"triangles\" to "
                "simplify it.");
  });
  put_text(sink, header_of(file));
  encode_usda(content, context.part(0.5, 1), sink);
  put_text(sink, directory_of(file));
  return std::nullopt;
}

}  // namespace isomesh::codec
