// Reads the lines of text headers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/limits.h"

namespace isomesh::import {

using limits::kMostTextHeaderBytes;
using limits::kMostTextHeaderLines;

struct LineLimits {
  std::string_view header;  // its name at the beginning of a sentence: "The NRRD header"
  std::uint64_t bytes = kMostTextHeaderBytes;
  std::uint64_t lines = kMostTextHeaderLines;
};

// Takes lines from a file, through a buffer: reading many short lines costs no more than reading
// their bytes. Its limits apply to all lines together. Views are valid until the next call. Not
// thread safe.
class LineReader {
 public:
  // `file` must outlive this object.
  LineReader(const InputFile& file, const LineLimits& limits, std::uint64_t offset = 0)
      : file_(&file), limits_(limits), start_(offset) {}

  // Reads a text in memory, without limits.
  explicit LineReader(std::string_view text)
      : limits_({.header = {}, .bytes = text.size(), .lines = text.size()}), buffer_(text) {}

  // The next line without its line break; empty at the end of the file. Throws Error
  // kUnusableVolume that names the limit if the lines are longer or more.
  std::optional<std::string_view> next();

  // The same, but a last line without a line break is as missing.
  std::optional<std::string_view> next_ended();

  // The next line that is not only white space, trimmed.
  std::optional<std::string_view> next_filled();

  // The offset behind the last line.
  std::uint64_t offset() const { return start_ + begin_; }

  // Continues there; forward or back.
  void move_to(std::uint64_t offset);

  // Some bytes from offset() on, which need not be lines and have no limits; empty at the end of
  // the file. `drop` skips that many of them.
  std::string_view view();
  void drop(std::size_t count) { begin_ += count; }

 private:
  bool fill();
  void count(std::size_t bytes);
  [[noreturn]] void throw_beyond(std::uint64_t limit, std::string_view unit) const;

  const InputFile* file_ = nullptr;  // null for a text in memory
  LineLimits limits_;
  std::string buffer_;
  std::uint64_t start_ = 0;  // of the buffer in the file
  std::size_t begin_ = 0;    // of the next line in the buffer
  std::uint64_t bytes_ = 0;  // of all lines until now
  std::uint64_t lines_ = 0;
  bool is_ended_ = true;  // false after a line without a line break
};

// All further lines that are not only white space, trimmed.
std::vector<std::string> rest_of(LineReader& lines);

}  // namespace isomesh::import
