// Answers that are longer than a page: made while they are sent.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "server/http/courier.h"
#include "server/http/request.h"
#include "server/store/blob_store.h"
#include "server/volume/slice.h"

namespace httplib {
struct Response;
}

namespace isomesh::http {

// Part of a blob.
std::unique_ptr<Source> blob_source(std::unique_ptr<store::BlobReader> blob, const ByteRange& part);

// A picture. In chunks (RFC 9112, 7.1), or bare for receivers that know only the connection's end.
std::unique_ptr<Source> slice_source(std::unique_ptr<volume::SlicePng> picture, bool in_chunks);

enum class Framing {
  kLength,  // `length` bytes follow
  kChunks,  // the source makes chunks
  kUntilConnectionEnds,
};

struct Body {
  std::unique_ptr<Source> source;
  std::string media_type;
  Framing framing = Framing::kLength;
  std::uint64_t length = 0;  // not 0 with kLength
};

// Makes it the response's body, which a HEAD does not get. Within a handler of a Front only.
void set_body(httplib::Response& response, Body body);

}  // namespace isomesh::http
