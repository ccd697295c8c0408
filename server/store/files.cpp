#include "server/store/files.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <mutex>
#include <utility>

#include <fcntl.h>
#include <openssl/evp.h>
#include <openssl/rand.h>
#include <sys/stat.h>
#include <unistd.h>

#include "proto/error.h"

namespace isomesh::store {
namespace {

// Paths stay out of messages: they are sent to clients.
[[noreturn]] void fail(int error, const char* doing) {
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
    throw Error(ErrorCode::kOutOfSpace, "the data folder has no space left");
  }
  if (error == ENOENT) throw Error(ErrorCode::kNotFound, "the file is not there");
  throw Error(ErrorCode::kInternal, std::string(doing) + ": " + std::strerror(error));
}

}  // namespace

File File::create(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (descriptor < 0) fail(errno, "creating a file");
  return File(descriptor);
}

File File::open(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail(errno, "opening a file");
  return File(descriptor);
}

File& File::operator=(File&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

File::~File() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void File::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(errno, "writing a file");
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

std::size_t File::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  std::size_t total = 0;
  while (total < bytes.size()) {
    const ssize_t count = ::pread(descriptor_, bytes.data() + total, bytes.size() - total,
                                  static_cast<off_t>(offset + total));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(errno, "reading a file");
    if (count == 0) break;
    total += static_cast<std::size_t>(count);
  }
  return total;
}

std::uint64_t File::size() const {
  struct stat status = {};
  if (::fstat(descriptor_, &status) != 0) fail(errno, "reading a file's size");
  return static_cast<std::uint64_t>(status.st_size);
}

void File::sync() {
  if (::fsync(descriptor_) != 0) fail(errno, "syncing a file");
}

void move_to(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) fail(errno, "renaming a file");
}

void publish(const std::filesystem::path& from, const std::filesystem::path& to) {
  move_to(from, to);
  sync_folder(to.parent_path());
}

void sync_folder(const std::filesystem::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) fail(errno, "opening a folder");
  const int result = ::fsync(descriptor);
  const int error = errno;
  ::close(descriptor);
  if (result != 0) fail(error, "syncing a folder");
}

void write_whole(const std::filesystem::path& path, std::string_view text) {
  const std::filesystem::path beside = path.string() + "." + random_hex(8) + ".part";
  try {
    File file = File::create(beside);
    file.write(std::as_bytes(std::span(text)));
    file.sync();
    publish(beside, path);
  } catch (...) {
    std::error_code ignored;  // the first failure is the one to tell
    std::filesystem::remove(beside, ignored);
    throw;
  }
}

std::string read_whole(const std::filesystem::path& path) {
  const File file = File::open(path);
  std::string text(file.size(), '\0');
  text.resize(file.read_at(0, std::as_writable_bytes(std::span(text))));
  return text;
}

struct Sha256::State {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  ~State() { EVP_MD_CTX_free(context); }
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
  if (state_->context == nullptr ||
      EVP_DigestInit_ex(state_->context, EVP_sha256(), nullptr) != 1) {
    throw Error(ErrorCode::kInternal, "SHA-256 is not available");
  }
}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::update(std::span<const std::byte> bytes) {
  if (EVP_DigestUpdate(state_->context, bytes.data(), bytes.size()) != 1) {
    throw Error(ErrorCode::kInternal, "SHA-256 failed");
  }
}

std::array<std::uint8_t, Sha256::kBytes> Sha256::finish() {
  std::array<std::uint8_t, kBytes> digest = {};
  if (EVP_DigestFinal_ex(state_->context, digest.data(), nullptr) != 1) {
    throw Error(ErrorCode::kInternal, "SHA-256 failed");
  }
  return digest;
}

std::string sha256_of(std::string_view text) {
  Sha256 digest;
  digest.update(std::as_bytes(std::span(text)));
  return to_hex(digest.finish());
}

std::string to_hex(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(bytes.size() * 2);
  for (const std::uint8_t byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

std::string random_hex(std::size_t bytes) {
  std::string raw(bytes, '\0');
  auto* data = reinterpret_cast<unsigned char*>(raw.data());
  if (RAND_bytes(data, static_cast<int>(bytes)) != 1) {
    throw Error(ErrorCode::kInternal, "the system's random source failed");
  }
  return to_hex({data, bytes});
}

std::string time_ordered_id() {
  // Ids of the same millisecond are told apart, and put in order, by the twelve bits behind the
  // time (RFC 9562, section 6.2, method 1).
  static std::mutex mutex;
  static std::int64_t last_stamp = 0;
  constexpr int kCounterBits = 12;
  const auto now = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::system_clock::now().time_since_epoch());
  std::int64_t stamp = now.count() << kCounterBits;
  {
    const std::lock_guard lock(mutex);
    stamp = std::max(stamp, last_stamp + 1);
    last_stamp = stamp;
  }
  std::array<char, 20> digits = {};
  std::snprintf(digits.data(), digits.size(), "%015llx", static_cast<unsigned long long>(stamp));
  const std::string time(digits.data());
  const std::string random = random_hex(8);
  return time.substr(0, 8) + '-' + time.substr(8, 4) + "-7" + time.substr(12, 3) + "-a" +
         random.substr(0, 3) + '-' + random.substr(3, 12);
}

std::string timestamp() {
  const auto now = std::chrono::system_clock::now();
  const std::time_t seconds =
      std::chrono::system_clock::to_time_t(std::chrono::floor<std::chrono::seconds>(now));
  const auto fraction = std::chrono::duration_cast<std::chrono::milliseconds>(
                            now - std::chrono::floor<std::chrono::seconds>(now))
                            .count();
  std::tm parts = {};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 20> text = {};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  std::array<char, 16> tail = {};
  std::snprintf(tail.data(), tail.size(), ".%03dZ", static_cast<int>(fraction % 1000));
  return std::string(text.data()) + tail.data();
}

}  // namespace isomesh::store
