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

// Skips one line, with its line break. Returns its length without the break, which may be LF alone;
// `break_bytes` is the length of the break.
std::size_t skip_line(Window& window, std::size_t& break_bytes) {
  std::size_t length = 0;
  char last = '\0';
  const bool is_whole = take_until(window, "\n", [&](std::string_view text) {
    length += text.size();
    if (!text.empty()) last = text.back();
  });
  if (!is_whole) throw_cut();
  break_bytes = last == '\r' ? 2 : 1;
  return length - (break_bytes - 1);
}

// Skips the rest of the boundary's line and the part's headers, up to the empty line. Returns the
// line break of the boundary's line: some PACS end lines with LF alone.
std::string skip_head(Window& window) {
  std::size_t break_bytes = 0;
  std::size_t bytes = skip_line(window, break_bytes);
  const std::string line_break = break_bytes == 2 ? "\r\n" : "\n";
  while (const std::size_t line = skip_line(window, break_bytes)) {
    bytes += line;
    if (bytes > kLongestHead) {
      throw Error(ErrorCode::kSeriesIncomplete, "a part of the PACS's response is empty");
    }
  }
  return line_break;
}

// The value of a parameter of a Content-Type (RFC 9110, 5.6.6). Blanks around "=" are tolerated.
std::string parameter_of(std::string_view content_type, std::string_view name) {
  std::size_t at = content_type.find(';');
  while (at < content_type.size()) {
    const std::size_t equals = content_type.find_first_of("=;", at + 1);
    if (equals == content_type.npos || content_type[equals] == ';') {
      at = equals;
      continue;
    }
    const std::string_view found = trimmed(content_type.substr(at + 1, equals - at - 1));
    std::string value;
    at = content_type.find_first_not_of(" \t", equals + 1);
    if (at != content_type.npos && content_type[at] == '"') {
      for (++at; at < content_type.size() && content_type[at] != '"'; ++at) {
        if (content_type[at] == '\\') ++at;
        if (at < content_type.size()) value += content_type[at];
      }
      at = content_type.find(';', std::min(at, content_type.size()));
    } else if (at != content_type.npos) {
      const std::size_t end = std::min(content_type.find(';', at), content_type.size());
      value = trimmed(content_type.substr(at, end - at));
      at = end;
    }
    if (lower(found) == name) return value;
  }
  return "";
}

}  // namespace

std::string boundary_of(std::string_view content_type) {
  const std::string type(trimmed(lower(content_type.substr(0, content_type.find(';')))));
  const std::string boundary = parameter_of(content_type, "boundary");
  const bool is_usable =
      !boundary.empty() && boundary.size() <= kLongestBoundary && !has_control_characters(boundary);
  if (type.starts_with("multipart/") && is_usable) return boundary;
  if (type.starts_with("multipart/")) {
    throw Error(ErrorCode::kUnusableVolume,
                "the response of the PACS has no usable boundary (Content-Type)");
  }
  if (type.starts_with("application/") || type.starts_with("image/")) {
    throw Error(ErrorCode::kUnusableVolume,
                "the PACS sends the series in another form than multipart/related (Content-Type)");
  }
  // For example, a page of a proxy.
  throw Error(ErrorCode::kSeriesIncomplete, "the response of the PACS is not multipart/related");
}

bool is_single_dicom(std::string_view content_type) {
  return trimmed(lower(content_type.substr(0, content_type.find(';')))) == "application/dicom";
}

std::vector<std::filesystem::path> unpack_multipart(const std::filesystem::path& file,
                                                    const std::string& boundary,
                                                    const std::filesystem::path& folder,
                                                    const MultipartLimits& limits) {
  Window window(file);
  const std::string delimiter = "--" + boundary;
  // The first boundary has no preceding line break unless there is a preamble.
  if (!take_until(window, delimiter, [](std::string_view) {})) throw_cut();
  std::vector<std::filesystem::path> parts;
  std::uint64_t bytes = 0;
  while (!is_closing(window)) {
    if (parts.size() == limits.max_parts) {
      throw Error(ErrorCode::kTooLarge, "the series has more than the " +
                                            std::to_string(limits.max_parts) +
                                            " objects that are accepted");
    }
    const std::string mark = skip_head(window) + delimiter;
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
