#include "server/import/source/line_reader.h"

#include "base/text.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kReadBytes = std::size_t{1} << 16;

}  // namespace

std::optional<std::string_view> LineReader::next() {
  for (std::size_t looked = 0;;) {
    const std::size_t end = buffer_.find('\n', begin_ + looked);
    looked = buffer_.size() - begin_;
    is_ended_ = end != std::string::npos;
    if (!is_ended_) {
      if (looked > limits_.bytes - bytes_) throw_beyond(limits_.bytes, "bytes");
      if (fill()) continue;
      if (looked == 0) return std::nullopt;
    }
    const std::string_view line =
        std::string_view(buffer_).substr(begin_, is_ended_ ? end - begin_ : looked);
    const std::size_t length = line.size() + (is_ended_ ? 1 : 0);
    begin_ += length;
    count(length);
    return line;
  }
}

std::optional<std::string_view> LineReader::next_ended() {
  const auto line = next();
  return is_ended_ ? line : std::nullopt;
}

std::optional<std::string_view> LineReader::next_filled() {
  while (const auto line = next()) {
    const std::string_view text = trimmed(*line);
    if (!text.empty()) return text;
  }
  return std::nullopt;
}

void LineReader::move_to(std::uint64_t offset) {
  if (offset >= start_ && offset - start_ <= buffer_.size()) {
    begin_ = static_cast<std::size_t>(offset - start_);
    return;
  }
  buffer_.clear();
  start_ = offset;
  begin_ = 0;
}

std::string_view LineReader::view() {
  if (begin_ == buffer_.size()) fill();
  return std::string_view(buffer_).substr(begin_);
}

// Keeps the unread bytes and appends more. Returns false at the end of the file.
bool LineReader::fill() {
  if (file_ == nullptr) return false;
  buffer_.erase(0, begin_);
  start_ += begin_;
  begin_ = 0;
  const std::string more = file_->text(start_ + buffer_.size(), kReadBytes);
  buffer_ += more;
  return !more.empty();
}

void LineReader::count(std::size_t bytes) {
  bytes_ += bytes;
  if (bytes_ > limits_.bytes) throw_beyond(limits_.bytes, "bytes");
  if (++lines_ > limits_.lines) throw_beyond(limits_.lines, "lines");
}

void LineReader::throw_beyond(std::uint64_t limit, std::string_view unit) const {
  throw_unusable(std::string(limits_.header) + " has more than the " + std::to_string(limit) + ' ' +
                 std::string(unit) + " that are supported.");
}

std::vector<std::string> rest_of(LineReader& lines) {
  std::vector<std::string> rest;
  while (const auto line = lines.next_filled()) rest.emplace_back(*line);
  return rest;
}

}  // namespace isomesh::import
