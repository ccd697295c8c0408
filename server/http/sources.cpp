#include "server/http/sources.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <span>
#include <utility>

#include <httplib.h>
#include <spdlog/spdlog.h>

#include "server/http/exchange.h"

namespace isomesh::http {
namespace {

constexpr std::size_t kBlockBytes = 64 * 1024;

class BlobSource : public Source {
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

void append_chunk(std::string_view piece, std::string& bytes) {
  std::array<char, 16> size = {};
  const auto end = std::to_chars(size.data(), size.data() + size.size(), piece.size(), 16).ptr;
  bytes.append(size.data(), end).append("\r\n").append(piece).append("\r\n");
}

class SliceSource : public Source {
 public:
  SliceSource(std::unique_ptr<volume::SlicePng> picture, bool in_chunks)
      : picture_(std::move(picture)), in_chunks_(in_chunks) {}

  More next(std::string& bytes) override {
    if (is_over_) return More::kEnd;
    const std::string_view piece = picture_->next();
    is_over_ = piece.empty();
    if (in_chunks_) {
      append_chunk(piece, bytes);  // an empty one is the last
    } else {
      bytes.append(piece);
    }
    return bytes.empty() ? More::kEnd : More::kBytes;
  }

 private:
  std::unique_ptr<volume::SlicePng> picture_;
  const bool in_chunks_;
  bool is_over_ = false;
};

// A source whose errors end the connection: the courier serves others too.
class GuardedSource : public Source {
 public:
  explicit GuardedSource(std::unique_ptr<Source> source) : source_(std::move(source)) {}

  More next(std::string& bytes) override {
    try {
      return source_->next(bytes);
    } catch (const std::exception& error) {
      spdlog::error("an answer was cut off: {}", error.what());
      return More::kBroken;
    }
  }

  bool ends_with_reader() const override { return source_->ends_with_reader(); }

 private:
  std::unique_ptr<Source> source_;
};

}  // namespace

std::unique_ptr<Source> blob_source(std::unique_ptr<store::BlobReader> blob,
                                    const ByteRange& part) {
  return std::make_unique<BlobSource>(std::move(blob), part);
}

std::unique_ptr<Source> slice_source(std::unique_ptr<volume::SlicePng> picture, bool in_chunks) {
  return std::make_unique<SliceSource>(std::move(picture), in_chunks);
}

void set_body(httplib::Response& response, Body body) {
  // The library asks for the body when it has written the headers, and is told that there is no
  // more to write.
  const auto source = std::make_shared<std::unique_ptr<Source>>(
      std::make_unique<GuardedSource>(std::move(body.source)));
  const auto hand_over = [source] {
    Exchange::current()->hand_over(std::move(*source));
    return false;
  };
  const auto without_length = [hand_over](std::size_t, httplib::DataSink&) { return hand_over(); };
  switch (body.framing) {
    case Framing::kLength:
      return response.set_content_provider(
          body.length, body.media_type,
          [hand_over](std::size_t, std::size_t, httplib::DataSink&) { return hand_over(); });
    case Framing::kChunks:
      return response.set_chunked_content_provider(body.media_type, without_length);
    case Framing::kUntilConnectionEnds:
      return response.set_content_provider(body.media_type, without_length);
  }
}

}  // namespace isomesh::http
