#include "server/http/responses/sources.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <span>
#include <utility>

namespace isomesh::http {
namespace {

constexpr std::size_t kBlockBytes = 64 * 1024;

class BlobSource : public net::Source {
 public:
  BlobSource(std::unique_ptr<store::BlobReader> blob, const ByteRange& part)
      : blob_(std::move(blob)), left_(part) {}

  More next(std::string& bytes) override {
    if (left_.length == 0) return More::kEnd;
    bytes.resize(static_cast<std::size_t>(std::min<std::uint64_t>(left_.length, kBlockBytes)));
    const std::size_t count = blob_->read_at(left_.first, std::as_writable_bytes(std::span(bytes)));
    bytes.resize(count);
    left_.first += count;
    left_.length -= count;
    return count > 0 ? More::kBytes : More::kBroken;
  }

 private:
  std::unique_ptr<store::BlobReader> blob_;
  ByteRange left_;
};

class TextSource : public net::Source {
 public:
  explicit TextSource(std::string_view text) : left_(text) {}

  More next(std::string& bytes) override {
    const std::string_view piece = left_.substr(0, kBlockBytes);
    bytes.append(piece);
    left_.remove_prefix(piece.size());
    return piece.empty() ? More::kEnd : More::kBytes;
  }

 private:
  std::string_view left_;
};

void append_chunk(std::string_view piece, std::string& bytes) {
  std::array<char, 16> size = {};
  const auto end = std::to_chars(size.data(), size.data() + size.size(), piece.size(), 16).ptr;
  bytes.append(size.data(), end).append("\r\n").append(piece).append("\r\n");
}

class ComputedSource : public net::Source {
 public:
  ComputedSource(NextPiece next, bool in_chunks) : next_(std::move(next)), in_chunks_(in_chunks) {}

  bool computes() const override { return true; }

  More next(std::string& bytes) override {
    if (is_over_) return More::kEnd;
    const auto piece = next_();
    is_over_ = !piece;
    if (!in_chunks_) {
      bytes.append(piece.value_or(""));
    } else if (is_over_ || !piece->empty()) {
      append_chunk(piece.value_or(""), bytes);  // an empty chunk is the last
    }
    return More::kBytes;
  }

 private:
  const NextPiece next_;
  const bool in_chunks_;
  bool is_over_ = false;
};

}  // namespace

std::unique_ptr<net::Source> blob_source(std::unique_ptr<store::BlobReader> blob,
                                         const ByteRange& part) {
  return std::make_unique<BlobSource>(std::move(blob), part);
}

std::unique_ptr<net::Source> text_source(std::string_view text) {
  return std::make_unique<TextSource>(text);
}

std::unique_ptr<net::Source> computed_source(NextPiece next, bool in_chunks) {
  return std::make_unique<ComputedSource>(std::move(next), in_chunks);
}

}  // namespace isomesh::http
