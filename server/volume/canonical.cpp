#include "server/volume/canonical.h"

#include <algorithm>
#include <cerrno>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "proto/error.h"
#include "proto/json_values.h"
#include "server/volume/geometry.h"
#include "server/volume/unusable.h"

namespace isomesh::volume {
namespace {

constexpr int kVersion = 1;
// Pages of a larger file may leave the memory before they are written.
constexpr std::size_t kMostPopulated = std::size_t{1} << 30;

template <std::size_t Size>
std::array<double, Size> without_negative_zeros(std::array<double, Size> values) {
  for (double& value : values) value += 0.0;
  return values;
}

std::string header_text(const CanonicalHeader& header) {
  JsonTree json;
  const auto put = [&](const char* name, const auto& value) {
    json_values::write_field(json.root(), name, value);
  };
  put("version", kVersion);
  put("dims", header.dims);
  put("type", header.type);
  put("spacing", without_negative_zeros(header.geometry.spacing));
  put("origin", without_negative_zeros(header.geometry.origin));
  put("direction", without_negative_zeros(header.geometry.direction));
  std::string text = dump(json.root());
  text.resize(kHeaderBytes - 1, ' ');
  return text + '\n';
}

[[noreturn]] void throw_not_canonical(const std::string& reason) {
  throw Error(ErrorCode::kInternal, "Not a canonical volume: " + reason + ".");
}

CanonicalHeader from_text(const std::string& text) {
  CanonicalHeader header;
  try {
    const JsonTree json(text);
    const auto take = [&](const char* name, auto& value) {
      json_values::read(json_values::existing(json.root(), name), value);
    };
    take("dims", header.dims);
    take("type", header.type);
    take("spacing", header.geometry.spacing);
    take("origin", header.geometry.origin);
    take("direction", header.geometry.direction);
  } catch (const Error&) {
    throw_not_canonical("its header cannot be read");
  }
  // The comparison rejects other versions, additional members, another order, and sizes beyond 32
  // bits.
  if (header_text(header) != text) throw_not_canonical("its header is not in canonical form");
  return header;
}

// Empty if a size is 0 or the number of bytes overflows.
std::optional<std::size_t> file_bytes(const CanonicalHeader& header) {
  std::uint64_t bytes = bytes_per_sample(header.type);
  for (const std::uint64_t size : header.dims) {
    if (size == 0 || bytes > (std::uint64_t{1} << 62) / size) return std::nullopt;
    bytes *= size;
  }
  return bytes + kHeaderBytes;
}

}  // namespace

CanonicalWriter::CanonicalWriter(const std::filesystem::path& path, const CanonicalHeader& header) {
  const auto size = file_bytes(header);
  if (!size) throw Error(ErrorCode::kInternal, "A canonical volume of impossible size.");
  Descriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (file.number() < 0) throw_system_error("open", errno);
  // Allocate all blocks now: otherwise a full disk would raise a signal on writing to the mapping.
  const int error = ::posix_fallocate(file.number(), 0, static_cast<off_t>(*size));
  if (error != 0) throw_system_error("posix_fallocate", error);
  void* data = ::mmap(nullptr, *size, PROT_READ | PROT_WRITE, MAP_SHARED, file.number(), 0);
  if (data == MAP_FAILED) throw_system_error("mmap", errno);
  data_ = static_cast<std::byte*>(data);
  mapped_ = size_ = *size;
  // Far cheaper than page by page on writing. Errors do not matter: kernels before 5.14 cannot.
  if (*size <= kMostPopulated) ::madvise(data_, mapped_, MADV_POPULATE_WRITE);
  file_ = file.release();
  write_header(header);
}

CanonicalWriter::~CanonicalWriter() {
  ::munmap(data_, mapped_);
  ::close(file_);
}

void CanonicalWriter::shorten(const CanonicalHeader& header) {
  const auto size = file_bytes(header);
  if (!size || *size > size_) throw Error(ErrorCode::kInternal, "A volume cannot become longer.");
  if (::ftruncate(file_, static_cast<off_t>(*size)) != 0) throw_system_error("ftruncate", errno);
  size_ = *size;
  write_header(header);
}

void CanonicalWriter::write_header(const CanonicalHeader& header) {
  const std::string text = header_text(header);
  std::copy_n(std::as_bytes(std::span(text)).begin(), kHeaderBytes, data_);
}

std::span<std::byte> CanonicalWriter::samples() {
  return {data_ + kHeaderBytes, size_ - kHeaderBytes};
}

CanonicalFile::CanonicalFile(const std::filesystem::path& path) : CanonicalFile(InputFile(path)) {}

CanonicalFile::CanonicalFile(InputFile file) : file_(std::move(file)) {
  header_ = from_text(file_.text(0, kHeaderBytes));
  const auto size = file_bytes(header_);
  if (!size || *size != file_.size())
    throw_not_canonical("its size differs from that in its header");
  if (find_fault(header_.dims, header_.geometry)) throw_not_canonical("its geometry is unusable");
}

void CanonicalFile::read(std::uint64_t offset, std::span<std::byte> target) const {
  if (file_.read(kHeaderBytes + offset, target) != target.size()) throw_damaged();
}

CanonicalVolume::CanonicalVolume(const std::filesystem::path& path)
    : CanonicalVolume(InputFile(path)) {}

CanonicalVolume::CanonicalVolume(InputFile file) {
  const CanonicalFile canonical(std::move(file));
  header_ = canonical.header();
  size_ = canonical.file_.size();
  void* data = ::mmap(nullptr, size_, PROT_READ, MAP_SHARED, canonical.file_.descriptor(), 0);
  if (data == MAP_FAILED) throw_system_error("mmap", errno);
  data_ = static_cast<const std::byte*>(data);
}

CanonicalVolume::~CanonicalVolume() {
  if (data_ != nullptr) ::munmap(const_cast<std::byte*>(data_), size_);
}

CanonicalVolume::CanonicalVolume(CanonicalVolume&& other) noexcept
    : header_(other.header_),
      data_(std::exchange(other.data_, nullptr)),
      size_(std::exchange(other.size_, 0)) {}

std::span<const std::byte> CanonicalVolume::samples() const {
  if (data_ == nullptr) return {};
  return {data_ + kHeaderBytes, size_ - kHeaderBytes};
}

void CanonicalVolume::preload() const {
  // Errors do not matter: samples that are not preloaded are read on demand.
  ::madvise(const_cast<std::byte*>(data_), size_, MADV_WILLNEED);
}

}  // namespace isomesh::volume
