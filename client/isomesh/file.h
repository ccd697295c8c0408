// Files of this machine as the client needs them: one that is read while it is sent, and one that
// appears at once, whole, or not at all. Errors are Error kInvalidParameter that name the file (the
// caller chose it), or kOutOfSpace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

namespace isomesh {

// Owns a file descriptor; -1 owns nothing.
class Descriptor {
 public:
  explicit Descriptor(int value = -1) : value_(value) {}
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int value() const { return value_; }

 private:
  int value_;
};

// A regular file to read from. Its size is taken when it is opened.
class InputFile {
 public:
  explicit InputFile(const std::filesystem::path& path);

  std::uint64_t size() const { return size_; }

  // Fills `target` from `offset`; throws when the file ends before, because it was cut meanwhile.
  void read(std::uint64_t offset, std::span<char> target) const;

 private:
  std::filesystem::path path_;
  Descriptor file_;
  std::uint64_t size_ = 0;
};

// A file under construction beside `target`. What was written appears at `target`, replacing what
// is there, with `publish`; without it nothing remains. A target that is a link is followed; one
// that is neither a regular file nor absent is refused by the constructor.
class PartFile {
 public:
  explicit PartFile(const std::filesystem::path& target);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  void write(std::string_view bytes);

  // Forgets what was written.
  void restart();

  // Makes the bytes durable, then visible; to be called once, and nothing after it.
  void publish();

 private:
  std::filesystem::path target_;
  std::filesystem::path part_;
  Descriptor file_;
  bool published_ = false;
};

}  // namespace isomesh
