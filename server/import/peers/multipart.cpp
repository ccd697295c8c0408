#include "server/import/peers/multipart.h"

#include <algorithm>
#include <cerrno>
#include <functional>
#include <span>

#include <fcntl.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kBytesAtOnce = std::size_t{1} << 20;
constexpr std::size_t kLongestHead = 64 * 1024;  // of a part
constexpr std::size_t kLongestBoundary = 70;

[[noreturn]] void throw_cut() {
  throw Error(ErrorCode::kSeriesIncomplete, "the response of the PACS ends before its last part");
}

// The file's bytes in order, with a buffer for lookahead.
class Window {
 public:
  explicit Window(const std::filesystem::path& path) : file_(path) {}

  std::string_view view() const { return std::string_view(buffer_).substr(begin_); }
  void drop(std::size_t count) { begin_ += count; }

  bool more() {
    buffer_.erase(0, begin_);
    begin_ = 0;
    const std::string next = file_.text(at_, kBytesAtOnce);
    at_ += next.size();
    buffer_ += next;
    return !next.empty();
  }

 private:
  InputFile file_;
  std::uint64_t at_ = 0;
  std::size_t begin_ = 0;
  std::string buffer_;
};

using Take = std::function<void(std::string_view bytes)>;

// Passes everything before the next `mark` to `take`, and consumes the mark. Returns false if there
// is none; then everything was passed.
bool take_until(Window& window, const std::string& mark, const Take& take) {
  const std::boyer_moore_horspool_searcher searcher(mark.begin(), mark.end());
  while (true) {
    const std::string_view view = window.view();
    const auto found = std::search(view.begin(), view.end(), searcher);
    const auto before = static_cast<std::size_t>(found - view.begin());
    if (found != view.end()) {
      take(view.substr(0, before));
      window.drop(before + mark.size());
      return true;
    }
    // The end may be the start of a mark.
    const std::size_t sure = view.size() - std::min(view.size(), mark.size() - 1);
    take(view.substr(0, sure));
    window.drop(sure);
    if (!window.more()) {
      take(window.view());
      window.drop(window.view().size());
      return false;
    }
  }
}

// Reads the characters after a boundary. Returns true for the closing one.
bool is_closing(Window& window) {
  while (window.view().size() < 2) {
    if (!window.more()) throw_cut();
  }
  return window.view().starts_with("--");
}

// Skips the rest of the boundary's line and the part's headers, up to the empty line.
void skip_head(Window& window) {
  std::size_t bytes = 0;
  // The empty line may directly follow the boundary's line.
  if (!take_until(window, "\r\n", [&](std::string_view text) { bytes += text.size(); })) {
    throw_cut();
  }
  while (true) {
    std::size_t line = 0;
    if (!take_until(window, "\r\n", [&](std::string_view text) { line += text.size(); })) {
      throw_cut();
    }
    bytes += line;
    if (line == 0) return;
    if (bytes > kLongestHead) {
      throw Error(ErrorCode::kSeriesIncomplete, "a part of the PACS's response is empty");
    }
  }
}

}  // namespace

std::string boundary_of(std::string_view content_type) {
  constexpr std::string_view kName = "boundary=";
  const std::string low = lower(content_type);
  const std::size_t at = low.find(kName);
  std::string_view value = at == std::string::npos ? "" : content_type.substr(at + kName.size());
  if (value.starts_with('"')) {
    value.remove_prefix(1);
    value = value.substr(0, value.find('"'));
  } else {
    value = trimmed(value.substr(0, value.find(';')));
  }
  if (!low.starts_with("multipart/") || value.empty() || value.size() > kLongestBoundary ||
      has_control_characters(value)) {
    throw Error(ErrorCode::kSeriesIncomplete, "the response of the PACS is not multipart/related");
  }
  return std::string(value);
}

std::vector<std::filesystem::path> unpack_multipart(const std::filesystem::path& file,
                                                    const std::string& boundary,
                                                    const std::filesystem::path& folder,
                                                    const MultipartLimits& limits) {
  Window window(file);
  const std::string mark = "\r\n--" + boundary;
  // The first boundary has no preceding line break unless there is a preamble.
  if (!take_until(window, mark.substr(2), [](std::string_view) {})) throw_cut();
  std::vector<std::filesystem::path> parts;
  std::uint64_t bytes = 0;
  while (!is_closing(window)) {
    if (parts.size() == limits.max_parts) {
      throw Error(ErrorCode::kTooLarge, "the series has more than the " +
                                            std::to_string(limits.max_parts) +
                                            " objects that are accepted");
    }
    skip_head(window);
    parts.push_back(folder / std::to_string(parts.size() + 1));
    const Descriptor target(
        ::open(parts.back().c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    if (target.number() < 0) throw_system_error("open", errno);
    const bool is_whole = take_until(window, mark, [&](std::string_view text) {
      bytes += text.size();
      if (bytes > limits.max_bytes) {
        throw Error(ErrorCode::kTooLarge, "the series has more than the " +
                                              std::to_string(limits.max_bytes) +
                                              " bytes that are accepted");
      }
      write_all(target, std::as_bytes(std::span(text)));
    });
    if (!is_whole) throw_cut();
  }
  return parts;
}

}  // namespace isomesh::import
