// Bodies that are produced while they are sent.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/http/requests/request_values.h"
#include "server/net/sender.h"
#include "server/store/blob_store.h"

namespace isomesh::http {

// Part of a blob.
std::unique_ptr<net::Source> blob_source(std::unique_ptr<store::BlobReader> blob,
                                         const ByteRange& part);

// The text must live as long as the process.
std::unique_ptr<net::Source> text_source(std::string_view text);

// Returns the next bytes of a body, which may be empty; nothing at its end. An exception truncates
// the body.
using NextPiece = std::function<std::optional<std::string>()>;

// A body computed in pieces; in chunks (RFC 9112, 7.1), or delimited by the end of the connection.
std::unique_ptr<net::Source> computed_source(NextPiece next, bool in_chunks);

}  // namespace isomesh::http
